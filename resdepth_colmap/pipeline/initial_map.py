"""Which depth map an image is refined from."""

import dataclasses
from collections.abc import Iterable
from pathlib import Path

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.maps import read_map_size
from resdepth_colmap.io.colmap.workspace import Workspace, original_map_path
from resdepth_colmap.pipeline.fingerprints import Fingerprints
from resdepth_colmap.scene import Camera, Scene

AUTO = "auto"
PREFERRED = "geometric"  # of two maps that are equally full


@dataclasses.dataclass(frozen=True, kw_only=True)
class InitialMap:
    """The map that an image starts from.

    Attributes:
        kind: The word before ".bin" in its file name.
        path: Its file.
        filled: Share of pixels that have a depth, in 0..1.
        digest: Of its content.
        scale: What its depths are multiplied with (`--fit-scale`).
    """

    kind: str
    path: Path
    filled: float
    digest: str
    scale: float = 1.0


def candidate_kinds(
    workspace: Workspace, name: str, requested: str = AUTO
) -> tuple[str, ...]:
    """The kinds of map that an image may start from; () if it has none of those.

    Maps that a run in place has replaced count as they were before it.
    """
    kinds = workspace.original_kinds(name)
    return kinds if requested == AUTO else tuple(k for k in kinds if k == requested)


def map_path(workspace: Workspace, name: str, kind: str) -> Path:
    """Where an image's map of that kind lies, as it was before any run in place."""
    path = workspace.depth_map_path(name, kind)
    return original_map_path(path) or path


def choose_initial_map(
    workspace: Workspace,
    name: str,
    camera: Camera,
    kinds: Iterable[str],
    fingerprints: Fingerprints | None = None,
) -> InitialMap:
    """Choose the fullest of an image's maps; of equal ones the geometric.

    Args:
        workspace: Where the maps lie.
        name: Name of the image.
        camera: Its camera; a map may be smaller, never larger.
        kinds: What `candidate_kinds` gave, not empty.
        fingerprints: Know maps that need not be read again.

    Raises:
        WorkspaceError: If a map is broken, or belongs to an image of another size.
    """
    fingerprints = fingerprints or Fingerprints(workspace.path, {})
    maps = []
    for kind in kinds:
        path = map_path(workspace, name, kind)
        found = fingerprints.of_map(path)
        _check_size(path, found.size_px, camera)
        maps.append(
            InitialMap(kind=kind, path=path, filled=found.filled, digest=found.digest)
        )
    return max(maps, key=lambda found: (found.filled, found.kind == PREFERRED))


def check_map_size(path: Path, camera: Camera) -> None:
    """Check, by its header, that a map can belong to an image of that camera.

    Raises:
        WorkspaceError: If it is larger than the image, or of another shape.
    """
    _check_size(path, read_map_size(path), camera)


def _check_size(path: Path, size_px: tuple[int, int], camera: Camera) -> None:
    width_px, height_px = size_px
    scale_x, scale_y = width_px / camera.width_px, height_px / camera.height_px
    # COLMAP rounds the size of a smaller map to whole pixels.
    rounding = 1.0 / camera.width_px + 1.0 / camera.height_px
    if max(scale_x, scale_y) > 1.0 or abs(scale_x - scale_y) > rounding:
        raise WorkspaceError(
            f"{path}: the map has {width_px} x {height_px} pixels, but its image "
            f"{camera.width_px} x {camera.height_px}; a map may be smaller than its "
            "image but of the same shape, so this one belongs to another image."
        )


def check_maps_exist(workspace: Workspace, scene: Scene, requested: str) -> None:
    """Check that at least one image has a map to start from.

    Raises:
        WorkspaceError: If none has; the message names the kinds that there are.
    """
    if any(candidate_kinds(workspace, v.name, requested) for v in scene.views):
        return
    found = {k for v in scene.views for k in workspace.original_kinds(v.name)}
    folder = workspace.stereo_path / "depth_maps"
    if found:
        raise WorkspaceError(
            f"{folder}: no {requested} depth map, but there are: "
            f"{', '.join(sorted(found))}; choose one of these with --input."
        )
    raise WorkspaceError(
        f"{folder}: no depth map for any image of the model; "
        "make some with --stereo cpu."
    )
