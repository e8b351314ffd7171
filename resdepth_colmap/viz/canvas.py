"""A white sheet for pictures, colour bars and words, laid out in pixels.

matplotlib's objects alone: pyplot keeps state for the whole process, and picks a
window system.
"""

import warnings
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from resdepth_colmap.scene import ColorImage
from resdepth_colmap.viz.colormaps import HOLE_COLOR, color_bar

_DPI = 100
_POINTS_PER_PX = 72 / _DPI
_INK = "#1a1a1a"
_FAINT_INK = "#5f5f5f"

BAR_HEIGHT_PX = 12
BAR_LABEL_HEIGHT_PX = 20
TEXT_PX = 14


class Canvas:
    """A sheet; positions are pixels from its upper left corner."""

    def __init__(self, width_px: int, height_px: int) -> None:
        """An empty sheet of that size."""
        self.width_px = width_px
        self.height_px = height_px
        size = (width_px / _DPI, height_px / _DPI)
        self._figure: Any = Figure(figsize=size, dpi=_DPI, facecolor="white")
        self._canvas: Any = FigureCanvasAgg(self._figure)

    def picture(self, rgb: ColorImage, left_px: int, top_px: int) -> None:
        """Put a picture there, pixel for pixel."""
        below = self.height_px - top_px - rgb.shape[0]
        self._figure.figimage(rgb, left_px, below, origin="upper")

    def words(
        self,
        text: str,
        left_px: float,
        top_px: float,
        *,
        size_px: float = TEXT_PX,
        **style: Any,
    ) -> None:
        """Write a line, its top at `top_px`.

        Args:
            text: What to write, letter for letter.
            left_px: Where it begins; with align="right" where it ends, with "center"
                its middle.
            top_px: Top of the line.
            size_px: Size of the letters.
            style: faint=True for grey ink, bold=True, align.
        """
        self._figure.text(
            left_px / self.width_px,
            1 - top_px / self.height_px,
            text,
            fontsize=size_px * _POINTS_PER_PX,
            color=_FAINT_INK if style.get("faint") else _INK,
            weight="bold" if style.get("bold") else "normal",
            ha=style.get("align", "left"),
            va="top",
            parse_math=False,  # a file may be called a$b$
        )

    def bar(
        self,
        colors: str,
        ticks: Sequence[tuple[float, str]],
        left_px: int,
        top_px: int,
        width_px: int,
    ) -> None:
        """A bar of all colours of a scale, with its ticks (where in 0..1, text)."""
        self.picture(color_bar(colors, width_px, BAR_HEIGHT_PX), left_px, top_px)
        for unit, text in ticks:
            x = left_px + unit * (width_px - 1)
            top = top_px + BAR_HEIGHT_PX
            self._box(x - 0.5, top, 1, 3, _INK)
            # The outermost words stay below the bar.
            align = "left" if unit < 0.04 else "right" if unit > 0.96 else "center"
            self.words(text, x, top + 4, size_px=12, align=align)

    def hole_legend(self, text: str, right_px: float, top_px: float) -> None:
        """What the colour of holes stands for; ends about at `right_px`."""
        left_px = right_px - 6.8 * len(text) - 18
        color = tuple(value / 255 for value in HOLE_COLOR)
        self._box(left_px, top_px + 1, 12, 12, color)
        self.words(text, left_px + 18, top_px, size_px=12, faint=True)

    def rgb(self) -> ColorImage:
        """The sheet as a picture, shape (height_px, width_px, 3), uint8."""
        with warnings.catch_warnings():
            # Letters that the font does not have become boxes: good enough for a name.
            warnings.filterwarnings("ignore", message="Glyph")
            self._canvas.draw()
        return np.array(self._canvas.buffer_rgba())[..., :3].copy()

    def _box(
        self,
        left_px: float,
        top_px: float,
        width_px: float,
        height_px: float,
        color: Any,
    ) -> None:
        corner = (left_px / self.width_px, 1 - (top_px + height_px) / self.height_px)
        box = Rectangle(
            corner,
            width_px / self.width_px,
            height_px / self.height_px,
            facecolor=color,
            transform=self._figure.transFigure,
        )
        self._figure.add_artist(box)


def fitted_size(shape: tuple[int, ...], long_side_px: int) -> tuple[int, int]:
    """Height and width of a picture of the same form with that long side."""
    height_px, width_px = shape[:2]
    scale = long_side_px / max(height_px, width_px)
    return max(1, round(height_px * scale)), max(1, round(width_px * scale))


def resized(rgb: ColorImage, height_px: int, width_px: int) -> ColorImage:
    """A picture of another size: averaged when smaller, pixels visible when larger."""
    smaller = height_px < rgb.shape[0]
    interpolation = cv2.INTER_AREA if smaller else cv2.INTER_NEAREST
    size = (width_px, height_px)
    return np.asarray(cv2.resize(rgb, size, interpolation=interpolation), np.uint8)


def shortened(text: str, num_letters: int) -> str:
    """The text, or its end after an ellipsis."""
    if len(text) <= num_letters:
        return text
    return "…" + text[-max(1, num_letters - 1) :]
