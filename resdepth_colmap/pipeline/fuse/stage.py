"""The maps of a workspace, fused into one cloud.

Ours compares the maps (see `consistency`) and leaves the thinning and cleaning of the
cloud to open3d; COLMAP's own fusion can be asked for instead.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from resdepth_colmap.config import FuseConfig, Fuser
from resdepth_colmap.errors import ConfigError, FusionError
from resdepth_colmap.geometry.view_selection import choose_sources
from resdepth_colmap.io.colmap.maps import read_map_size
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.io.open3d_library import load_open3d
from resdepth_colmap.io.point_cloud import PointCloud
from resdepth_colmap.pipeline.fuse.colmap import fuse_with_colmap
from resdepth_colmap.pipeline.fuse.geometric_consistency import (
    Consistent,
    FuseStatistics,
    fuse_views,
)
from resdepth_colmap.pipeline.fuse.views import LazyViews, MapFiles
from resdepth_colmap.pipeline.initial_map import map_path
from resdepth_colmap.progress import Progress, SilentProgress
from resdepth_colmap.scene import Scene

MOST_NEIGHBOURS = 12
LEAST_NEIGHBOURS = 4
MAX_NUM_BYTES = 2 << 30
"""Memory for maps; where a view and its neighbours need more, it gets fewer."""

_BYTES_PER_PIXEL = 23  # depth 4, normal 12, confidence 4, colour 3
_OUTLIER_NEIGHBOURS = 20
_OUTLIER_DEVIATIONS = 2.0


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Fused:
    """A cloud and how it came about.

    Attributes:
        cloud: The points, at least one.
        statistics: What became of the pixels; of COLMAP's fusion, which keeps no such
            account, only the numbers of views, pixels and points.
        num_thinned: Points that the voxels have merged away.
        num_outliers: Points removed as outliers.
    """

    cloud: PointCloud
    statistics: FuseStatistics
    num_thinned: int = 0
    num_outliers: int = 0


def fuse_workspace(
    output: OutputWorkspace,
    scene: Scene,
    config: FuseConfig,
    progress: Progress | None = None,
) -> Fused:
    """Fuse the refined maps of a workspace, without what its masks leave out.

    Args:
        output: Where the refined maps are.
        scene: The views of the workspace; those without a refined map are left out.
        config: Which fuser, its thresholds, and how to clean the cloud.
        progress: Who listens.

    Raises:
        FusionError: If no point is left, or COLMAP's fusion lacks what it needs.
        WorkspaceError: If a map cannot be read.
        ConfigError: If the voxels are too small for the extent of the cloud.
    """
    files = refined_files(output, scene)
    if not files:
        raise FusionError(
            f"{output.workspace.stereo_path}: no refined map to fuse; run "
            f"`resdepth-colmap refine {output.source.path}` first."
        )
    if config.fuser is Fuser.COLMAP:
        cloud, statistics = fuse_with_colmap(output.workspace, scene, files, config)
    else:
        cloud, statistics = fuse_maps(files, scene, config, progress)
    if len(cloud) == 0:
        raise FusionError(_why_nothing(output.workspace, statistics))
    fused = _cleaned(cloud, statistics, config)
    return dataclasses.replace(fused, cloud=fused.cloud.moved(scene.origin_in_world))


def fuse_initial(
    workspace: Workspace,
    scene: Scene,
    images: Mapping[str, Mapping[str, Any]],
    config: FuseConfig,
    progress: Progress | None = None,
) -> Consistent:
    """The cloud that the maps before the refinement would have given.

    The same function as for refined maps, so that both clouds can be compared; the
    normals are computed from the depth, as those of refined maps are.

    Args:
        workspace: The user's workspace.
        scene: Its views.
        images: What is known of each refined image, by name: "input", the kind of map
            that it started from, and "scale", what that was multiplied with.
        config: Thresholds; the confidence is not used.
        progress: Who listens.

    Raises:
        WorkspaceError: If a map cannot be read.
    """
    files = initial_files(workspace, scene, images)
    before = fuse_maps(files, scene, config, progress, "Fusing as it was")
    return before._replace(cloud=before.cloud.moved(scene.origin_in_world))


def initial_files(
    workspace: Workspace, scene: Scene, images: Mapping[str, Mapping[str, Any]]
) -> list[MapFiles]:
    """The maps before the refinement, of the kind that was refined of each image."""
    return [
        MapFiles(
            view=view,
            image_path=workspace.image_path(view.name),
            depth_path=map_path(workspace, view.name, images[view.name]["input"]),
            depth_scale=float(images[view.name].get("scale", 1.0)),
            masks=workspace.masks,
        )
        for view in scene.views
        if view.name in images
    ]


def fuse_maps(
    files: Sequence[MapFiles],
    scene: Scene,
    config: FuseConfig,
    progress: Progress | None = None,
    title: str = "Fusing",
) -> Consistent:
    """Fuse any maps of a scene; see `consistency.fuse_views`.

    Args:
        files: The maps, each of another view of the scene.
        scene: Tells which views are neighbours.
        config: Thresholds.
        progress: Who listens.
        title: What to call the stage.

    Raises:
        WorkspaceError: If a map cannot be read.
    """
    neighbours = neighbours_of(files, scene)
    views = LazyViews(files, MAX_NUM_BYTES)
    with (progress or SilentProgress()).stage(title, len(files)) as advance:
        return fuse_views(views, neighbours, config, advance)


def refined_files(output: OutputWorkspace, scene: Scene) -> list[MapFiles]:
    """The refined maps of a workspace, in the order of its views."""
    return [
        MapFiles(
            view=view,
            image_path=output.workspace.image_path(view.name),
            depth_path=output.depth_map_path(view.name),
            normal_path=output.normal_map_path(view.name),
            confidence_path=output.confidence_map_path(view.name),
            masks=output.source.masks,
        )
        for view in scene.views
        if output.is_written(view.name)
    ]


def neighbours_of(files: Sequence[MapFiles], scene: Scene) -> list[list[int]]:
    """Of each map the indices in `files` of those to compare it with, best first."""
    if not files:
        return []
    sizes = [read_map_size(file.depth_path) for file in files]
    largest = _BYTES_PER_PIXEL * max(width * height for width, height in sizes)
    num_fitting = MAX_NUM_BYTES // largest - 1
    num_neighbours = min(max(num_fitting, LEAST_NEIGHBOURS), MOST_NEIGHBOURS)
    candidates = [scene.index(file.view.name) for file in files]
    place = {index: number for number, index in enumerate(candidates)}
    return [
        [
            place[choice.index]
            for choice in choose_sources(scene, index, num_neighbours, candidates)
        ]
        for index in candidates
    ]


def _cleaned(
    cloud: PointCloud, statistics: FuseStatistics, config: FuseConfig
) -> Fused:
    """Thin the cloud and remove its outliers, where that is asked for."""
    num_points = len(cloud)
    if config.voxel_size > 0:
        cloud = _thinned(cloud, config.voxel_size)
    num_thinned = num_points - len(cloud)
    num_before = len(cloud)
    if config.remove_outliers and num_before > _OUTLIER_NEIGHBOURS:
        _, kept = _to_open3d(cloud).remove_statistical_outlier(
            _OUTLIER_NEIGHBOURS, _OUTLIER_DEVIATIONS
        )
        index = np.asarray(kept, dtype=np.int64)
        cloud = PointCloud(
            points=cloud.points[index],
            colors=cloud.colors[index],
            normals=cloud.normals[index],
        )
    return Fused(
        cloud=cloud,
        statistics=statistics,
        num_thinned=num_thinned,
        num_outliers=num_before - len(cloud),
    )


def _thinned(cloud: PointCloud, voxel_size: float) -> PointCloud:
    try:
        thin = _to_open3d(cloud).voxel_down_sample(voxel_size)
    except RuntimeError as error:  # open3d counts voxels in 32 bits
        extent = float(np.ptp(cloud.points, axis=0).max())
        raise ConfigError(
            f"{voxel_size=} is too small for a cloud that is {extent:g} units long; "
            "choose larger voxels, or 0 for none."
        ) from error
    normals = np.asarray(thin.normals)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return PointCloud(
        points=np.asarray(thin.points).astype(np.float32),
        colors=np.rint(np.asarray(thin.colors) * 255).astype(np.uint8),
        normals=(normals / np.where(length > 0, length, 1)).astype(np.float32),
    )


def _to_open3d(cloud: PointCloud) -> Any:
    open3d = load_open3d()

    vectors = open3d.utility.Vector3dVector
    converted = open3d.geometry.PointCloud(vectors(cloud.points.astype(np.float64)))
    converted.colors = vectors(cloud.colors.astype(np.float64) / 255)
    converted.normals = vectors(cloud.normals.astype(np.float64))
    return converted


def _why_nothing(workspace: Workspace, statistics: FuseStatistics) -> str:
    return (
        f"{workspace.stereo_path}: no point survived the fusion of "
        f"{statistics.num_views} views: of {statistics.num_pixels} pixels, "
        f"{statistics.num_unseen} are seen by fewer than "
        f"{statistics.num_views_needed} views, the depths of "
        f"{statistics.num_depth_disagrees} disagree and the normals of "
        f"{statistics.num_normal_disagrees}; lower --min-num-views or "
        "--min-confidence, or raise --max-depth-error, --max-reproj-error or "
        "--max-normal-error-deg."
    )
