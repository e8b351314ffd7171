"""COLMAP's own PatchMatch, where pycolmap was built with CUDA."""

import dataclasses
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.cfg import (
    SourceKind,
    SourceSpec,
    write_patch_match_cfg,
)
from resdepth_colmap.io.colmap.maps import (
    read_depth_map,
    read_map_size,
    read_normal_map,
    write_depth_map,
    write_normal_map,
)
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.pipeline.masks import wanted_pixels
from resdepth_colmap.pipeline.stereo.passes import GEOMETRIC, PHOTOMETRIC
from resdepth_colmap.pipeline.stereo.plan import plan_stereo
from resdepth_colmap.scene import Scene


def run_colmap(workspace: Workspace, scene: Scene, config: StereoConfig) -> None:
    """Run pycolmap's PatchMatch on a workspace, then lay the masks over its maps.

    Options that differ from our defaults are passed on, where COLMAP has them; for all
    others COLMAP's own defaults hold, which suit a GPU.

    Raises:
        WorkspaceError: If a mask or map cannot be read or written, or no view overlaps
            with another one.
    """
    import pycolmap

    options = pycolmap.PatchMatchOptions()
    for name, value in said_options(config).items():
        if hasattr(options, name):
            setattr(options, name, value)
    if scene.num_shared_points is None:
        _run_without_points(workspace, scene, config, options)
    else:
        pycolmap.patch_match_stereo(str(workspace.path), options=options)
    for view in scene.views:
        for kind in (PHOTOMETRIC, GEOMETRIC):
            _lay_mask(workspace, view.name, kind)


def _run_without_points(
    workspace: Workspace, scene: Scene, config: StereoConfig, options: Any
) -> None:
    """Without sparse points COLMAP needs to be told sources and depth range: ours."""
    import pycolmap

    plans, _ = plan_stereo(workspace, scene, config)
    if not plans:
        raise WorkspaceError(f"{workspace.path}: no view overlaps with another one.")
    options.depth_min = min(plan.depth_range[0] for plan in plans)
    options.depth_max = max(plan.depth_range[1] for plan in plans)
    sources = {
        scene.views[plan.index].name: SourceSpec(
            kind=SourceKind.EXPLICIT,
            names=tuple(scene.views[index].name for index in plan.sources),
        )
        for plan in plans
    }
    with tempfile.TemporaryDirectory() as folder:
        cfg_path = Path(folder) / "patch-match.cfg"
        write_patch_match_cfg(cfg_path, sources)
        pycolmap.patch_match_stereo(
            str(workspace.path), options=options, config_path=str(cfg_path)
        )


def said_options(config: StereoConfig) -> dict[str, Any]:
    """The options that differ from their defaults."""
    default = StereoConfig()
    return {
        field.name: getattr(config, field.name)
        for field in dataclasses.fields(config)
        if getattr(config, field.name) != getattr(default, field.name)
    }


def _lay_mask(workspace: Workspace, name: str, kind: str) -> None:
    depth_path = workspace.depth_map_path(name, kind)
    if not depth_path.is_file():
        return
    wanted = wanted_pixels(workspace.masks, name, read_map_size(depth_path))
    if wanted is None:
        return
    depth = read_depth_map(depth_path)
    write_depth_map(depth_path, np.where(wanted, depth, np.float32(0)))
    normal_path = workspace.normal_map_path(name, kind)
    if normal_path.is_file():
        normals = read_normal_map(normal_path)
        blank = np.float32(0)
        write_normal_map(normal_path, np.where(wanted[..., None], normals, blank))
