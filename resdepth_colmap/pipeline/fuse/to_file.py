"""The stage "fuse" with files at both ends: maps in, a cloud's file out."""

import dataclasses
import importlib.metadata
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from resdepth_colmap.config import FuseConfig, Fuser, MaskConfig
from resdepth_colmap.errors import FusionError
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.io.point_cloud import check_cloud_path, write_cloud
from resdepth_colmap.pipeline.fuse.stage import (
    fuse_initial,
    fuse_workspace,
    initial_files,
    neighbours_of,
    refined_files,
)
from resdepth_colmap.pipeline.fuse.views import MapFiles
from resdepth_colmap.pipeline.manifest import Manifest, Task, key_of, view_facts
from resdepth_colmap.pipeline.masks import with_masks
from resdepth_colmap.progress import Progress, SilentProgress
from resdepth_colmap.scene import Scene

STAGE = "fuse"

MOST_POINTS_SHOWN = 150_000
"""Points that are kept of a cloud which is there to be shown."""


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
    masks: MaskConfig | None = None,
    progress: Progress | None = None,
) -> tuple[Path, int]:
    """Fuse the refined maps of a workspace and write the cloud.

    Args:
        path: The workspace, or a parent of it.
        config: Options.
        target: File to write, or a format for the usual file in `resdepth/`.
        in_place: Whether the maps were refined in place.
        masks: What to leave out; None = what the refinement has left out.
        progress: Is told of each view.

    Returns:
        The file written, and the number of its points.

    Raises:
        WorkspaceError: If a map cannot be read or the cloud not be written.
        FusionError: If there is no refined map, or no point survived.
        ConfigError: If the target's extension is none of a cloud.
    """
    workspace = open_workspace(path)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    workspace = with_masks(workspace, scene, masks or MaskConfig(), after_run=True)
    output = OutputWorkspace(source=workspace, in_place=in_place)
    file = target if isinstance(target, Path) else cloud_path(output, target)
    check_cloud_path(file)
    clouds = Clouds(output, scene, config, progress or SilentProgress())
    return file, int(clouds.refined(file, overwrite=False)["points"])


class Clouds:
    """The clouds of a workspace; one that is fresh is not made again.

    Attributes:
        num_made: Clouds made until now.
    """

    def __init__(
        self,
        output: OutputWorkspace,
        scene: Scene,
        config: FuseConfig,
        progress: Progress,
    ) -> None:
        """Make nothing yet.

        Args:
            output: Where the refined maps are.
            scene: The views.
            config: Options of the fusion.
            progress: Is told of each view.
        """
        self._output = output
        self._scene = scene
        self._config = config
        self._progress = progress
        self._manifest = Manifest(output.path)
        self.num_made = 0

    def refined(self, path: Path, overwrite: bool) -> dict[str, Any]:
        """The cloud of the refined maps; returns what is known of it.

        Raises:
            WorkspaceError: If a map cannot be read or the cloud not be written.
            FusionError: If there is no refined map, or no point survived.
            ConfigError: If the voxels are too small for the extent of the cloud.
        """
        files = refined_files(self._output, self._scene)

        def make() -> dict[str, Any]:
            fused = fuse_workspace(
                self._output, self._scene, self._config, self._progress
            )
            write_cloud(path, fused.cloud)
            return {
                "points": len(fused.cloud),
                "thinned": fused.num_thinned,
                "outliers": fused.num_outliers,
                **dataclasses.asdict(fused.statistics),
            }

        return self._made(self._task(path, files), make, overwrite)

    def initial(
        self, images: Mapping[str, Mapping[str, Any]], overwrite: bool
    ) -> dict[str, Any]:
        """A sample of the cloud that the initial maps give; what is known of it.

        Args:
            images: What is known of each refined image (`fuse_initial`).
            overwrite: Make it also if it is fresh.

        Raises:
            WorkspaceError: If a map cannot be read or the cloud not be written.
        """
        path = cloud_before_path(self._output)
        files = initial_files(self._output.source, self._scene, images)

        def make() -> dict[str, Any]:
            before = fuse_initial(
                self._output.source,
                self._scene,
                images,
                self._config,
                self._progress,
            )
            path.unlink(missing_ok=True)
            if len(before.cloud):
                write_cloud(path, before.cloud.sampled(MOST_POINTS_SHOWN))
            return dataclasses.asdict(before.statistics)

        return self._made(self._task(path, files), make, overwrite)

    def _made(
        self, task: Task, make: Callable[[], dict[str, Any]], overwrite: bool
    ) -> dict[str, Any]:
        if overwrite or not self._manifest.is_fresh(task):
            self.num_made += 1
            self._manifest.start(task)
            self._manifest.finish(task, make())
        self._manifest.save()
        return self._manifest.facts(task)

    def _task(self, path: Path, files: Sequence[MapFiles]) -> Task:
        if not files:
            raise FusionError(
                f"{self._output.workspace.stereo_path}: no refined map to fuse; run "
                f"`resdepth-colmap refine {self._output.source.path}` first."
            )
        facts = [
            importlib.metadata.version("resdepth-colmap"),
            self._config.to_mapping(),
            [self._facts(file) for file in files],
            neighbours_of(files, self._scene),
        ]
        if self._config.fuser is Fuser.COLMAP:
            facts.append(self._model())
        name = self._manifest.fingerprints.relative(path)
        return Task(stage=STAGE, name=name, key=key_of(facts), writes=(path,))

    def _facts(self, file: MapFiles) -> list[Any]:
        paths = (
            file.image_path,
            file.depth_path,
            file.normal_path,
            file.confidence_path,
            *file.masks.files(file.view.name),
        )
        known = self._manifest.fingerprints
        digests = [
            known.of(p) if p is not None and p.is_file() else None for p in paths
        ]
        return [view_facts(file.view), digests, file.depth_scale]

    def _model(self) -> list[str]:
        """COLMAP's fusion finds neighbours by the points of the sparse model."""
        paths = sorted(self._output.source.sparse_path.iterdir())
        return [self._manifest.fingerprints.of(p) for p in paths if p.is_file()]
