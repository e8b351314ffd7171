"""Stage "stereo": initial depth and normal maps for the views that have none."""

import dataclasses
import logging

from resdepth_colmap.config import StereoBackend, StereoConfig
from resdepth_colmap.errors import BackendUnavailableError, WorkspaceError
from resdepth_colmap.io.colmap.masks import check_masks
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.pipeline.stereo.colmap import run_colmap
from resdepth_colmap.pipeline.stereo.ledger import Fingerprints, StereoLedger
from resdepth_colmap.pipeline.stereo.passes import (
    StereoPass,
    ViewMatcher,
    passes_of,
)
from resdepth_colmap.pipeline.stereo.plan import StereoPlan, plan_stereo
from resdepth_colmap.pipeline.stereo.warm_up import warm_up
from resdepth_colmap.progress import Progress, SilentProgress
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
        goes_on = StereoLedger(workspace).is_unfinished
        return StereoBackend.CPU if goes_on else StereoBackend.EXISTING
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
    option or an input changed.

    Raises:
        WorkspaceError: If an image cannot be read, or nothing could be matched.
        BackendUnavailableError: See `choose_backend`.
    """
    backend = choose_backend(backend, workspace, scene)
    if backend is StereoBackend.EXISTING:
        names = [v.name for v in scene.views if workspace.map_kinds(v.name)]
        return StereoReport(backend=backend, kept=tuple(names))
    if backend is StereoBackend.COLMAP:
        return _run_colmap(workspace, scene, config)
    return _run_cpu(workspace, scene, config, overwrite, progress or SilentProgress())


def _run_colmap(
    workspace: Workspace, scene: Scene, config: StereoConfig
) -> StereoReport:
    run_colmap(workspace, scene, config)
    names = tuple(view.name for view in scene.views)
    return StereoReport(backend=StereoBackend.COLMAP, matched=names)


def _run_cpu(
    workspace: Workspace,
    scene: Scene,
    config: StereoConfig,
    overwrite: bool,
    progress: Progress,
) -> StereoReport:
    _check_masks(scene, config)
    plans, skipped = plan_stereo(workspace, scene, config)
    ledger = StereoLedger(workspace)
    fingerprints = Fingerprints(scene, plans, config, ledger)
    pending = _pending(plans, fingerprints, passes_of(config), overwrite)
    if pending:
        warm_up(config)
    matcher = ViewMatcher(workspace, scene, config, ledger)
    matched: dict[str, None] = {}
    failed: dict[str, str] = {}
    ledger.start()
    num_units = sum(which.num_units for which, _ in pending)
    with progress.stage("PatchMatch", num_units) as advance:
        for which, plan in pending:
            name = scene.views[plan.index].name
            reason = matcher.match(plan, which, advance)
            if reason:
                logger.warning("%s is skipped: %s.", name, reason)
                failed[name] = reason
                continue
            ledger.add(name, which.kind, fingerprints.of(plan, which.kind))
            matched[name] = None
    ledger.finish()
    names = [scene.views[plan.index].name for plan in plans]
    report = StereoReport(
        backend=StereoBackend.CPU,
        matched=tuple(n for n in matched if n not in failed),
        kept=tuple(n for n in names if n not in matched and n not in failed),
        skipped=(*skipped, *failed.items()),
    )
    _check_any(workspace, report)
    return report


def _pending(
    plans: tuple[StereoPlan, ...],
    fingerprints: Fingerprints,
    passes: tuple[StereoPass, ...],
    overwrite: bool,
) -> list[tuple[StereoPass, StereoPlan]]:
    """What is to be done, in order: first passes only where a last one needs them."""
    *first, last = passes
    ours = [p for p in plans if overwrite or not fingerprints.are_kept(p, last.kind)]
    needed = {index for plan in ours for index in (plan.index, *plan.sources)}
    return [
        (which, plan)
        for which in first
        for plan in plans
        if plan.index in needed
        and (overwrite or not fingerprints.are_kept(plan, which.kind))
    ] + [(last, plan) for plan in ours]


def _check_masks(scene: Scene, config: StereoConfig) -> None:
    if config.mask_path is None:
        return
    cameras = {view.name: view.camera for view in scene.views}
    num_masks = check_masks(config.mask_path, cameras)
    if num_masks < len(cameras):
        logger.warning(
            "%s: masks for %d of %d images (<image name>.png).",
            config.mask_path,
            num_masks,
            len(cameras),
        )


def _check_any(workspace: Workspace, report: StereoReport) -> None:
    if not report.matched and not report.kept:
        raise WorkspaceError(
            f"{workspace.path}: no view could be matched: "
            + "; ".join(f"{name}: {reason}" for name, reason in report.skipped[:3])
            + "."
        )
