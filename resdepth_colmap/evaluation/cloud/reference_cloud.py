"""The cloud of true depth maps, and how near another cloud is to it.

Accuracy and completeness by the distance of nearest points, as in K. Knapitsch et al.,
Tanks and Temples, SIGGRAPH 2017: no scanner stood anywhere, so ETH3D's rules for what a
laser beam has seen (see `cloud_scores`) do not apply.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.evaluation.cloud.completeness import completeness_levels
from resdepth_colmap.evaluation.cloud.scores import CloudScores, f1_score
from resdepth_colmap.evaluation.cloud.voxel_mean import VoxelGrids
from resdepth_colmap.evaluation.compare.config import RELATIVE_TOLERANCES
from resdepth_colmap.evaluation.datasets.workspaces import TRUTH_FOLDER
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.geometry.projection import back_project, project, transform
from resdepth_colmap.io.colmap.depth_map import read_depth_map
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.pipeline.initial_map import check_map_size
from resdepth_colmap.progress import Progress
from resdepth_colmap.scene import DepthMap, Matrix, Scene, View

Points = npt.NDArray[np.float32]

VOXEL_SHARE = 0.5
"""Side of a voxel over the least tolerance. Its diagonal stays below that tolerance, so
that thinning the truth takes away no point that would have been near enough."""


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class TrueMap:
    """The true depth of a view.

    Attributes:
        view: The view.
        K: K for index coordinates at the size of the map, shape (3, 3).
        depth: Shape (H, W), in units; 0 = not known.
    """

    view: View
    K: Matrix
    depth: DepthMap


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class DepthTruth:
    """What true depth maps say of a scene.

    Attributes:
        maps: Of the views whose true depth is known.
        points: Their points in the world, one a voxel, shape (N, 3), in units.
        mean_depth: Mean of all known depths, in units.
        tolerances: Distances up to which a point is right, in units, increasing.
    """

    maps: tuple[TrueMap, ...]
    points: Points
    mean_depth: float
    tolerances: tuple[float, ...]

    @property
    def voxel_size(self) -> float:
        """Side of the voxels that the truth is thinned and scores averaged over."""
        return VOXEL_SHARE * self.tolerances[0]

    def to_mapping(self) -> dict[str, Any]:
        """What is true, as plain values, ready for JSON."""
        return {
            "kind": "depth maps",
            "num_maps": len(self.maps),
            "num_points": len(self.points),
            "mean_depth": round(self.mean_depth, 6),
            "voxel_size": round(self.voxel_size, 6),
        }

    def score(self, points: Points, progress: Progress) -> CloudScores:
        """Score a cloud.

        A point counts for the accuracy if the true depth of some pixel that it projects
        to is known; the shares of right points are averaged over voxels, so that dense
        and sparse places count alike.

        Args:
            points: In the world, shape (M, 3); those that are not finite are left out.
                Without any, all scores are 0.
            progress: Is told how far it is.
        """
        whole = points[np.isfinite(points).all(axis=1)]
        points = whole[self._is_looked_at(whole)]
        total = len(points) + len(self.points)
        with progress.stage("Scoring", total) as advance:
            reached = completeness_levels(self.points, whole, self.tolerances, advance)
            right = completeness_levels(points, self.points, self.tolerances, advance)
        places = range(len(self.tolerances))
        accuracy = tuple(0.0 for _ in places)
        if len(points):
            grids, counted = VoxelGrids(points, self.voxel_size), right >= 0
            accuracy = tuple(grids.mean_share(right <= it, counted) for it in places)
        completeness = tuple(float((reached <= it).mean()) for it in places)
        return CloudScores(
            tolerances=self.tolerances,
            accuracy=accuracy,
            completeness=completeness,
            f1=tuple(map(f1_score, accuracy, completeness)),
            num_points=len(points),
            num_scan_points=len(self.points),
        )

    def _is_looked_at(self, points: Points) -> npt.NDArray[np.bool_]:
        found = np.zeros(len(points), np.bool_)
        for true_map in self.maps:
            rest = np.flatnonzero(~found)
            world = points[rest].astype(np.float64)
            xyz = transform(true_map.view.cam_from_world, world)
            xy, z = project(xyz, true_map.K)
            height_px, width_px = true_map.depth.shape
            column, row = np.rint(xy.clip(-1e6, 1e6)).astype(np.int64).T
            inside = (z > 0) & (column >= 0) & (row >= 0)
            inside &= (column < width_px) & (row < height_px)
            pixels = row[inside], column[inside]
            found[rest[inside]] = true_map.depth[pixels] > 0
        return found


def read_depth_truth(
    workspace: Workspace, scene: Scene, tolerances: Sequence[float]
) -> DepthTruth | None:
    """Read `ground_truth/` of a workspace.

    Args:
        workspace: With `ground_truth/<image>.bin`, COLMAP's map format, for all views
            or some.
        scene: Its views.
        tolerances: In units; none = 1 % and 2 % of the mean true depth.

    Returns:
        The truth; None if there is none of any view.

    Raises:
        WorkspaceError: If a true map is broken, knows no pixel, or belongs to another
            image.
    """
    maps = [
        _true_map(workspace, view)
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
    return DepthTruth(
        maps=tuple(maps),
        points=_thinned(np.concatenate(parts), VOXEL_SHARE * tolerances[0]),
        mean_depth=mean_depth,
        tolerances=tolerances,
    )


def _true_map(workspace: Workspace, view: View) -> TrueMap:
    path = workspace.truth_path(view.name)
    check_map_size(path, view.camera)
    depth = read_depth_map(path)
    height_px, width_px = depth.shape
    camera = view.camera.resized(width_px, height_px)
    return TrueMap(view=view, K=index_K(camera), depth=depth)


def _points(true_map: TrueMap) -> Points:
    """The points of a true map in the world."""
    xyz = back_project(true_map.depth, true_map.K)[true_map.depth > 0]
    pose = true_map.view.cam_from_world
    return ((xyz - pose[:, 3]) @ pose[:, :3]).astype(np.float32)


def _thinned(points: Points, voxel_size: float) -> Points:
    """The first point of each voxel: a mean would lie off the edges of surfaces."""
    cells = np.floor(points.astype(np.float64) / voxel_size).astype(np.int64)
    cells -= cells.min(axis=0)
    sizes = cells.max(axis=0) + 1
    if np.log2(sizes.astype(np.float64)).sum() < 62:
        keys = (cells[:, 0] * sizes[1] + cells[:, 1]) * sizes[2] + cells[:, 2]
        _, first = np.unique(keys, return_index=True)
    else:
        _, first = np.unique(cells, axis=0, return_index=True)
    return points[np.sort(first)]
