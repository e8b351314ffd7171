"""Stage "pictures": what the refinement changed, for people to look at."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.geometry.resize import nearest_resized
from resdepth_colmap.io.colmap.maps import read_depth_map
from resdepth_colmap.io.colmap.output import OVERVIEW_NAME, OutputWorkspace
from resdepth_colmap.io.files import safe_name
from resdepth_colmap.io.images import read_rgb, write_png
from resdepth_colmap.pipeline.initial_map import map_path
from resdepth_colmap.pipeline.masks import masked_depth
from resdepth_colmap.pipeline.refine.stage import RefineReport
from resdepth_colmap.progress import Progress
from resdepth_colmap.scene import FloatMap, Scene
from resdepth_colmap.viz.strips import BeforeAfter, depth_strip, overview, thumbnails

FOLDER = "pictures"
MOST_IN_OVERVIEW = 12


def draw_workspace(
    output: OutputWorkspace, scene: Scene, report: RefineReport, progress: Progress
) -> Path:
    """Draw a strip of each refined image, and an overview of them all.

    Strips go to `pictures/`; those of images that were kept are not drawn again.

    Returns:
        The overview, `overview.png`.

    Raises:
        WorkspaceError: If a map or an image cannot be read, or a picture not written.
    """
    names = [view.name for view in scene.views if view.name in report.images]
    shown = evenly_chosen(names, MOST_IN_OVERVIEW)
    panels = []
    with progress.stage("Drawing", len(names)) as advance:
        for name in names:
            path = output.path / FOLDER / f"{safe_name(name)}.png"
            is_due = name in report.refined or not path.exists()
            if is_due or name in shown:
                kind = report.images[name]["input"]
                content = read_before_after(output, name, kind)
                if is_due:
                    write_png(path, depth_strip(content))
                if name in shown:
                    panels.append(thumbnails(content))
            advance(1)
    path = output.path / OVERVIEW_NAME
    write_png(path, overview(output.source.path.name, panels, len(names)))
    return path


def evenly_chosen(names: Sequence[str], most: int) -> list[str]:
    """At most so many of the names, evenly spread, first and last included."""
    if len(names) <= most:
        return list(names)
    places = np.linspace(0, len(names) - 1, most).round().astype(int)
    return [names[place] for place in places]


def read_before_after(output: OutputWorkspace, name: str, kind: str) -> BeforeAfter:
    """Read photo, initial and refined depth, and ground truth of the maps' size.

    What the mask of the image leaves out is 0 in all of them.

    Args:
        output: Has the refined map; its source photo, initial map and masks.
        name: Image name.
        kind: The kind of the initial map.

    Raises:
        WorkspaceError: If a file is missing or broken, or the maps differ in size.
    """
    source, after_path = output.source, output.depth_map_path(name)
    after = masked_depth(source.masks, name, read_depth_map(after_path))
    before = read_depth_map(map_path(source, name, kind))
    before = masked_depth(source.masks, name, before)
    check_equal_size(after_path, after, "the initial map", before)
    path, truth = source.truth_path(name), None
    if path.is_file():
        truth = nearest_resized(read_depth_map(path), after.shape[::-1])
        truth = masked_depth(source.masks, name, truth)
    rgb = read_rgb(source.image_path(name))
    return BeforeAfter(name=name, rgb=rgb, before=before, after=after, truth=truth)


def check_equal_size(path: Path, values: FloatMap, of: str, other: FloatMap) -> None:
    """WorkspaceError, naming the file, if a map differs in size from another one."""
    if values.shape != other.shape:
        sizes = [f"{it.shape[1]} x {it.shape[0]}" for it in (values, other)]
        raise WorkspaceError(
            f"{path}: {sizes[0]} px, but {of} has {sizes[1]}; refine it again with "
            "--overwrite."
        )
