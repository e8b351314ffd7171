"""The maps of each method, fused by open3d and by COLMAP with the same thresholds."""

import dataclasses
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from resdepth_colmap.config import FuseConfig, Fuser
from resdepth_colmap.errors import FusionError
from resdepth_colmap.evaluation.compare.method_maps import confident_depth
from resdepth_colmap.evaluation.compare.methods import Method
from resdepth_colmap.geometry.normals import normals_from_depth
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.io.colmap.depth_map import write_depth_map
from resdepth_colmap.io.colmap.normal_map import write_normal_map
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.io.files import link_or_copy
from resdepth_colmap.io.point_cloud import PointCloud
from resdepth_colmap.pipeline.fuse.colmap import fuse_with_colmap
from resdepth_colmap.pipeline.fuse.geometric_consistency import FuseStatistics
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
        statistics = self.statistics
        return {
            "num_points": None if self.cloud is None else len(self.cloud),
            "seconds": round(self.seconds, 2),
            "note": self.note,
            "statistics": None
            if statistics is None
            else dataclasses.asdict(statistics),
        }


def fuse_methods(
    workspace: Workspace,
    scene: Scene,
    methods: Sequence[Method],
    config: FuseConfig,
    progress: Progress,
) -> dict[str, dict[str, MethodCloud]]:
    """Fuse the maps of every method twice; the workspace stays as it is.

    Each method gets a temporary workspace of links. Normals of views without a normal
    map are computed from the depth, as in `refine`.

    Args:
        workspace: Has images and model.
        scene: Its views.
        methods: What to fuse.
        config: Thresholds of both.
        progress: Reports the progress.

    Returns:
        The clouds by fuser, then by method.

    Raises:
        WorkspaceError: If a map cannot be read, or a temporary file cannot be written.
    """
    clouds: dict[str, dict[str, MethodCloud]] = {str(fuser): {} for fuser in Fuser}
    for method in methods:
        with tempfile.TemporaryDirectory(prefix="resdepth-compare-") as folder:
            copy = _linked(workspace, method, config.min_confidence, Path(folder))
            files = [_file_in(copy, file) for file in method.files]
            for fuser in Fuser:
                clouds[str(fuser)][method.name] = _fused(
                    copy,
                    scene,
                    files,
                    dataclasses.replace(config, fuser=fuser),
                    progress,
                )
    return clouds


def fusion_settings(config: FuseConfig, num_views: int) -> Mapping[str, dict[str, Any]]:
    """The options of each fuser, under its own names; the same for all methods."""
    needed = min(config.min_num_views, num_views)
    shared = {
        "max_depth_error": config.max_depth_error,
        "max_reproj_error": config.max_reproj_error,
    }
    angle, confidence = config.max_normal_error_deg, config.min_confidence
    return {
        str(Fuser.OPEN3D): {
            "min_num_views": needed,
            **shared,
            "max_normal_error_deg": angle,
            "min_confidence": confidence,
        },
        str(Fuser.COLMAP): {
            "min_num_pixels": needed,
            **shared,
            "max_normal_error": angle,
            "min_confidence": confidence,
        },
    }


def _fused(
    copy: OutputWorkspace,
    scene: Scene,
    files: Sequence[MapFiles],
    config: FuseConfig,
    progress: Progress,
) -> MethodCloud:
    start = time.perf_counter()
    if config.fuser is Fuser.OPEN3D:
        found = fuse_maps(files, scene, config, progress)
    elif scene.num_shared_points is None:
        return MethodCloud(cloud=None, note=NO_TRACKS)
    else:
        try:
            found = fuse_with_colmap(copy.workspace, scene, files, config)
        except FusionError as error:
            return MethodCloud(cloud=None, note=" ".join(str(error).split()))
    return MethodCloud(
        cloud=found.cloud,
        statistics=found.statistics,
        seconds=time.perf_counter() - start,
        note="" if len(found.cloud) else NO_POINTS,
    )


def _linked(
    workspace: Workspace, method: Method, min_confidence: float, folder: Path
) -> OutputWorkspace:
    """A workspace with the maps of a method, under the names that COLMAP fuses."""
    copy = OutputWorkspace(source=dataclasses.replace(workspace, path=folder))
    names = [file.view.name for file in method.files]
    copy.prepare(names)
    copy.write_cfgs(names)
    for file in method.files:
        _link_maps(copy, file, min_confidence)
    return copy


def _link_maps(copy: OutputWorkspace, file: MapFiles, min_confidence: float) -> None:
    name = file.view.name
    depth_path, normal_path = copy.depth_map_path(name), copy.normal_map_path(name)
    has_normals = file.normal_path is not None and file.normal_path.is_file()
    if min_confidence > 0 or not has_normals:
        depth = confident_depth(file, min_confidence)
    if min_confidence > 0:
        write_depth_map(depth_path, depth)
    else:
        link_or_copy(file.depth_path, depth_path)
    if has_normals and file.normal_path is not None:
        link_or_copy(file.normal_path, normal_path)
    else:
        height_px, width_px = depth.shape
        K = index_K(file.view.camera.resized(width_px, height_px))
        write_normal_map(normal_path, np.asarray(normals_from_depth(depth, K)))


def _file_in(copy: OutputWorkspace, file: MapFiles) -> MapFiles:
    name = file.view.name
    return MapFiles(
        view=file.view,
        image_path=file.image_path,
        depth_path=copy.depth_map_path(name),
        normal_path=copy.normal_map_path(name),
    )
