"""Stage "export": depth maps for programs that do not know COLMAP's format."""

import logging
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.maps import read_depth_map
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.output import OutputWorkspace, write_record
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.io.exported_map import (
    MAX_PNG_VALUE,
    write_npy,
    write_pfm,
    write_png16,
)
from resdepth_colmap.pipeline.export_config import REFINED, MapFormat
from resdepth_colmap.pipeline.initial_map import map_path
from resdepth_colmap.pipeline.masks import masked_depth
from resdepth_colmap.progress import Progress, SilentProgress
from resdepth_colmap.scene import DepthMap

logger = logging.getLogger(__name__)

SCALE_NAME = "depth_scale.json"
FAR_PERCENTILE = 99.0
OUTLIER_RATIO = 2.0
"""A depth of so many times what 99 % of a map's depths are within is an outlier."""

_EDGES = np.geomspace(1e-6, 1e9, 3001)  # bins of depth, to count without a second look
_SUFFIXES = {MapFormat.NPY: ".npy", MapFormat.PFM: ".pfm", MapFormat.PNG16: ".png"}


def export_maps(
    workspace: Workspace,
    output: Path,
    kind: MapFormat,
    maps: str = REFINED,
    progress: Progress | None = None,
) -> tuple[Path, ...]:
    """Write the depth maps of a workspace in another format.

    Args:
        workspace: Whose maps; where its masks are 0, there is no depth in the files.
        output: Folder for `<image name><.npy, .pfm or .png>`; for 16-bit PNG also
            `depth_scale.json`, whose "unit" is the depth of one step of the value, the
            same for all maps; outliers beyond "farthest" become that.
        kind: The format.
        maps: "refined", or a kind of map in the workspace's `stereo/`.
        progress: Is told of each map.

    Returns:
        The files written, in the order of the model.

    Raises:
        WorkspaceError: If there is no such map, or a file cannot be read or written.
    """
    progress = progress or SilentProgress()
    paths = _map_paths(workspace, maps)
    unit = 1.0
    written = []
    if kind is MapFormat.PNG16:
        scale = _png_scale(_read(workspace, *item) for item in paths.items())
        unit = scale["unit"]
        written.append(output / SCALE_NAME)
        write_record(output / SCALE_NAME, scale)
        if scale["clipped"]:
            logger.warning(
                "%.2g %% of the depths are beyond %.4g and become that: outliers would "
                "take the resolution of all others.",
                100 * scale["clipped"],
                scale["farthest"],
            )
    with progress.stage("Exporting", len(paths)) as advance:
        for name, path in paths.items():
            target = output / f"{name}{_SUFFIXES[kind]}"
            _write(target, _read(workspace, name, path), kind, unit)
            written.append(target)
            advance(1)
    return tuple(written)


def _png_scale(depths: Iterable[DepthMap]) -> dict[str, Any]:
    """The depth of one step, the farthest depth, and the share of those beyond it.

    The farthest depth there is, unless few depths are much farther than all others.
    """
    farthest, robust, counts = 0.0, 0.0, np.zeros(len(_EDGES) + 1, np.int64)
    for depth in depths:
        known = depth[depth > 0]
        if known.size:
            farthest = max(farthest, float(known.max()))
            robust = max(robust, float(np.percentile(known, FAR_PERCENTILE)))
            counts += np.bincount(np.searchsorted(_EDGES, known), minlength=len(counts))
    limit = OUTLIER_RATIO * robust
    clipped = 0.0
    if farthest > limit > 0:
        farthest = limit
        clipped = float(counts[np.searchsorted(_EDGES, limit) :].sum() / counts.sum())
    return {
        "unit": farthest / MAX_PNG_VALUE or 1.0,  # 1: maps without any depth
        "depth": "value * unit",
        "no_depth": 0,
        "farthest": farthest,
        "clipped": clipped,
    }


def _map_paths(workspace: Workspace, maps: str) -> dict[str, Path]:
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    names = [view.name for view in scene.views]
    if maps != REFINED:
        found = {name: map_path(workspace, name, maps) for name in names}
        found = {name: path for name, path in found.items() if path.is_file()}
        way_out = f"there are: {_kinds(workspace, names)}"
    else:
        found = _refined_paths(workspace, names)
        way_out = f"run `resdepth-colmap refine {workspace.path}` first"
    if not found:
        raise WorkspaceError(f"{workspace.path}: no {maps} depth map; {way_out}.")
    return found


def _refined_paths(workspace: Workspace, names: list[str]) -> dict[str, Path]:
    for in_place in (False, True):
        output = OutputWorkspace(source=workspace, in_place=in_place)
        written = [name for name in names if output.is_written(name)]
        if written:
            return {name: output.depth_map_path(name) for name in written}
    return {}


def _kinds(workspace: Workspace, names: list[str]) -> str:
    kinds = {kind for name in names for kind in workspace.original_kinds(name)}
    return ", ".join(sorted(kinds)) or "none at all"


def _read(workspace: Workspace, name: str, path: Path) -> DepthMap:
    return masked_depth(workspace.masks, name, read_depth_map(path))


def _write(path: Path, depth: DepthMap, kind: MapFormat, unit: float) -> None:
    if kind is MapFormat.NPY:
        write_npy(path, depth)
    elif kind is MapFormat.PFM:
        write_pfm(path, depth)
    else:
        write_png16(path, depth, unit)
