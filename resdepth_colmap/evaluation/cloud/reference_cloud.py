"""The reference cloud of ground-truth depth maps, and the scores of clouds against it.

Accuracy and completeness by the distances of nearest points, as in K. Knapitsch et al.,
Tanks and Temples, SIGGRAPH 2017: there is no scanner, so ETH3D's rules for what a laser
beam has observed (see `cloud_scores`) do not apply.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.evaluation.cloud.point_shares import (
    VoxelGrids,
    completeness_levels,
)
from resdepth_colmap.evaluation.cloud.scores import CloudScores
from resdepth_colmap.evaluation.datasets.workspaces import TRUTH_FOLDER
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.geometry.projection import back_project, look_up, transform
from resdepth_colmap.io.colmap.maps import read_depth_map
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.pipeline.initial_map import check_map_size
from resdepth_colmap.progress import Progress
from resdepth_colmap.scene import DepthMap, Matrix, Scene, View

Points = npt.NDArray[np.float32]

RELATIVE_TOLERANCES = (0.01, 0.02)
"""Default tolerances, relative to the mean true depth."""

VOXEL_SHARE = 0.5
"""Side of a voxel relative to the least tolerance. Its diagonal is shorter than that
tolerance, so thinning removes no point that would have been near enough."""


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class TruthMap:
    """The ground-truth depth of a view.

    Attributes:
        view: The view.
        K: K for index coordinates at the size of the map, shape (3, 3).
        depth: Shape (H, W), in units; 0 = unknown.
    """

    view: View
    K: Matrix
    depth: DepthMap


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class ReferenceCloud:
    """The ground truth of a scene as a cloud.

    Attributes:
        maps: Of the views with ground truth.
        points: Their points in the world, one per voxel, shape (N, 3), in units.
        mean_depth: Mean of all known depths, in units.
        tolerances: Largest distances of a correct point, in units, increasing.
    """

    maps: tuple[TruthMap, ...]
    points: Points
    mean_depth: float
    tolerances: tuple[float, ...]

    @property
    def voxel_size(self) -> float:
        """Side of the voxels of thinning and of averaging, in units."""
        return VOXEL_SHARE * self.tolerances[0]

    def to_mapping(self) -> dict[str, Any]:
        """Kind and size of the ground truth, ready for JSON."""
        return {
            "kind": "depth maps",
            "num_maps": len(self.maps),
            "num_points": len(self.points),
            "mean_depth": round(self.mean_depth, 6),
            "voxel_size": round(self.voxel_size, 6),
        }

    def score(self, points: Points, progress: Progress) -> CloudScores:
        """Score the points of a cloud, in the world, shape (M, 3).

        A point counts for the accuracy if it projects to a pixel of known true depth in
        some view. The shares of right points are averaged over voxels, so that dense
        and sparse regions weigh alike. Points that are not finite are left out; the
        scores of a cloud without points are 0.
        """
        points = points[np.isfinite(points).all(axis=1)]
        observed = points[self._is_observed(points)]
        total = len(observed) + len(self.points)
        with progress.stage("Scoring", total) as advance:
            reached = completeness_levels(self.points, points, self.tolerances, advance)
            right = completeness_levels(observed, self.points, self.tolerances, advance)
        levels = range(len(self.tolerances))
        grids, counted = VoxelGrids(observed, self.voxel_size), right >= 0
        return CloudScores(
            tolerances=self.tolerances,
            accuracy=tuple(grids.mean_share(right <= it, counted) for it in levels),
            completeness=tuple(float((reached <= it).mean()) for it in levels),
            num_points=len(observed),
            num_scan_points=len(self.points),
        )

    def _is_observed(self, points: Points) -> npt.NDArray[np.bool_]:
        found = np.zeros(len(points), np.bool_)
        for truth_map in self.maps:
            rest = np.flatnonzero(~found)
            world = points[rest].astype(np.float64)
            xyz = transform(truth_map.view.cam_from_world, world)
            seen, pixels = look_up(xyz, truth_map.K, truth_map.depth.shape)
            found[rest[seen]] = truth_map.depth.ravel()[pixels] > 0
        return found


def read_reference_cloud(
    workspace: Workspace, scene: Scene, tolerances: Sequence[float]
) -> ReferenceCloud | None:
    """Read `ground_truth/<image>.bin` of some or all views; None if there is none.

    Args:
        workspace: Has the maps, in COLMAP's format.
        scene: Its views.
        tolerances: In units; () = 1 % and 2 % of the mean true depth.

    Raises:
        WorkspaceError: If a map is broken or of another image, or no map has a depth.
    """
    maps = [
        _truth_map(workspace, view)
        for view in scene.views
        if workspace.truth_path(view.name).is_file()
    ]
    if not maps:
        return None
    known = sum(int(np.count_nonzero(it.depth)) for it in maps)
    if not known:
        raise WorkspaceError(
            f"{workspace.path / TRUTH_FOLDER}: no pixel of any map has a depth, so "
            "there is nothing to compare with; copy the truth again."
        )
    mean_depth = sum(float(it.depth.sum(dtype=np.float64)) for it in maps) / known
    tolerances = tuple(tolerances) or tuple(
        share * mean_depth for share in RELATIVE_TOLERANCES
    )
    parts = [_thinned(_points(it), VOXEL_SHARE * tolerances[0]) for it in maps]
    return ReferenceCloud(
        maps=tuple(maps),
        points=_thinned(np.concatenate(parts), VOXEL_SHARE * tolerances[0]),
        mean_depth=mean_depth,
        tolerances=tolerances,
    )


def _truth_map(workspace: Workspace, view: View) -> TruthMap:
    path = workspace.truth_path(view.name)
    check_map_size(path, view.camera)
    depth = read_depth_map(path)
    height_px, width_px = depth.shape
    camera = view.camera.resized(width_px, height_px)
    return TruthMap(view=view, K=index_K(camera), depth=depth)


def _points(truth_map: TruthMap) -> Points:
    """The points of a ground-truth map in the world."""
    xyz = back_project(truth_map.depth, truth_map.K)[truth_map.depth > 0]
    pose = truth_map.view.cam_from_world
    return ((xyz - pose[:, 3]) @ pose[:, :3]).astype(np.float32)


def _thinned(points: Points, voxel_size: float) -> Points:
    """The first point of each voxel; a mean would lie off edges and corners."""
    cells = np.floor(points.astype(np.float64) / voxel_size).astype(np.int64)
    cells -= cells.min(axis=0)
    sizes = cells.max(axis=0) + 1
    fits = np.log2(sizes.astype(np.float64)).sum() < 62
    keys = np.ravel_multi_index(tuple(cells.T), tuple(sizes)) if fits else cells
    _, first = np.unique(keys, axis=0, return_index=True)
    return points[np.sort(first)]
