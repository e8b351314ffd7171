"""Stage "stereo": initial depth and normal maps for the views that have none."""

import dataclasses
import functools
import logging

from resdepth_colmap.config import StereoBackend, StereoConfig
from resdepth_colmap.errors import BackendUnavailableError, WorkspaceError
from resdepth_colmap.io.colmap.maps import (
    write_consistency_graph,
    write_depth_map,
    write_normal_map,
)
from resdepth_colmap.io.colmap.model import read_image_indices
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.pipeline.masks import mask_facts
from resdepth_colmap.pipeline.stereo.colmap import run_colmap
from resdepth_colmap.pipeline.stereo.load_view import MatchLoader
from resdepth_colmap.pipeline.stereo.passes import MatchTask
from resdepth_colmap.pipeline.stereo.plan import say_plan
from resdepth_colmap.pipeline.stereo.view import Matched, match
from resdepth_colmap.pipeline.stereo.warm_up import warm_up
from resdepth_colmap.pipeline.stereo.work import StereoWork, plan_auto, plan_work
from resdepth_colmap.progress import Advance, Progress, SilentProgress
from resdepth_colmap.scene import Scene

logger = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True, kw_only=True)
class StereoReport:
    """What the stage did.

    Attributes:
        backend: Who matched.
        matched: Names of the views matched now.
        kept: Names of the views whose maps were there already.
        skipped: Name and reason of each view that could not be matched.
    """

    backend: StereoBackend
    matched: tuple[str, ...] = ()
    kept: tuple[str, ...] = ()
    skipped: tuple[tuple[str, str], ...] = ()


def choose_backend(
    requested: StereoBackend, workspace: Workspace, scene: Scene
) -> StereoBackend:
    """Turn `auto` into what this machine and this workspace allow.

    Maps that are there win; then COLMAP's own PatchMatch, where pycolmap was built
    with CUDA; then ours on the CPU, which also goes on where it was interrupted.

    Raises:
        WorkspaceError: If existing maps were asked for and there are none.
        BackendUnavailableError: If COLMAP's was asked for and pycolmap has no CUDA.
    """
    has_maps = any(workspace.map_kinds(view.name) for view in scene.views)
    has_cuda = False
    if requested is StereoBackend.COLMAP or (
        requested is StereoBackend.AUTO and not has_maps
    ):
        import pycolmap

        has_cuda = bool(pycolmap.has_cuda)
    if requested is StereoBackend.EXISTING and not has_maps:
        raise WorkspaceError(
            f"{workspace.stereo_path / 'depth_maps'}: no depth map for any image of "
            "the model; make some with --stereo cpu."
        )
    if requested is StereoBackend.COLMAP and not has_cuda:
        raise BackendUnavailableError(
            "COLMAP's PatchMatch needs CUDA, and this pycolmap has none; use "
            "--stereo cpu, or install pycolmap-cuda12 on a machine with an NVIDIA GPU."
        )
    if requested is not StereoBackend.AUTO:
        return requested
    if has_maps:
        is_done = not plan_auto(workspace, scene, StereoConfig()).pending
        return StereoBackend.EXISTING if is_done else StereoBackend.CPU
    return StereoBackend.COLMAP if has_cuda else StereoBackend.CPU


