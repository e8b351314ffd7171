"""Stage "pictures": what the refinement changed, for people to look at."""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from resdepth_colmap.geometry.resize import nearest_resized
from resdepth_colmap.io.colmap.depth_map import read_depth_map
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.images import read_rgb, write_png
from resdepth_colmap.pipeline.initial_map import map_path
from resdepth_colmap.pipeline.masks import masked_depth
from resdepth_colmap.pipeline.refine.stage import RefineReport
from resdepth_colmap.progress import Progress
from resdepth_colmap.scene import ColorImage, Scene
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
    DepthScale,
    relative_difference,
)
from resdepth_colmap.viz.strips import BeforeAfter, depth_strip, filled_share

FOLDER = "pictures"
OVERVIEW_NAME = "overview.png"
MOST_IN_OVERVIEW = 12

_THUMBNAIL_PX = 220
_LEAST_CELL_PX = 470  # the words of the legend need as much
_WIDEST_PX = 1700
_TALLEST_PX = 280  # of a portrait thumbnail
_MARGIN_PX = 20
_GAP_PX = 10
_HEAD_PX = 70
_CAPTION_PX = 40
_FOOT_PX = 10 + BAR_HEIGHT_PX + BAR_LABEL_HEIGHT_PX + 24


class _Row(NamedTuple):
    """One image in the overview: its pictures, and the words below them."""

    name: str
    pictures: tuple[ColorImage, ...]
    detail: str


def draw_workspace(
    output: OutputWorkspace, scene: Scene, report: RefineReport, progress: Progress
) -> Path:
    """Draw a strip of each refined image, and an overview of them all.

    Strips of images that were kept, and have one, are not drawn again.

    Args:
        output: Where the refined maps are; pictures go to `pictures/` there.
        scene: The views.
        report: Which images were refined, from what.
        progress: Is told of each image.

    Returns:
        The overview, `overview.png`.

    Raises:
        WorkspaceError: If a map or an image cannot be read, or a picture not written.
    """
    names = [view.name for view in scene.views if view.name in report.images]
    with progress.stage("Drawing", len(names)) as advance:
        for name in names:
            path = output.path / FOLDER / f"{name}.png"
            if name in report.refined or not path.exists():
                write_png(path, depth_strip(_load(output, report, name)))
            advance(1)
    shown = evenly_chosen(names, MOST_IN_OVERVIEW)
    contents = (_load(output, report, name) for name in shown)
    path = output.path / OVERVIEW_NAME
    write_png(path, overview(output.source.path.name, contents, len(names)))
    return path


def overview(
    title: str, contents: Iterable[BeforeAfter], num_images: int
) -> ColorImage:
    """Draw a workspace: photo, initial and refined depth of some of its images.

    Each image has its own colours (linear in inverse depth, near = red), because the
    images of a workspace may be of different parts of the scene.

    Args:
        title: What the workspace is called.
        contents: The images to show; they are loaded one at a time.
        num_images: How many there are in all.

    Returns:
        RGB values, shape (height, width, 3), uint8.
    """
    rows = [_row(content) for content in contents]
    cell_px = max([_LEAST_CELL_PX, *(_width_px(row) for row in rows)])
    num_fitting = max(2, _WIDEST_PX // cell_px)
    num_columns = max(1, min(num_fitting, math.ceil(math.sqrt(len(rows)))))
    lines = [rows[at : at + num_columns] for at in range(0, len(rows), num_columns)]
    pitch_px = cell_px + 3 * _GAP_PX
    width_px = 2 * _MARGIN_PX + num_columns * pitch_px - 3 * _GAP_PX
    lines_px = sum(_height_px(line) for line in lines)
    canvas = Canvas(width_px, _HEAD_PX + lines_px + _FOOT_PX)
    canvas.words(shortened(title, 50), _MARGIN_PX, 12, size_px=20, bold=True)
    words = f"{len(rows)} of {num_images} images: photo | initial depth | refined depth"
    canvas.words(words, _MARGIN_PX, 42, faint=True)
    top_px = _HEAD_PX
    for line in lines:
        for column, row in enumerate(line):
            _draw_row(canvas, row, _MARGIN_PX + column * pitch_px, top_px)
        top_px += _height_px(line)
    _draw_legend(canvas, top_px, cell_px)
    return canvas.rgb()


def evenly_chosen(names: Sequence[str], most: int) -> list[str]:
    """At most so many of the names, evenly spread, first and last included."""
    if len(names) <= most:
        return list(names)
    places = np.linspace(0, len(names) - 1, most).round().astype(int)
    return [names[place] for place in places]


def _width_px(row: _Row) -> int:
    return int(sum(picture.shape[1] + _GAP_PX for picture in row.pictures)) - _GAP_PX


def _height_px(line: Sequence[_Row]) -> int:
    tallest_px = max(row.pictures[0].shape[0] for row in line)
    return int(tallest_px) + _CAPTION_PX + _GAP_PX


def _draw_row(canvas: Canvas, row: _Row, left_px: int, top_px: int) -> None:
    for place, picture in enumerate(row.pictures):
        step_px = picture.shape[1] + _GAP_PX
        canvas.picture(picture, left_px + place * step_px, top_px)
    below_px = top_px + row.pictures[0].shape[0] + 4
    canvas.words(shortened(row.name, 40), left_px, below_px, size_px=13, bold=True)
    canvas.words(row.detail, left_px, below_px + 17, size_px=12, faint=True)


def _draw_legend(canvas: Canvas, top_px: int, width_px: int) -> None:
    ticks = [(0.0, "far"), (1.0, "near")]
    canvas.bar(DEPTH_COLORS, ticks, _MARGIN_PX, top_px, width_px)
    words_px = top_px + BAR_HEIGHT_PX + BAR_LABEL_HEIGHT_PX + 2
    text = "each image by itself: the 2-98 % range of its refined inverse depth"
    canvas.words(text, _MARGIN_PX, words_px, size_px=12, faint=True)
    canvas.hole_legend("no depth", _MARGIN_PX + width_px, words_px)


def _row(content: BeforeAfter) -> _Row:
    scale = DepthScale.of(content.after, content.before)
    height_px, width_px = content.before.shape
    scaled_px = round(height_px * _THUMBNAIL_PX / width_px)
    long_side_px = max(_THUMBNAIL_PX, min(scaled_px, _TALLEST_PX))
    size = fitted_size((height_px, width_px), long_side_px)
    pictures = (
        content.rgb,
        scale.colored(content.before),
        scale.colored(content.after),
    )
    change = np.abs(relative_difference(content.before, content.after))
    change = change[np.isfinite(change)]
    median = float(np.median(change)) if change.size else 0.0
    detail = (
        f"filled {100 * filled_share(content.before):.1f} → "
        f"{100 * filled_share(content.after):.1f} %, "
        f"median change {100 * median:.2g} %"
    )
    return _Row(
        content.name,
        tuple(resized(picture, size[0], size[1]) for picture in pictures),
        detail,
    )


def _load(output: OutputWorkspace, report: RefineReport, name: str) -> BeforeAfter:
    source = output.source
    before = read_depth_map(map_path(source, name, report.images[name]["input"]))
    before = masked_depth(source.masks, name, before)
    after = read_depth_map(output.depth_map_path(name))
    truth_path = source.truth_path(name)
    truth = None
    if truth_path.is_file():
        truth = nearest_resized(read_depth_map(truth_path), before.shape[::-1])
        truth = masked_depth(source.masks, name, truth)
    rgb = read_rgb(source.image_path(name))
    return BeforeAfter(name=name, rgb=rgb, before=before, after=after, truth=truth)
