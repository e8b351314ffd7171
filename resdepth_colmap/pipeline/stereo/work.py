"""What is left to match in a workspace: the tasks that are not fresh."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.masks import Masks
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.pipeline.initial_map import map_path
from resdepth_colmap.pipeline.manifest import Manifest
from resdepth_colmap.pipeline.stereo.passes import (
    GEOMETRIC,
    PHOTOMETRIC,
    STAGE,
    MatchTask,
    is_fresh,
    map_name,
    match_tasks,
    recorded_config,
    were_masked,
)
from resdepth_colmap.pipeline.stereo.plan import Skipped, StereoPlan, plan_stereo
from resdepth_colmap.scene import Scene, View


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class StereoWork:
    """What the CPU PatchMatch has to do.

    Attributes:
        workspace: Where the maps go, with the masks that they are made with.
        config: Options.
        manifest: Knows what is fresh.
        plans: All views that can be matched.
        skipped: Images that cannot, each with the reason.
        pending: What is to be done, in order.
    """

    workspace: Workspace
    config: StereoConfig
    manifest: Manifest
    plans: tuple[StereoPlan, ...]
    skipped: Skipped
    pending: list[MatchTask]


def plan_work(
    workspace: Workspace, scene: Scene, config: StereoConfig, *, overwrite: bool = False
) -> StereoWork:
    """All that patch-match.cfg names and that is not fresh, or all of it.

    Raises:
        WorkspaceError: If patch-match.cfg is malformed, or a file cannot be read.
    """
    manifest = Manifest(workspace.stereo_path)
    plans, skipped = plan_stereo(workspace, scene, config)
    return _work(workspace, scene, config, (manifest, plans, skipped), overwrite)


def plan_auto(workspace: Workspace, scene: Scene, config: StereoConfig) -> StereoWork:
    """What a workspace lacks that should have a depth map for each view.

    Where maps of ours are there, all that is missing or not fresh, with the options
    that those were made with. Where all maps are somebody else's, photometric maps of
    the views that have none; blank maps count as none. Maps that were made without
    masks need not be made again for masks, which the refinement lays over them.

    Args:
        workspace: Where the maps lie.
        scene: All views that should have a map.
        config: Options where no maps of ours tell them.

    Raises:
        WorkspaceError: If patch-match.cfg is malformed, or a file cannot be read.
    """
    manifest = Manifest(workspace.stereo_path)
    recorded = recorded_config(manifest)
    with_map = views_with_map(workspace, scene, manifest)
    if recorded is not None:
        config = recorded
        if not were_masked(manifest):
            workspace = dataclasses.replace(workspace, masks=Masks())
    elif with_map:
        config = dataclasses.replace(config, geom_consistency=False)
    plans, skipped = plan_stereo(workspace, scene, config, all_views=True)
    skipped = tuple(it for it in skipped if scene.index(it[0]) not in with_map)
    plans = tuple(
        plan
        for plan in plans
        if plan.index not in with_map or _is_ours(scene.views[plan.index], manifest)
    )
    return _work(workspace, scene, config, (manifest, plans, skipped), False)


def views_with_map(workspace: Workspace, scene: Scene, manifest: Manifest) -> set[int]:
    """Indices of the views that have a depth map with any depth in it, or a broken one.

    A broken map is an error of whoever starts from it, not a missing one.
    """

    def is_blank(path: Path) -> bool:
        try:
            return not manifest.fingerprints.of_map(path).filled
        except WorkspaceError:
            return False

    def has_map(name: str) -> bool:
        paths = (map_path(workspace, name, k) for k in workspace.original_kinds(name))
        return any(not is_blank(path) for path in paths)

    return {index for index, view in enumerate(scene.views) if has_map(view.name)}


def _is_ours(view: View, manifest: Manifest) -> bool:
    """Whether any map of a view was made by this program."""
    kinds = (PHOTOMETRIC, GEOMETRIC)
    return any(manifest.has(STAGE, map_name(view.name, kind)) for kind in kinds)


def _work(
    workspace: Workspace,
    scene: Scene,
    config: StereoConfig,
    known: tuple[Manifest, tuple[StereoPlan, ...], Skipped],
    overwrite: bool,
) -> StereoWork:
    manifest, plans, skipped = known
    passes = match_tasks(workspace, scene, plans, config, manifest)
    return StereoWork(
        workspace=workspace,
        config=config,
        manifest=manifest,
        plans=plans,
        skipped=skipped,
        pending=_pending(passes, manifest, overwrite),
    )


def _pending(
    passes: Sequence[Sequence[MatchTask]], manifest: Manifest, overwrite: bool
) -> list[MatchTask]:
    """What is to be done, in order: first passes only where a last one needs them."""
    *first, last = passes
    ours = [task for task in last if overwrite or not is_fresh(task, manifest)]
    needed = {i for task in ours for i in (task.plan.index, *task.plan.sources)}
    return [
        task
        for tasks in first
        for task in tasks
        if task.plan.index in needed and (overwrite or not is_fresh(task, manifest))
    ] + ours
