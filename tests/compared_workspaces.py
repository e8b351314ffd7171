"""Workspaces of the exact plane with filtered, unfiltered and refined maps."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from planes import PlaneView, write_plane_workspace

from resdepth_colmap.io.colmap.maps import write_depth_map, write_normal_map
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.scene import DepthMap

Change = Callable[[DepthMap], DepthMap]

NUM_HOLE_ROWS = 20


def exact(depth: DepthMap) -> DepthMap:
    """The true depth."""
    return depth


def with_hole(depth: DepthMap) -> DepthMap:
    """The true depth, without any in the upper third."""
    holed = depth.copy()
    holed[:NUM_HOLE_ROWS] = 0
    return holed


def too_far(depth: DepthMap) -> DepthMap:
    """The true depth, but 5 % farther in the left half."""
    wrong = depth.copy()
    wrong[:, : depth.shape[1] // 2] *= np.float32(1.05)
    return wrong


def compared_workspace(
    path: Path,
    *,
    filtered: Change | None = with_hole,
    unfiltered: Change | None = too_far,
    refined: Change | None = exact,
    truth: float | None = 1.0,
    num_points: int = 200,
) -> Path:
    """Write a workspace with these maps.

    Args:
        path: Its folder.
        filtered: Makes the geometric maps of the true depth; None = there are none.
        unfiltered: Makes the photometric maps.
        refined: Makes the refined maps.
        truth: What the true depth is multiplied by, its unit; None = none is written.
        num_points: Sparse points.
    """
    plane = write_plane_workspace(path, kinds=(), num_points=num_points)
    for kind, change in (("geometric", filtered), ("photometric", unfiltered)):
        for view in plane if change else ():
            name = f"{view.view.name}.{kind}.bin"
            write_depth_map(path / "stereo/depth_maps" / name, _of(view, change))
            write_normal_map(path / "stereo/normal_maps" / name, view.normals)
    for view in plane if truth else ():
        depth = view.depth * np.float32(truth or 1)
        write_depth_map(path / "ground_truth" / f"{view.view.name}.bin", depth)
    if refined:
        output = OutputWorkspace(source=open_workspace(path))
        output.prepare([view.view.name for view in plane])
        for view in plane:
            output.write_maps(view.view.name, _of(view, refined), view.normals)
    return path


def _of(view: PlaneView, change: Change | None) -> DepthMap:
    return view.depth if change is None else change(view.depth)
