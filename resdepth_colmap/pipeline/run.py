"""The whole road: stereo, refine, fuse, pictures, and a record of it all."""

import contextlib
import dataclasses
import datetime
import json
import logging
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from resdepth_colmap.config import Fuser, MaskConfig
from resdepth_colmap.errors import FusionError
from resdepth_colmap.io.colmap.masks import Masks
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.output import (
    BACKDROP_FOLDER,
    OVERVIEW_NAME,
    OutputWorkspace,
    read_record,
    write_record,
)
from resdepth_colmap.io.colmap.workspace import check_images, open_workspace
from resdepth_colmap.pipeline.backdrop import backdrop_masks
from resdepth_colmap.pipeline.fuse.to_file import Clouds, cloud_path
from resdepth_colmap.pipeline.in_place import adopt_new_maps
from resdepth_colmap.pipeline.masks import mask_facts, with_masks
from resdepth_colmap.pipeline.refine.stage import (
    Network,
    RefineReport,
    load_network,
    refine_views,
)
from resdepth_colmap.pipeline.run_config import RunConfig
from resdepth_colmap.pipeline.stereo.stage import StereoReport, stereo_workspace
from resdepth_colmap.progress import Progress, SilentProgress
from resdepth_colmap.scene import Scene
from resdepth_colmap.versions import peak_memory_mb, versions

logger = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True, kw_only=True)
class RunResult:
    """What a run made.

    Attributes:
        stereo: The initial depth.
        refine: The refined maps and where they are.
        cloud_path: The fused cloud; None without fusion.
        num_points: Its points.
        num_points_before: Points that the initial maps give, fused in the same way;
            None if nobody counted them.
        overview_path: The picture of the whole workspace; None without pictures.
        report_path: The page that shows all of it; None as long as nobody wrote it.
        is_idle: Whether there was nothing to do.
    """

    stereo: StereoReport
    refine: RefineReport
    cloud_path: Path | None = None
    num_points: int = 0
    num_points_before: int | None = None
    overview_path: Path | None = None
    report_path: Path | None = None
    is_idle: bool = False


def run_refine(
    path: Path, config: RunConfig | None = None, progress: Progress | None = None
) -> RunResult:
    """Refine a workspace: initial depth where there is none, maps, cloud, pictures.

    All of it goes to `resdepth/` in the workspace, with a record in `run.json`. What
    cannot work is said before the long work starts.

    Args:
        path: The workspace, or a parent of it.
        config: Options; None = the defaults.
        progress: Is told of each stage.

    Raises:
        WorkspaceError: If the workspace is broken or the result cannot be written.
        WeightsError: If the weights cannot be read.
        BackendUnavailableError: If this machine lacks what was asked for.
        FusionError: If no point survived; maps, pictures and record are there.
    """
    config = config or RunConfig()
    workspace = open_workspace(path)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    check_images(workspace, scene)
    workspace = with_masks(workspace, scene, config.masks)
    network = load_network(config.refine)
    output = OutputWorkspace(source=workspace, in_place=config.in_place)
    adopt_new_maps(output, scene)
    output.prepare([view.name for view in scene.views])
    output = _without_backdrop(output, scene, config)
    run = _Run(scene, config, output, network, progress or SilentProgress())
    return run.run()


def _without_backdrop(
    output: OutputWorkspace, scene: Scene, config: RunConfig
) -> OutputWorkspace:
    """Masks of a uniform backdrop, where the user has given none."""
    workspace = output.source
    is_free = workspace.masks.folder in (None, output.path / BACKDROP_FOLDER)
    if config.masks != MaskConfig() or workspace.masks.alpha_folder or not is_free:
        return output
    masks = Masks(folder=backdrop_masks(output, scene))
    workspace = dataclasses.replace(workspace, masks=masks)
    return dataclasses.replace(output, source=workspace)


