"""The two passes of PatchMatch, as tasks.

As in COLMAP (patch_match.cc), the first pass matches the photographs of all views,
unfiltered; the second matches each view again, against the first one's depth maps of
its sources, too.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.matching.patch_match import METHOD
from resdepth_colmap.pipeline.manifest import Manifest, Task, key_of, view_facts
from resdepth_colmap.pipeline.stereo.plan import StereoPlan
from resdepth_colmap.scene import Scene

STAGE = "stereo"
PHOTOMETRIC = "photometric"
GEOMETRIC = "geometric"

_DECIDE_NOTHING = (
    "cache_size",
    "depth_max",
    "depth_min",
    "max_num_sources",
    "min_triangulation_angle",
)
"""Options that decide nothing, or only what is part of a key by itself."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class StereoPass:
    """One of the two passes.

    Attributes:
        kind: The word before ".bin" in the names of its maps.
        is_filtered: Whether what too few sources agree with is dropped.
        num_units: How long it takes, in units of the second pass.
    """

    kind: str
    is_filtered: bool
    num_units: int = 1


@dataclasses.dataclass(frozen=True, kw_only=True)
class MatchTask(Task):
    """One view to match in one pass.

    Attributes:
        plan: The view, its sources, its depth range.
        which: The pass.
    """

    plan: StereoPlan
    which: StereoPass


def passes_of(config: StereoConfig) -> tuple[StereoPass, ...]:
    """The passes of a configuration; only the last one is filtered."""
    if not config.geom_consistency:
        return (StereoPass(kind=PHOTOMETRIC, is_filtered=config.filter, num_units=2),)
    return (
        StereoPass(kind=PHOTOMETRIC, is_filtered=False, num_units=2),
        StereoPass(kind=GEOMETRIC, is_filtered=config.filter),
    )


def map_name(name: str, kind: str) -> str:
    """What the maps of an image are called in the manifest."""
    return f"{name}.{kind}"


def match_tasks(
    workspace: Workspace,
    scene: Scene,
    plans: Sequence[StereoPlan],
    config: StereoConfig,
    manifest: Manifest,
) -> list[list[MatchTask]]:
    """The tasks of each pass, in the order of the plans.

    Raises:
        WorkspaceError: If an image, a mask or a map cannot be read.
    """
    keys = _Keys(workspace, scene, config, manifest)
    tasks: list[list[MatchTask]] = []
    for which in passes_of(config):
        first = {task.plan.index: task for task in tasks[0]} if tasks else {}
        tasks.append([])
        for plan in plans:
            name = scene.views[plan.index].name
            key = keys.photometric(plan)
            if which.kind == GEOMETRIC:
                key = keys.geometric(plan, first)
            writes = (
                workspace.depth_map_path(name, which.kind),
                workspace.normal_map_path(name, which.kind),
            )
            if which.is_filtered and config.write_consistency_graph:
                graph = workspace.consistency_graph_path(name, which.kind)
                writes = (*writes, graph)  # type: ignore[assignment] # one more
            tasks[-1].append(
                MatchTask(
                    stage=STAGE,
                    name=map_name(name, which.kind),
                    key=key,
                    writes=writes,
                    plan=plan,
                    which=which,
                )
            )
    return tasks


def recorded_config(manifest: Manifest) -> StereoConfig | None:
    """The options that the maps of a workspace were made with; None: none is ours."""
    options: dict[str, Any] = {}
    for facts in manifest.facts_of(STAGE):
        options = dict(facts.get("options") or options)
    if not manifest.has_any(STAGE):
        return None
    known = {field.name for field in dataclasses.fields(StereoConfig)}
    return StereoConfig(**{k: value for k, value in options.items() if k in known})


def were_masked(manifest: Manifest) -> bool:
    """Whether any map of ours in a workspace was made with masks."""
    noted = (facts.get("masks") for facts in manifest.facts_of(STAGE))
    return any(isinstance(masks, dict) and any(masks.values()) for masks in noted)


def is_fresh(task: MatchTask, manifest: Manifest) -> bool:
    """Whether a task need not be done: its maps are somebody else's, or fresh."""
    return not is_replaceable(task, manifest) or manifest.is_fresh(task)


def is_replaceable(task: MatchTask, manifest: Manifest) -> bool:
    """Whether its depth map is of this program, not there, or blank."""
    path = task.writes[0]
    if not path.exists() or manifest.is_ours(task):
        return True
    return not manifest.fingerprints.of_map(path).filled


class _Keys:
    """Hashes of all that the maps of a view are made from."""

    def __init__(
        self,
        workspace: Workspace,
        scene: Scene,
        config: StereoConfig,
        manifest: Manifest,
    ) -> None:
        self.workspace = workspace
        self.scene = scene
        self.config = config
        self.manifest = manifest

    def photometric(self, plan: StereoPlan) -> str:
        views = [self._view(index) for index in (plan.index, *plan.sources)]
        facts = [self._options(PHOTOMETRIC), plan.depth_range, views]
        return key_of([*facts, self._mask(plan.index)])

    def geometric(self, plan: StereoPlan, first: dict[int, MatchTask]) -> str:
        indices = (plan.index, *plan.sources)
        maps = [self._map(index, first.get(index)) for index in indices]
        views = [self._view(index) for index in indices]
        mask = self._mask(plan.index)
        facts = [self._options(GEOMETRIC), plan.depth_range, views, maps]
        return key_of(facts if mask is None else [*facts, mask])

    def _map(self, index: int, task: MatchTask | None) -> str | None:
        """What tells one photometric map from another: its input, or its file."""
        if task is not None and is_replaceable(task, self.manifest):
            return task.key
        name = self.scene.views[index].name
        path = self.workspace.depth_map_path(name, PHOTOMETRIC)
        return self.manifest.fingerprints.of(path) if path.is_file() else None

    def _view(self, index: int) -> list[Any]:
        view = self.scene.views[index]
        path = self.workspace.image_path(view.name)
        image = self.manifest.fingerprints.of(path) if path.is_file() else None
        return [*view_facts(view), image]

    def _mask(self, index: int) -> list[str] | None:
        files = self.workspace.masks.files(self.scene.views[index].name)
        return [self.manifest.fingerprints.of(path) for path in files] or None

    def _options(self, kind: str) -> dict[str, Any]:
        """Those that decide the maps of that kind."""
        options = self.config.to_mapping()
        idle = list(_DECIDE_NOTHING)
        is_first_of_two = kind == PHOTOMETRIC and self.config.geom_consistency
        if is_first_of_two or not self.config.filter:
            idle += [name for name in options if name.startswith("filter")]
            idle.append("write_consistency_graph")
        if kind == PHOTOMETRIC:
            idle += [name for name in options if name.startswith("geom_consistency")]
        deciding = {name: options[name] for name in options if name not in idle}
        return {"method": METHOD, **deciding}
