"""One image's before and after: photo, both depth maps, what changed, what is wrong."""

import dataclasses
from typing import NamedTuple, Self

import numpy as np

from resdepth_colmap.scene import ColorImage, DepthMap, FloatMap
from resdepth_colmap.viz.canvas import (
    BAR_HEIGHT_PX,
    BAR_LABEL_HEIGHT_PX,
    Canvas,
    fitted_size,
    resized,
    shortened,
)
from resdepth_colmap.viz.colormaps import (
    DEPTH_COLORS,
    DIFFERENCE_COLORS,
    ERROR_COLORS,
    DepthScale,
    colored_difference,
    colored_error,
    difference_limit,
    relative_difference,
)

PANEL_LONG_SIDE_PX = 480
LEAST_PANEL_WIDTH_PX = 250  # the words above a panel need as much

_MARGIN_PX = 20
_GAP_PX = 14
_TITLE_HEIGHT_PX = 40
_CAPTION_HEIGHT_PX = 44
_LEGEND_HEIGHT_PX = 10 + BAR_HEIGHT_PX + BAR_LABEL_HEIGHT_PX + 26
_BAD_ERROR = 0.02


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class BeforeAfter:
    """What a strip shows.

    Attributes:
        name: Image name.
        rgb: The photo, of any size.
        before: Initial depth, shape (H, W), in workspace units; 0 = no depth.
        after: Refined depth, same shape.
        truth: True depth, same shape, 0 = not known; None = nothing is known.
    """

    name: str
    rgb: ColorImage
    before: DepthMap
    after: DepthMap
    truth: DepthMap | None = None

    @property
    def filled(self) -> tuple[float, float]:
        """Share of pixels with a depth before and after, in 0..1."""
        return filled_share(self.before), filled_share(self.after)


class _Panel(NamedTuple):
    picture: ColorImage
    title: str
    detail: str


class _Bar(NamedTuple):
    colors: str
    ticks: list[tuple[float, str]]
    label: str
    hole: str


def filled_share(depth: DepthMap) -> float:
    """Share of pixels with a depth, in 0..1; 0 of an empty map."""
    return float(np.count_nonzero(depth > 0) / max(depth.size, 1))


def depth_strip(content: BeforeAfter) -> ColorImage:
    """Draw the strip: photo, initial depth, refined depth, difference.

    Both depth maps have the same colours, linear in inverse depth over the 2-98 % range
    of the refined one. With the truth, the relative error of both maps follows.

    Returns:
        RGB values, shape (height, width, 3), uint8.

    Raises:
        ValueError: If the maps differ in size.
    """
    _check_sizes(content)
    scale = DepthScale.of(content.after, content.before)
    difference = relative_difference(content.before, content.after)
    limit = difference_limit(difference)
    panels = [
        *_depth_panels(content, scale),
        _Panel(
            colored_difference(difference, limit),
            "Difference",
            f"median {100 * _median(np.abs(difference)):.2g} % of the depth",
        ),
        *_error_panels(content),
    ]
    grid = _Grid.of(content, len(panels))
    canvas = Canvas(grid.canvas_width_px, grid.canvas_height_px)
    _write_title(canvas, content)
    for place, panel in enumerate(panels):
        _draw_panel(canvas, grid, place, panel)
    _draw_bars(canvas, grid, scale, limit)
    return canvas.rgb()


@dataclasses.dataclass(frozen=True, kw_only=True)
class _Grid:
    """Where the panels are: without the truth in one row, with it in two of three."""

    width_px: int
    height_px: int
    num_columns: int
    num_rows: int

    @classmethod
    def of(cls, content: BeforeAfter, num_panels: int) -> Self:
        height_px, width_px = fitted_size(content.before.shape, PANEL_LONG_SIDE_PX)
        num_rows = 1 if content.truth is None else 2
        return cls(
            width_px=width_px,
            height_px=height_px,
            num_columns=num_panels // num_rows,
            num_rows=num_rows,
        )

    @property
    def pitch_px(self) -> int:
        return max(self.width_px, LEAST_PANEL_WIDTH_PX) + _GAP_PX

    @property
    def row_px(self) -> int:
        return _CAPTION_HEIGHT_PX + self.height_px + _LEGEND_HEIGHT_PX

    @property
    def canvas_width_px(self) -> int:
        return 2 * _MARGIN_PX + self.num_columns * self.pitch_px - _GAP_PX

    @property
    def canvas_height_px(self) -> int:
        return _TITLE_HEIGHT_PX + self.num_rows * self.row_px

    def corner(self, place: int) -> tuple[int, int]:
        """Left and top of a panel with its caption."""
        row, column = divmod(place, self.num_columns)
        left_px = _MARGIN_PX + column * self.pitch_px
        return left_px, _TITLE_HEIGHT_PX + row * self.row_px