class _Run:
    """One run: its stages and its record."""

    def __init__(
        self,
        scene: Scene,
        config: RunConfig,
        output: OutputWorkspace,
        network: Network,
        progress: Progress,
    ) -> None:
        self.workspace = output.source
        self.network = network
        self.scene = scene
        self.config = config
        self.output = output
        self.progress = progress
        self.seconds: dict[str, float] = {}
        self.facts: dict[str, Any] = {}
        self.has_fused = False

    def run(self) -> RunResult:
        result = RunResult(stereo=self._stereo(), refine=self._refine())
        failure: FusionError | None = None
        if not self.config.no_fuse:
            try:
                result = self._fuse(result)
            except FusionError as error:  # the maps are good: go on, then say it
                failure = error
                self.facts["fuse"] = {"error": str(error)}
        is_idle = failure is None and self._is_idle(result)
        if not self.config.no_pictures:
            result = self._draw(result, is_idle)
        if not is_idle:  # else the record of the run that made it all stays
            self._write_record(result)
        result = dataclasses.replace(result, is_idle=is_idle)
        if failure is not None:
            raise failure
        return result

    def _stereo(self) -> StereoReport:
        with self._timed("stereo"):
            return stereo_workspace(
                self.workspace,
                self.scene,
                self.config.stereo,
                self.config.backend,
                progress=self.progress,
            )

    def _refine(self) -> RefineReport:
        with self._timed("refine"):
            return refine_views(
                self.output,
                self.scene,
                self.config.refine,
                self.network,
                self.config.overwrite,
                self.progress,
            )

    def _fuse(self, result: RunResult) -> RunResult:
        path = cloud_path(self.output, self.config.cloud_format)
        overwrite = self.config.overwrite
        clouds = Clouds(self.output, self.scene, self.config.fuse, self.progress)
        with self._timed("fuse"):
            fused = clouds.refined(path, overwrite)
        num_before = None
        # COLMAP's fusion keeps no account that could be compared.
        if self.config.fuse.fuser is Fuser.OPEN3D:
            with self._timed("fuse_before"):
                before = clouds.initial(result.refine.images, overwrite)
            self.facts["fuse_before"] = before
            num_before = before["num_points"]
        self.has_fused = clouds.num_made > 0
        self.facts["fuse"] = {**fused, "points_before_refinement": num_before}
        return dataclasses.replace(
            result,
            cloud_path=path,
            num_points=fused["points"],
            num_points_before=num_before,
        )

    def _is_idle(self, result: RunResult) -> bool:
        """Whether all of it was made by an earlier run with the same options."""
        options = json.loads(json.dumps(self.config.to_mapping(), default=str))
        return not (
            result.stereo.matched
            or result.refine.refined
            or self.has_fused
            or read_record(self.output.record_path).get("options") != options
        )

    def _draw(self, result: RunResult, is_idle: bool) -> RunResult:
        path = self.output.path / OVERVIEW_NAME
        if is_idle and path.is_file():
            return dataclasses.replace(result, overview_path=path)
        from resdepth_colmap.pipeline.pictures import draw_workspace  # fonts: slow

        with self._timed("pictures"):
            path = draw_workspace(self.output, self.scene, result.refine, self.progress)
        return dataclasses.replace(result, overview_path=path)

    def _write_record(self, result: RunResult) -> None:
        stereo, refine = result.stereo, result.refine
        memory_mb = peak_memory_mb()
        record = {
            "finished": datetime.datetime.now(datetime.UTC).isoformat("T", "seconds"),
            "workspace": self.workspace.path,
            "options": self.config.to_mapping(),
            "versions": versions(),
            **refine.facts,
            "seconds": {name: round(value, 3) for name, value in self.seconds.items()},
            "peak_memory_mb": None if memory_mb is None else round(memory_mb),
            "stereo": {
                "backend": stereo.backend,
                "matched": stereo.matched,
                "kept": stereo.kept,
                "skipped": dict(stereo.skipped),
            },
            "refined": refine.refined,
            "kept": refine.kept,
            "skipped": dict(refine.skipped),
            "masks": mask_facts(self.workspace),
            **self.facts,
        }
        path = self.output.record_path
        # The images' own part was written by the refinement, one by one.
        write_record(path, {**record, "images": read_record(path).get("images", {})})

    @contextlib.contextmanager
    def _timed(self, stage: str) -> Iterator[None]:
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[stage] = time.perf_counter() - start
