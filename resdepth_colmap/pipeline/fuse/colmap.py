"""COLMAP's own fusion of a workspace."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from resdepth_colmap.config import FuseConfig
from resdepth_colmap.errors import FusionError
from resdepth_colmap.io.colmap.maps import read_map_size
from resdepth_colmap.io.colmap.output import KIND
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.io.files import safe_name
from resdepth_colmap.io.images import write_png
from resdepth_colmap.io.point_cloud import PointCloud, read_cloud
from resdepth_colmap.pipeline.fuse.geometric_consistency import (
    Consistent,
    FuseStatistics,
)
from resdepth_colmap.pipeline.fuse.views import MapFiles
from resdepth_colmap.pipeline.masks import wanted_pixels
from resdepth_colmap.scene import Scene


def fuse_with_colmap(
    workspace: Workspace,
    scene: Scene,
    files: Sequence[MapFiles],
    config: FuseConfig,
) -> Consistent:
    """Run `stereo_fusion` on the geometric maps of a workspace.

    `min_num_views` becomes COLMAP's `min_num_pixels`, which counts pixels, not views.
    The confidence is not looked at.

    Args:
        workspace: With maps of that kind, normal maps and cfg files.
        scene: Its views.
        files: The maps that are there.
        config: Thresholds.

    Returns:
        The cloud, which may be empty, and only the totals of the statistics.

    Raises:
        FusionError: If the sparse model has no points, or COLMAP fails.
    """
    if scene.num_shared_points is None:
        raise FusionError(
            f"{workspace.sparse_path}: no sparse points with tracks, but COLMAP's "
            "fusion finds neighbouring images by the points they share, and would give "
            "no point; use --fuser open3d, which needs none."
        )
    if scene.origin_in_world.any():
        raise FusionError(
            f"{workspace.sparse_path}: the model lies around "
            f"{', '.join(f'{x:g}' for x in scene.origin_in_world)}, too far from its "
            "origin for COLMAP's fusion, which computes in single precision; use "
            "--fuser open3d."
        )
    needed = min(config.min_num_views, len(files))
    with tempfile.TemporaryDirectory() as folder:
        mask_folder = _write_masks(Path(folder), files)
        cloud = _run(workspace, config, needed, mask_folder)
    num_pixels = sum(int(np.count_nonzero(file.read_depth())) for file in files)
    return Consistent(
        cloud,
        FuseStatistics(
            num_views=len(files),
            num_views_needed=needed,
            num_pixels=num_pixels,
            num_points=len(cloud),
        ),
    )


def _write_masks(folder: Path, files: Sequence[MapFiles]) -> Path | None:
    """Write the masks as COLMAP does, at the size of the maps; None: there are none."""
    written = None
    for file in files:
        name = file.view.name
        wanted = wanted_pixels(file.masks, name, read_map_size(file.depth_path))
        if wanted is not None:
            gray = np.where(wanted, np.uint8(255), np.uint8(0))
            write_png(folder / f"{safe_name(name)}.png", np.dstack([gray] * 3))
            written = folder
    return written


def _run(
    workspace: Workspace,
    config: FuseConfig,
    min_num_pixels: int,
    mask_folder: Path | None,
) -> PointCloud:
    import pycolmap

    from resdepth_colmap.io.colmap.reconstruction import quiet_pycolmap

    with tempfile.TemporaryDirectory() as folder, quiet_pycolmap():
        path = Path(folder) / "fused.ply"
        try:
            model = pycolmap.stereo_fusion(
                output_path=path,
                workspace_path=workspace.path,
                input_type=KIND,
                options=_options(pycolmap, config, min_num_pixels, mask_folder),
                output_type="PLY",
            )
        except (ValueError, RuntimeError, IndexError, OSError) as error:
            reason = " ".join(str(error).split())[:200]
            raise FusionError(
                f"{workspace.path}: COLMAP's fusion failed ({reason}); "
                "use --fuser open3d."
            ) from error
        if model.num_points3D() == 0:
            return _nothing()
        return read_cloud(path)


def _options(
    pycolmap: Any, config: FuseConfig, min_num_pixels: int, mask_folder: Path | None
) -> Any:
    options = pycolmap.StereoFusionOptions()
    options.min_num_pixels = min_num_pixels
    options.max_depth_error = config.max_depth_error
    options.max_reproj_error = config.max_reproj_error
    options.max_normal_error = config.max_normal_error_deg
    if mask_folder is not None:
        options.mask_path = str(mask_folder)
    return options


def _nothing() -> PointCloud:
    none = np.zeros((0, 3), np.float32)
    return PointCloud(points=none, colors=none.astype(np.uint8), normals=none)