def stereo_workspace(
    workspace: Workspace,
    scene: Scene,
    config: StereoConfig,
    backend: StereoBackend = StereoBackend.AUTO,
    *,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> StereoReport:
    """Make the depth and normal maps that a workspace lacks, in COLMAP's two passes.

    The photometric ones are whole; the geometric ones, which are matched against the
    depth of the sources, too, are filtered, unless the options say otherwise. Maps of
    others are never replaced unless `overwrite` says so; our own are made anew when an
    option or an input changed. Where a mask of the workspace is 0 there is no depth.

    Raises:
        WorkspaceError: If an image cannot be read, or nothing could be matched.
        BackendUnavailableError: See `choose_backend`.
    """
    requested, backend = backend, choose_backend(backend, workspace, scene)
    if backend is StereoBackend.EXISTING:
        names = [v.name for v in scene.views if workspace.map_kinds(v.name)]
        return StereoReport(backend=backend, kept=tuple(names))
    if backend is StereoBackend.COLMAP:
        return _run_colmap(workspace, scene, config)
    if requested is StereoBackend.AUTO and not overwrite:
        work = plan_auto(workspace, scene, config)
    else:
        work = plan_work(workspace, scene, config, overwrite=overwrite)
    return _run_cpu(scene, work, progress or SilentProgress())


def _run_colmap(
    workspace: Workspace, scene: Scene, config: StereoConfig
) -> StereoReport:
    run_colmap(workspace, scene, config)
    names = tuple(view.name for view in scene.views)
    return StereoReport(backend=StereoBackend.COLMAP, matched=names)


def _run_cpu(scene: Scene, work: StereoWork, progress: Progress) -> StereoReport:
    for name, reason in work.skipped:
        logger.warning("%s is skipped: %s.", name, reason)
    if work.pending:
        say_plan(scene, work.plans, work.config)
        warm_up(work.config)
    loop = _Loop(scene, work)
    matched: dict[str, None] = {}
    failed: dict[str, str] = {}
    num_units = sum(task.which.num_units for task in work.pending)
    with progress.stage("PatchMatch", num_units) as advance:
        for task in work.pending:
            name = scene.views[task.plan.index].name
            reason = loop.do(task, advance)
            if reason:
                logger.warning("%s is skipped: %s.", name, reason)
                failed[name] = reason
                continue
            matched[name] = None
    work.manifest.save()
    names = [scene.views[plan.index].name for plan in work.plans]
    report = StereoReport(
        backend=StereoBackend.CPU,
        matched=tuple(n for n in matched if n not in failed),
        kept=tuple(n for n in names if n not in matched and n not in failed),
        skipped=(*work.skipped, *failed.items()),
    )
    _check_any(work.workspace, report)
    return report


class _Loop:
    """Does tasks: load, match, store."""

    def __init__(self, scene: Scene, work: StereoWork) -> None:
        self.workspace = work.workspace
        self.scene = scene
        self.config = work.config
        self.manifest = work.manifest
        self.loader = MatchLoader(work.workspace, scene, work.config)
        self.facts = {
            "options": work.config.to_mapping(),
            "masks": mask_facts(work.workspace),
        }
        self.probed: dict[int, tuple[float, float]] = {}

    def do(self, task: MatchTask, advance: Advance) -> str:
        """Match a view in a pass; returns why there is nothing to match, or ""."""
        index, num_units = task.plan.index, task.which.num_units
        data = self.loader.load(task, self.probed.get(index))
        if data.why_nothing and data.wanted.any():
            advance(num_units)
            return data.why_nothing
        found = match(
            data,
            self.config,
            task.which.is_filtered,
            lambda _, total: advance(num_units / total),
        )
        if not data.wanted.any():
            advance(num_units)
        else:
            self.probed[index] = found.depth_range
        self._store(task, found)
        return ""

    def _store(self, task: MatchTask, found: Matched) -> None:
        """Write the maps, each whole or not at all."""
        depth_path, normal_path, *graph_path = task.writes
        self.manifest.start(task, self.facts)
        if found.agrees is not None and graph_path:
            sources = (self.scene.views[index] for index in task.plan.sources)
            write_consistency_graph(
                graph_path[0],
                found.agrees & (found.surface.depth > 0),
                [self._model_indices[view.image_id] for view in sources],
            )
        write_normal_map(normal_path, found.surface.normals)
        write_depth_map(depth_path, found.surface.depth)
        self.manifest.finish(task, self.facts)

    @functools.cached_property
    def _model_indices(self) -> dict[int, int]:
        return read_image_indices(self.workspace.sparse_path)


def _check_any(workspace: Workspace, report: StereoReport) -> None:
    if not report.matched and not report.kept:
        raise WorkspaceError(
            f"{workspace.path}: no view could be matched: "
            + "; ".join(f"{name}: {reason}" for name, reason in report.skipped[:3])
            + "."
        )