def _check_sizes(content: BeforeAfter) -> None:
    shapes = [content.before.shape, content.after.shape]
    if content.truth is not None:
        shapes.append(content.truth.shape)
    if len(set(shapes)) > 1:
        raise ValueError(f"maps of {content.name} differ in size: {shapes}.")


def _depth_panels(content: BeforeAfter, scale: DepthScale) -> list[_Panel]:
    before, after = content.filled
    height_px, width_px = content.before.shape
    return [
        _Panel(content.rgb, "Photo", f"depth maps of {width_px} x {height_px} px"),
        _Panel(scale.colored(content.before), "Initial depth", _filled_text(before)),
        _Panel(scale.colored(content.after), "Refined depth", _filled_text(after)),
    ]


def _error_panels(content: BeforeAfter) -> list[_Panel]:
    if content.truth is None:
        return []
    panels = []
    for depth, title in ((content.before, "initial"), (content.after, "refined")):
        error = np.abs(relative_difference(content.truth, depth))
        known = content.truth > 0
        bad = ~(error[known] <= _BAD_ERROR)  # holes are bad
        share = float(bad.mean()) if bad.size else 0.0
        detail = (
            f"median {100 * _median(error):.2g} %, {100 * share:.0f} % off by > 2 %"
        )
        panels.append(_Panel(colored_error(error), f"Error, {title}", detail))
    return panels


def _write_title(canvas: Canvas, content: BeforeAfter) -> None:
    right_px = canvas.width_px - _MARGIN_PX
    before, after = content.filled
    text = f"filled {_percent(before)} → {_percent(after)}"
    canvas.words(text, right_px, 13, size_px=16, align="right")
    num_letters = (canvas.width_px - 2 * _MARGIN_PX - 240) // 12
    name = shortened(content.name, num_letters)
    canvas.words(name, _MARGIN_PX, 11, size_px=18, bold=True)


def _draw_panel(canvas: Canvas, grid: _Grid, place: int, panel: _Panel) -> None:
    left_px, top_px = grid.corner(place)
    canvas.words(panel.title, left_px, top_px, bold=True)
    canvas.words(panel.detail, left_px, top_px + 20, size_px=13, faint=True)
    picture = resized(panel.picture, grid.height_px, grid.width_px)
    canvas.picture(picture, left_px, top_px + _CAPTION_HEIGHT_PX)


def _draw_bars(canvas: Canvas, grid: _Grid, scale: DepthScale, limit: float) -> None:
    depth = _Bar(DEPTH_COLORS, scale.ticks(), "depth in workspace units", "no depth")
    _draw_bar(canvas, grid, (1, 2), depth)
    percent = 100 * limit
    ticks = [(0.0, f"-{percent:g} %"), (0.5, "0"), (1.0, f"+{percent:g} %")]
    difference = _Bar(DIFFERENCE_COLORS, ticks, "nearer | farther", "was a hole")
    _draw_bar(canvas, grid, (3, 3), difference)
    if grid.num_rows > 1:
        ticks = [(0.0, "0.1 %"), (0.5, "1 %"), (1.0, "10 %")]
        hole = "no depth or no truth"
        error = _Bar(ERROR_COLORS, ticks, "error, in percent of the depth", hole)
        _draw_bar(canvas, grid, (4, 5), error)


def _draw_bar(canvas: Canvas, grid: _Grid, places: tuple[int, int], bar: _Bar) -> None:
    """A bar below the panels from the first to the last of these places."""
    (left_px, top_px), (last_px, _) = map(grid.corner, places)
    width_px = last_px + grid.width_px - left_px
    top_px += _CAPTION_HEIGHT_PX + grid.height_px + 10
    canvas.bar(bar.colors, bar.ticks, left_px, top_px, width_px)
    words_px = top_px + BAR_HEIGHT_PX + BAR_LABEL_HEIGHT_PX + 2
    canvas.words(bar.label, left_px, words_px, size_px=12, faint=True)
    canvas.hole_legend(bar.hole, left_px + width_px, words_px)


def _filled_text(share: float) -> str:
    return f"{_percent(share)} of the pixels filled"


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _median(values: FloatMap) -> float:
    present = values[np.isfinite(values)]
    return float(np.median(present)) if present.size else 0.0
