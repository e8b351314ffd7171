"""Stage "export": depth maps for programs that do not know COLMAP's format."""

from pathlib import Path

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.depth_map import read_depth_map
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

SCALE_NAME = "depth_scale.json"
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
            same for all maps.
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
        depths = (_read(workspace, *item) for item in paths.items())
        unit = max(float(depth.max()) for depth in depths) / MAX_PNG_VALUE
        unit = unit or 1.0  # maps without any depth
        written.append(output / SCALE_NAME)
        facts = {"unit": unit, "depth": "value * unit", "no_depth": 0}
        write_record(output / SCALE_NAME, facts)
    with progress.stage("Exporting", len(paths)) as advance:
        for name, path in paths.items():
            target = output / f"{name}{_SUFFIXES[kind]}"
            _write(target, _read(workspace, name, path), kind, unit)
            written.append(target)
            advance(1)
    return tuple(written)


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
