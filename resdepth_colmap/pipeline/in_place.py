"""Maps that the user has put in the place of refined ones: they are inputs."""

import logging
from pathlib import Path

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.colmap.workspace import ORIGINAL_SUFFIX
from resdepth_colmap.pipeline.manifest import Manifest
from resdepth_colmap.scene import Scene

logger = logging.getLogger(__name__)


def adopt_new_maps(output: OutputWorkspace, scene: Scene) -> None:
    """Let maps that replaced the results of a run in place count as new ones.

    The original that was kept beside such a map belongs to an older state; it stays
    there under a number, and the new map is kept as the original of the next run.

    Args:
        output: Of the workspace; whether the next run is in place does not matter.
        scene: The views.

    Raises:
        WorkspaceError: If a file cannot be read or renamed.
    """
    manifest = Manifest(output.path)
    in_place = OutputWorkspace(source=output.source, in_place=True)
    for view in scene.views:
        paths = (
            in_place.depth_map_path(view.name),
            in_place.normal_map_path(view.name),
        )
        if any(_is_new(path, manifest) for path in paths):
            logger.info("%s: the map in stereo/ is new and is used.", view.name)
            for path in paths:
                _set_aside(path.with_name(path.name + ORIGINAL_SUFFIX))


def _is_new(path: Path, manifest: Manifest) -> bool:
    original = path.with_name(path.name + ORIGINAL_SUFFIX)
    if not (original.is_file() and path.is_file()):
        return False
    written = manifest.written_digest(path)
    return written is not None and manifest.fingerprints.of(path) != written


def _set_aside(original: Path) -> None:
    if not original.is_file():
        return
    number = 1
    while (target := original.with_name(f"{original.name}.{number}")).exists():
        number += 1
    try:
        original.rename(target)
    except OSError as error:
        reason = error.strerror or str(error)
        raise WorkspaceError(f"{original}: cannot be renamed ({reason}).") from error
