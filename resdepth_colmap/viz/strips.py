"""One image's before and after: photo, both depth maps, what changed, what is wrong."""

import dataclasses
import functools
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from resdepth_colmap.geometry.resize import nearest_resized
from resdepth_colmap.scene import ColorImage, DepthMap, FloatMap
from resdepth_colmap.viz.colormaps import (
    DepthScale,
    difference_scale,
    error_scale,
    relative_difference,
)
from resdepth_colmap.viz.panels import Panel, draw_panels, fitted_size, resized

_PANEL_PX = 480
_LEAST_PANEL_PX = 250
_THUMBNAIL_PX = 220
_TALLEST_THUMBNAIL_PX = 280
_LEAST_BLOCK_PX = 470
_GAP_PX = 10
_BAD_ERROR = 0.02

Size = tuple[int, int]
"""Width and height, in pixels."""


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class BeforeAfter:
    """What a strip shows; ValueError if the maps differ in size.

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

    def __post_init__(self) -> None:
        """Compare the sizes."""
        maps = (self.before, self.after, self.truth)
        shapes = [depth.shape for depth in maps if depth is not None]
        if len(set(shapes)) > 1:
            raise ValueError(f"maps of {self.name} differ in size: {shapes}.")

    @functools.cached_property
    def difference(self) -> FloatMap:
        """Relative difference, shape (H, W); NaN where either has no depth."""
        return relative_difference(self.before, self.after)

    @functools.cached_property
    def scale(self) -> DepthScale:
        """The colours of both depth maps: those of the range of the refined one."""
        return DepthScale.of(self.after, self.before)

    def pictures(self, long_side_px: int) -> list[ColorImage]:
        """Photo, initial and refined depth in one size."""
        size_px = fitted_size(self.before.shape, long_side_px)
        maps = (self.before, self.after)
        shown = [_shown(depth, self.scale.colored, size_px) for depth in maps]
        return [resized(self.rgb, size_px), *shown]


def depth_strip(content: BeforeAfter) -> ColorImage:
    """Draw photo, both depth maps, difference and, with the truth, both errors."""
    before, after, difference = content.before, content.after, content.difference
    size_px = fitted_size(before.shape, _PANEL_PX)
    photo, initial, refined = content.pictures(_PANEL_PX)
    filled = [f"{_filled(depth)} of the pixels filled" for depth in (before, after)]
    scale = difference_scale(difference)
    change = f"median {_median(difference)} of the depth"
    panels = [
        Panel(photo, "Photo", _size(content.rgb)),
        Panel(initial, "Initial depth", filled[0], content.scale.colors, bar_panels=2),
        Panel(refined, "Refined depth", filled[1]),
        Panel(_shown(difference, scale.colored, size_px), "Difference", change, scale),
    ]
    if content.truth is not None:
        error = _error_panel(before, content.truth, "Error, initial")
        panels.append(error._replace(scale=error_scale(), bar_panels=2))
        panels.append(_error_panel(after, content.truth, "Error, refined"))
    note = f"depth maps of {_size(before)}, filled {_filled(before)} → {_filled(after)}"
    num_columns = 4 if content.truth is None else 3
    return draw_panels(content.name, note, panels, num_columns, _LEAST_PANEL_PX)


def thumbnails(content: BeforeAfter) -> Panel:
    """Photo, initial and refined depth of an image, small, for the overview."""
    height_px, width_px = content.before.shape
    tall_px = round(height_px * _THUMBNAIL_PX / width_px)
    long_side_px = max(_THUMBNAIL_PX, min(tall_px, _TALLEST_THUMBNAIL_PX))
    photo, before, after = content.pictures(long_side_px)
    gap = np.full((photo.shape[0], _GAP_PX, 3), 255, np.uint8)
    filled = f"{_filled(content.before)} → {_filled(content.after)}"
    return Panel(
        np.hstack([photo, gap, before, gap, after]),
        content.name,
        f"filled {filled}, median change {_median(content.difference)}",
        content.scale.colors._replace(
            ticks=[(0.0, "far"), (1.0, "near")],
            label="each image by itself: the 2-98 % range of its refined inverse depth",
        ),
    )


def overview(title: str, images: Sequence[Panel], num_images: int) -> ColorImage:
    """Draw a workspace: photo, initial and refined depth of some of its images.

    Each image has its own colours (linear in inverse depth, near = red), because the
    images of a workspace may be of different parts of the scene.

    Args:
        title: What the workspace is called.
        images: The `thumbnails` of those to show.
        num_images: How many there are in all.
    """
    panels = [*(panel._replace(scale=None) for panel in images[:-1]), *images[-1:]]
    shown = "photo | initial depth | refined depth"
    note = f"{len(images)} of {num_images} images: {shown}"
    num_columns = max(1, min(2, len(images)))
    return draw_panels(title, note, panels, num_columns, _LEAST_BLOCK_PX)


def _error_panel(depth: DepthMap, truth: DepthMap, title: str) -> Panel:
    error = np.abs(relative_difference(truth, depth))
    bad = 100 * _share(~(error[truth > 0] <= _BAD_ERROR))  # holes are bad
    detail = f"median {_median(error)}, {bad:.0f} % off by > 2 %"
    size_px = fitted_size(depth.shape, _PANEL_PX)
    return Panel(_shown(error, error_scale().colored, size_px), title, detail)


def _shown(
    values: FloatMap, colored: Callable[[FloatMap], ColorImage], size_px: Size
) -> ColorImage:
    """A map in its colours. They are averaged, values are not: 0 or NaN is a hole."""
    enough_px = (2 * size_px[0], 2 * size_px[1])
    if enough_px < values.shape[::-1]:
        values = nearest_resized(values, enough_px)
    return resized(colored(values), size_px)


def _size(picture: ColorImage | DepthMap) -> str:
    return f"{picture.shape[1]} x {picture.shape[0]} px"


def _filled(depth: DepthMap) -> str:
    return f"{100 * _share(depth > 0):.1f} %"


def _share(flags: npt.NDArray[np.bool_]) -> float:
    return float(np.count_nonzero(flags) / max(flags.size, 1))


def _median(relative: FloatMap) -> str:
    """Median of the magnitudes in percent; 0 if all are NaN."""
    present = np.abs(relative[np.isfinite(relative)])
    return f"{100 * np.median(present) if present.size else 0:.2g} %"
