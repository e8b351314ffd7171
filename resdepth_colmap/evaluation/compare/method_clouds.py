"""The maps of each method, fused by open3d and by COLMAP with the same thresholds."""

import dataclasses
import functools
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from resdepth_colmap.config import FuseConfig, Fuser
from resdepth_colmap.errors import FusionError
from resdepth_colmap.evaluation.compare.methods import Method, confident_depth
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.io.files import link_or_copy
from resdepth_colmap.io.point_cloud import PointCloud
from resdepth_colmap.pipeline.fuse.colmap import fuse_with_colmap
from resdepth_colmap.pipeline.fuse.geometric_consistency import (
    Consistent,
    FuseStatistics,
)
from resdepth_colmap.pipeline.fuse.stage import fuse_maps
from resdepth_colmap.pipeline.fuse.views import MapFiles
from resdepth_colmap.progress import Progress
from resdepth_colmap.scene import Scene

NO_POINTS = "no point survived the fusion, so all scores are 0"
NO_TRACKS = (
    "COLMAP's fusion finds neighbouring images by shared sparse points, and the model "
    "has none: it would give no point, so it is left out"
)


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class MethodCloud:
    """The cloud of a method.

    Attributes:
        cloud: The points, maybe none; None if the fusion failed or was left out.
        statistics: Counts of fused and rejected pixels; None without a cloud.
        seconds: Wall time of the fusion.
        note: Why there is no point or no cloud; else "".
    """

    cloud: PointCloud | None
    statistics: FuseStatistics | None = None
    seconds: float = 0.0
    note: str = ""

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return {
            "num_points": None if self.cloud is None else len(self.cloud),
            "seconds": round(self.seconds, 2),
            "note": self.note,
            "statistics": self.statistics and dataclasses.asdict(self.statistics),
        }


def fuse_methods(
    workspace: Workspace,
    scene: Scene,
    methods: Sequence[Method],
    config: FuseConfig,
    progress: Progress,
) -> dict[str, dict[str, MethodCloud]]:
    """Fuse the maps of every method with the thresholds of both fusers.

    The workspace stays as it is. Normals of views without a normal map are computed
    from the depth.

    Returns:
        The clouds by fuser, then by method.

    Raises:
        WorkspaceError: If a map cannot be read, or a temporary file cannot be written.
    """
    clouds: dict[str, dict[str, MethodCloud]] = {str(fuser): {} for fuser in Fuser}
    for method in methods:
        fuse = functools.partial(fuse_maps, method.files, scene, config, progress)
        clouds[str(Fuser.OPEN3D)][method.name] = _timed(fuse)
        fuse = functools.partial(_fuse_by_colmap, workspace, scene, method, config)
        clouds[str(Fuser.COLMAP)][method.name] = (
            MethodCloud(cloud=None, note=NO_TRACKS)
            if scene.num_shared_points is None
            else _timed(fuse)
        )
    return clouds


def fusion_settings(config: FuseConfig, num_views: int) -> dict[str, dict[str, Any]]:
    """The options of each fuser, under its own names; the same for all methods."""
    needed = min(config.min_num_views, num_views)

    def settings(num_name: str, angle_name: str) -> dict[str, Any]:
        return {
            num_name: needed,
            "max_depth_error": config.max_depth_error,
            "max_reproj_error": config.max_reproj_error,
            angle_name: config.max_normal_error_deg,
            "min_confidence": config.min_confidence,
        }

    return {
        str(Fuser.OPEN3D): settings("min_num_views", "max_normal_error_deg"),
        str(Fuser.COLMAP): settings("min_num_pixels", "max_normal_error"),
    }


def _timed(fuse: Callable[[], Consistent]) -> MethodCloud:
    start = time.perf_counter()
    try:
        found = fuse()
    except FusionError as error:
        return MethodCloud(cloud=None, note=" ".join(str(error).split()))
    return MethodCloud(
        cloud=found.cloud,
        statistics=found.statistics,
        seconds=time.perf_counter() - start,
        note="" if len(found.cloud) else NO_POINTS,
    )


def _fuse_by_colmap(
    workspace: Workspace, scene: Scene, method: Method, config: FuseConfig
) -> Consistent:
    """Fuse in a temporary workspace of links, under the names that COLMAP fuses."""
    names = [file.view.name for file in method.files]
    with tempfile.TemporaryDirectory(prefix="resdepth-compare-") as folder:
        copy = OutputWorkspace(source=dataclasses.replace(workspace, path=Path(folder)))
        copy.prepare(names)
        copy.write_cfgs(names)
        files = [_linked(file, copy, config.min_confidence) for file in method.files]
        return fuse_with_colmap(copy.workspace, scene, files, config)


def _linked(file: MapFiles, copy: OutputWorkspace, min_confidence: float) -> MapFiles:
    name = file.view.name
    depth_path, normal_path = copy.depth_map_path(name), copy.normal_map_path(name)
    normals = file.normal_path
    if min_confidence == 0 and normals is not None and normals.is_file():
        link_or_copy(file.depth_path, depth_path)
        link_or_copy(normals, normal_path)
    else:
        depth = confident_depth(file, min_confidence)
        copy.write_maps(name, depth, file.read().normals)
    return dataclasses.replace(file, depth_path=depth_path, normal_path=normal_path)
