"""Stage "fuse" with files at both ends: refined maps in, a cloud's file out."""

from pathlib import Path

from resdepth_colmap.config import FuseConfig
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.io.point_cloud import check_cloud_path, write_cloud
from resdepth_colmap.pipeline.fuse.stage import fuse_workspace
from resdepth_colmap.progress import Progress


def cloud_path(output: OutputWorkspace, cloud_format: str) -> Path:
    """Where the fused cloud of a workspace goes."""
    return output.path / f"fused.{cloud_format}"


def cloud_before_path(output: OutputWorkspace) -> Path:
    """Where a sample of the cloud of the initial maps goes, to be shown beside it."""
    return output.path / "fused_before_sample.ply"


def fuse_to_file(
    path: Path,
    config: FuseConfig,
    target: Path | str = "ply",
    *,
    in_place: bool = False,
    progress: Progress | None = None,
) -> tuple[Path, int]:
    """Fuse the refined maps of a workspace and write the cloud.

    Args:
        path: The workspace, or a parent of it.
        config: Options.
        target: File to write, or a format for the usual file in `resdepth/`.
        in_place: Whether the maps were refined in place.
        progress: Is told of each view.

    Returns:
        The file written, and the number of its points.

    Raises:
        WorkspaceError: If a map cannot be read or the cloud not be written.
        FusionError: If there is no refined map, or no point survived.
        ConfigError: If the target's extension is none of a cloud.
    """
    workspace = open_workspace(path)
    output = OutputWorkspace(source=workspace, in_place=in_place)
    file = target if isinstance(target, Path) else cloud_path(output, target)
    check_cloud_path(file)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    fused = fuse_workspace(output, scene, config, progress)
    write_cloud(file, fused.cloud)
    return file, len(fused.cloud)
