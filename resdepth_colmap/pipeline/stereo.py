"""Stage "stereo": initial depth and normal maps for the views that have none."""

import dataclasses
import logging

from resdepth_colmap.config import StereoBackend, StereoConfig
from resdepth_colmap.errors import BackendUnavailableError, WorkspaceError
from resdepth_colmap.geometry.depth_range import depth_range
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.geometry.view_selection import choose_sources
from resdepth_colmap.io.depth_map import write_depth_map
from resdepth_colmap.io.normal_map import write_normal_map
from resdepth_colmap.io.patch_match_cfg import SourceKind, SourceSpec, read_sources
from resdepth_colmap.io.workspace import Workspace
from resdepth_colmap.matching.patch_match import MatchResult, MatchView, match_view
from resdepth_colmap.pipeline.progress import Advance, Progress, SilentProgress
from resdepth_colmap.pipeline.stereo_ledger import (
    KIND,
    UNFINISHED,
    StereoLedger,
    stereo_fingerprint,
)
from resdepth_colmap.pipeline.view_images import ViewImages, camera_at_scale
from resdepth_colmap.scene import Scene, View

logger = logging.getLogger(__name__)

AUTO_SOURCES = 20  # COLMAP's default in patch-match.cfg


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
    """Make the photometric depth and normal maps that a workspace lacks.

    Maps of others are never replaced unless `overwrite` says so; our own are made anew
    when an option or an input changed.

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
    import pycolmap

    options = pycolmap.PatchMatchOptions()
    options.max_image_size = config.max_image_size
    options.window_radius = config.window_radius
    options.sigma_color = config.sigma_color
    options.depth_min = config.depth_min
    options.depth_max = config.depth_max
    pycolmap.patch_match_stereo(str(workspace.path), options=options)
    names = tuple(view.name for view in scene.views)
    return StereoReport(backend=StereoBackend.COLMAP, matched=names)


def _run_cpu(
    workspace: Workspace,
    scene: Scene,
    config: StereoConfig,
    overwrite: bool,
    progress: Progress,
) -> StereoReport:
    plans, skipped = plan_sources(workspace, scene, config)
    ledger = StereoLedger(workspace)
    pending, kept = [], []
    for index, sources in plans.items():
        view = scene.views[index]
        fingerprint = stereo_fingerprint(workspace, scene, index, sources, config)
        if not overwrite and ledger.is_kept(view.name, fingerprint):
            kept.append(view.name)
        else:
            pending.append((index, sources, fingerprint))
    if pending:
        logger.info("Compiling the matcher: up to a minute, once on a machine.")
    matched = []
    # A view with its sources, and as many that the next view may share.
    images = ViewImages(workspace, 2 * (1 + config.max_num_sources))
    ledger.start()
    with progress.stage("PatchMatch", len(pending)) as advance:
        for index, sources, fingerprint in pending:
            view = scene.views[index]
            result = _match(scene, index, sources, config, images, advance)
            ledger.add(view.name, UNFINISHED)
            write_depth_map(workspace.depth_map_path(view.name, KIND), result.depth)
            write_normal_map(workspace.normal_map_path(view.name, KIND), result.normals)
            ledger.add(view.name, fingerprint)
            matched.append(view.name)
    ledger.finish()
    if not matched and not kept:
        raise WorkspaceError(
            f"{workspace.path}: no view could be matched: "
            + "; ".join(f"{name}: {reason}" for name, reason in skipped[:3])
        )
    return StereoReport(
        backend=StereoBackend.CPU,
        matched=tuple(matched),
        kept=tuple(kept),
        skipped=tuple(skipped),
    )


def plan_sources(
    workspace: Workspace, scene: Scene, config: StereoConfig
) -> tuple[dict[int, tuple[int, ...]], list[tuple[str, str]]]:
    """Which views each reference view is matched against, as patch-match.cfg says.

    Without that file every view is matched against automatically chosen ones.

    Returns:
        Indices of the sources by index of the reference; and name and reason of each
        view that cannot be matched.
    """
    path = workspace.stereo_path / "patch-match.cfg"
    specs = read_sources(path) if path.exists() else _automatic(scene)
    plans: dict[int, tuple[int, ...]] = {}
    skipped = []
    for name, spec in specs.items():
        index = scene.index(name)
        if index < 0:
            skipped.append((name, f"{path.name} names it, but the model does not"))
            continue
        sources = _sources_of(scene, index, spec, config)
        if sources:
            plans[index] = sources
        else:
            skipped.append((name, "no other view overlaps with it"))
    for name, reason in skipped:
        logger.warning("%s is skipped: %s.", name, reason)
    return plans, skipped


def _automatic(scene: Scene) -> dict[str, SourceSpec]:
    return {
        view.name: SourceSpec(kind=SourceKind.AUTO, num_auto=AUTO_SOURCES)
        for view in scene.views
    }


def _sources_of(
    scene: Scene, index: int, spec: SourceSpec, config: StereoConfig
) -> tuple[int, ...]:
    limit = config.max_num_sources
    if spec.kind is SourceKind.EXPLICIT:
        named = (scene.index(name) for name in spec.names)
        return tuple(other for other in named if other not in (-1, index))[:limit]
    if spec.kind is SourceKind.AUTO:
        limit = min(limit, spec.num_auto)
    return tuple(choice.index for choice in choose_sources(scene, index, limit))


def _match(
    scene: Scene,
    index: int,
    sources: tuple[int, ...],
    config: StereoConfig,
    images: ViewImages,
    advance: Advance,
) -> MatchResult:
    near, far = config.depth_min, config.depth_max
    if near <= 0:
        near, far = depth_range(scene, index, sources)
    reference, *others = (
        _match_view(scene.views[i], images, config.max_image_size)
        for i in (index, *sources)
    )
    return match_view(
        reference,
        others,
        (near, far),
        config,
        on_sweep=lambda _, total: advance(1.0 / total),
    )


def _match_view(view: View, images: ViewImages, max_image_size: int) -> MatchView:
    """What the matcher takes of a view, at matching size."""
    longest_px = max(view.camera.width_px, view.camera.height_px)
    is_smaller = 0 < max_image_size < longest_px
    scale = max_image_size / longest_px if is_smaller else 1.0
    camera = camera_at_scale(view.camera, scale)
    return MatchView(
        gray=images.gray(view, camera),
        K=index_K(camera),
        cam_from_world=view.cam_from_world,
    )
