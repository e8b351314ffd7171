"""Pictures in rows, with captions and bars of colours, drawn by matplotlib.

Without pyplot, which keeps state for the process and picks a window system.
"""

import bisect
import warnings
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from resdepth_colmap.geometry.resize import area_resized, nearest_resized
from resdepth_colmap.scene import ColorImage
from resdepth_colmap.viz.colormaps import HOLE_COLOR, ColorScale

_DPI = 72  # so that a point, matplotlib's unit of fonts, is a pixel
_GAP_PX = 20
_HEAD_PX = 66
_CAPTION_PX = 44
_BAR_GAP_PX = 10
_BAR_PX = 12
_BAR_TEXT_PX = 46
_FAINT: dict[str, Any] = {"color": "#5f5f5f"}


class Panel(NamedTuple):
    """A picture with two lines of text above.

    Attributes:
        picture: RGB values, drawn pixel for pixel.
        title: First line.
        detail: Second line.
        scale: What the bar below shows; None = no bar.
        bar_panels: How many panels, from this one on, the bar is below.
    """

    picture: ColorImage
    title: str
    detail: str
    scale: ColorScale | None = None
    bar_panels: int = 1


def draw_panels(
    title: str, note: str, panels: Sequence[Panel], num_columns: int, least_px: int
) -> ColorImage:
    """Draw panels row by row, under a title and a note, as one picture.

    Args:
        title: Written letter for letter: a file may be called `a$b$`.
        note: Below the title.
        panels: What to draw.
        num_columns: Panels in a row.
        least_px: Width of a panel whose picture is narrower.
    """
    width_px = max([least_px, *(panel.picture.shape[1] for panel in panels)])
    heights_px = [_HEAD_PX]
    for start in range(0, len(panels), num_columns):
        in_row = panels[start : start + num_columns]
        bar_px = (
            [_BAR_PX, _BAR_TEXT_PX] if any(it.scale for it in in_row) else [0, _GAP_PX]
        )
        picture_px = max(panel.picture.shape[0] for panel in in_row)
        heights_px += [_CAPTION_PX, picture_px, _BAR_GAP_PX, *bar_px]
    grid = _pixel_grid([_GAP_PX, *([width_px, _GAP_PX] * num_columns)], heights_px)
    with warnings.catch_warnings():
        # Letters that the font does not have become boxes: good enough for a name.
        warnings.filterwarnings("ignore", message="Glyph")
        _add_text(grid[0, 1:-1], title, 10, size=19, weight="bold")
        _add_text(grid[0, 1:-1], note, 36, size=14, **_FAINT)
        for index, panel in enumerate(panels):
            row, column = divmod(index, num_columns)
            _add_panel(grid, 1 + 5 * row, 1 + 2 * column, panel)
        return rendered(grid.figure)


def rendered(figure: Figure) -> ColorImage:
    """A figure as a picture, shape (height, width, 3), uint8."""
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def fitted_size(shape: tuple[int, ...], long_side_px: int) -> tuple[int, int]:
    """Width and height of a picture of the same form with that long side."""
    height_px, width_px = shape[:2]
    scale = long_side_px / max(height_px, width_px)
    return max(1, round(width_px * scale)), max(1, round(height_px * scale))


def resized(rgb: ColorImage, size_px: tuple[int, int]) -> ColorImage:
    """A picture of another size: averaged when smaller, pixels visible when larger."""
    is_smaller = size_px < rgb.shape[1::-1]
    return area_resized(rgb, size_px) if is_smaller else nearest_resized(rgb, size_px)


def _pixel_grid(widths_px: Sequence[int], heights_px: Sequence[int]) -> Any:
    """The grid of a new figure, with columns and rows of exactly these sizes."""
    size = (sum(widths_px) / _DPI, sum(heights_px) / _DPI)
    figure = Figure(figsize=size, dpi=_DPI, facecolor="white")
    FigureCanvasAgg(figure)  # to measure text
    ratios = {"height_ratios": heights_px, "width_ratios": widths_px}
    edges = {"left": 0, "right": 1, "bottom": 0, "top": 1, "wspace": 0, "hspace": 0}
    return figure.add_gridspec(len(heights_px), len(widths_px), **ratios, **edges)


def _add_panel(grid: Any, top: int, left: int, panel: Panel) -> None:
    _add_text(grid[top, left], panel.title, 0, size=14, weight="bold")
    _add_text(grid[top, left], panel.detail, 20, size=13, **_FAINT)
    corner = grid[top + 1, left].get_position(grid.figure).corners()[1]  # upper left
    x, y = np.rint(corner * grid.figure.bbox.size).astype(int)
    # Not imshow, which resamples where rounding puts an axis beside a pixel's edge.
    grid.figure.figimage(panel.picture, x, y - len(panel.picture), origin="upper")
    if panel.scale:
        last = left + 2 * (panel.bar_panels - 1)
        _add_bar(grid[top + 3, left : last + 1], panel.scale)


def _add_text(cell: Any, text: str, top_px: float, **style: Any) -> None:
    """Write a line into a cell; of one that is too long, an ellipsis and its end."""
    figure = cell.get_gridspec().figure
    box = cell.get_position(figure)
    y = box.y1 - top_px / figure.bbox.height
    line = figure.text(box.x0, y, text, va="top", parse_math=False, **style)

    def fits(start: int) -> bool:
        line.set_text("…" + text[start:] if start else text)
        return bool(line.get_window_extent().width <= box.width * figure.bbox.width)

    if not fits(0):
        fits(bisect.bisect_left(range(len(text)), True, lo=1, key=fits))


def _add_bar(cell: Any, scale: ColorScale) -> None:
    """Draw the colours of a scale with its ticks, and the colour of holes."""
    axes = cell.get_gridspec().figure.add_subplot(cell)
    bar = axes.figure.colorbar(scale.mappable, cax=axes, orientation="horizontal")
    bar.outline.set_visible(False)
    units, texts = zip(*scale.ticks, strict=True)
    bar.set_ticks(scale.norm.inverse(np.array(units)), labels=texts)
    bar.minorticks_off()
    axes.tick_params(length=3, pad=2, labelsize=12)
    for unit, text in zip(units, axes.get_xticklabels(), strict=True):
        # The outermost texts stay below the bar.
        text.set_ha("left" if unit < 0.04 else "right" if unit > 0.96 else "center")
    _add_text(cell, scale.label, _BAR_PX + 22, size=12, **_FAINT)
    axes.legend(
        handles=[Patch(color=HOLE_COLOR, label=scale.hole)],
        loc="upper right",
        bbox_to_anchor=(1, -22 / _BAR_PX),
        **{"fontsize": 12, "labelcolor": _FAINT["color"], "frameon": False},
        **{"handlelength": 1, "handleheight": 1, "handletextpad": 0.5},
        **{"borderpad": 0, "borderaxespad": 0},
    )
