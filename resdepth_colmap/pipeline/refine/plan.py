"""What is refined from what: a list of tasks an outer iteration."""

import dataclasses
import importlib.metadata
import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.geometry.view_selection import SourceChoice, choose_sources
from resdepth_colmap.io.colmap.cfg import SourceKind, read_sources
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.io.files import safe_name
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.pipeline.initial_map import (
    InitialMap,
    candidate_kinds,
    choose_initial_map,
)
from resdepth_colmap.pipeline.manifest import Manifest, Task, key_of, view_facts
from resdepth_colmap.pipeline.map_scale import fitted_scales, initial_scales
from resdepth_colmap.pipeline.refine.cross_view import NUM_SOURCE_MAPS
from resdepth_colmap.scene import Scene

logger = logging.getLogger(__name__)

STAGE = "refine"
ITERATIONS_FOLDER = "outer_iterations"
"""In the output: the maps of the iterations before the last, until that is done."""

Skipped = tuple[tuple[str, str], ...]
"""Name and reason of each image that is not refined."""


class MapRead(NamedTuple):
    """A depth map to read.

    Attributes:
        view_index: Of its view in the scene.
        path: Its file.
        scale: What its depths are multiplied with.
    """

    view_index: int
    path: Path
    scale: float = 1.0


@dataclasses.dataclass(frozen=True, kw_only=True)
class ViewTask(Task):
    """One view to refine in one outer iteration.

    Attributes:
        index: Of the view in the scene.
        iteration: Outer iteration, from 0.
        initial: The depth map that it starts from.
        sources: Its second views, best first; () for a network that needs none.
        source_maps: The depth maps of other views that it is compared with: initial
            ones, or what the iteration before made of them.
        reads: All files that it reads: images, depth maps and masks.
    """

    index: int
    iteration: int
    initial: InitialMap
    sources: tuple[SourceChoice, ...]
    source_maps: tuple[MapRead, ...]
    reads: tuple[Path, ...]


@dataclasses.dataclass(frozen=True, kw_only=True)
class RefinePlan:
    """All tasks of the stage.

    Attributes:
        iterations: Of each outer iteration the tasks of all views, in the order of the
            scene; the last one makes the result.
        skipped: Images without a task.
    """

    iterations: tuple[tuple[ViewTask, ...], ...]
    skipped: Skipped


def plan_refine(
    output: OutputWorkspace,
    scene: Scene,
    config: RefineConfig,
    network: tuple[NetworkConfig, str],
    manifest: Manifest,
) -> RefinePlan:
    """Decide what each image is refined from, and what it depends on.

    Each image and each depth map is read at most once, and not at all where its
    fingerprint is known.

    Args:
        output: Where the results go, and whose workspace it is. An explicit list of
            sources in its patch-match.cfg is what the second views are chosen from;
            else all views are.
        scene: The views.
        config: Options.
        network: The network's configuration, and the hash of its weights.
        manifest: Its fingerprints are asked.

    Raises:
        WorkspaceError: If patch-match.cfg is malformed, or a map is broken or of
            another image.
    """
    planner = _Planner(output, scene, config, network, manifest)
    tasks, skipped = planner.first_iteration()
    iterations = [tasks]
    num_iterations = config.outer_iterations if network[0].source_depth else 1
    for _ in range(num_iterations - 1):
        iterations.append(planner.next_iteration(iterations[-1]))
    return RefinePlan(
        iterations=(*iterations[:-1], planner.as_results(iterations[-1])),
        skipped=skipped,
    )


class _Planner:
    """What the tasks of one plan share."""

    def __init__(
        self,
        output: OutputWorkspace,
        scene: Scene,
        config: RefineConfig,
        network: tuple[NetworkConfig, str],
        manifest: Manifest,
    ) -> None:
        self.output = output
        self.workspace = output.source
        self.scene = scene
        self.config = config
        self.network_config, self.weights = network
        self.fingerprints = manifest.fingerprints
        self._first_keys: dict[int, str] = {}
        self.initial = [self._initial_map(index) for index in range(len(scene.views))]
        if config.fit_scale:
            self._fit_scales()

    def first_iteration(self) -> tuple[tuple[ViewTask, ...], Skipped]:
        """Each view compared with the initial maps of others."""
        listed = _listed_sources(self.workspace, self.scene)
        uses_sources = self.network_config.uses_sources
        num_sources = self.network_config.num_sources if uses_sources else 0
        num_maps = NUM_SOURCE_MAPS if self.network_config.source_depth else 0
        tasks, skipped = [], []
        for index, view in enumerate(self.scene.views):
            initial = self.initial[index]
            if initial is None:
                skipped.append((view.name, self._no_map(view.name)))
                continue
            if not initial.filled:
                reason = f"its {initial.kind} depth map has no depth at all"
                skipped.append((view.name, reason))
                continue
            choices: tuple[SourceChoice, ...] = ()
            if num_sources or num_maps:
                most = max(num_sources, num_maps)
                choices = choose_sources(self.scene, index, most, listed.get(view.name))
            if num_sources and not choices:
                skipped.append((view.name, "no other view overlaps with it"))
                continue
            others = tuple(choice.index for choice in choices[:num_maps])
            tasks.append(self._first_task(index, choices[:num_sources], others))
        return tuple(tasks), tuple(skipped)

    def next_iteration(self, before: Sequence[ViewTask]) -> tuple[ViewTask, ...]:
        """Each view compared with what the iteration before made of the others."""
        made = {task.index: task for task in before}

        def after(task: ViewTask) -> ViewTask:
            maps, keys = [], []
            for found in task.source_maps:
                other = made.get(found.view_index)
                maps.append(
                    MapRead(found.view_index, other.writes[0]) if other else found
                )
                keys.append(other.key if other else None)
            iteration = task.iteration + 1
            return dataclasses.replace(
                task,
                stage=_stage(iteration),
                key=key_of([self._first_keys[task.index], keys]),
                writes=self._earlier_map(task.name, iteration),
                iteration=iteration,
                source_maps=tuple(maps),
                reads=self._reads(task.index, task.sources, tuple(maps)),
            )

        return tuple(after(task) for task in before)

    def as_results(self, tasks: Sequence[ViewTask]) -> tuple[ViewTask, ...]:
        """The same tasks with the maps of the output as what they write."""
        paths = self.output.map_paths
        return tuple(
            dataclasses.replace(task, stage=STAGE, writes=paths(task.name))
            for task in tasks
        )

    def _first_task(
        self, index: int, sources: tuple[SourceChoice, ...], others: tuple[int, ...]
    ) -> ViewTask:
        name, initial = self.scene.views[index].name, self._initial(index)
        maps = tuple(
            MapRead(other, found.path, found.scale)
            for other in others
            if (found := self.initial[other]) is not None
        )
        return ViewTask(
            stage=_stage(0),
            name=name,
            key=self._first_key(index, sources, others),
            writes=self._earlier_map(name, 0),
            index=index,
            iteration=0,
            initial=initial,
            sources=sources,
            source_maps=maps,
            reads=self._reads(index, sources, maps),
        )

    def _first_key(
        self, index: int, sources: tuple[SourceChoice, ...], others: tuple[int, ...]
    ) -> str:
        views = self.scene.views
        seen = [views[index], *(views[choice.index] for choice in sources)]
        initial = self._initial(index)
        key = key_of(
            {
                "package": importlib.metadata.version("resdepth-colmap"),
                "options": self._options(),
                "views": [view_facts(view) for view in seen],
                "images": [self._image(view.name) for view in seen],
                "map": [initial.kind, *_content(initial)],
                "source_maps": [
                    [view_facts(views[other]), _content(found)]
                    for other in others
                    for found in [self.initial[other]]
                ],
                "masks": [
                    self._mask(view.name)
                    for view in (*seen, *(views[other] for other in others))
                ],
            }
        )
        self._first_keys[index] = key
        return key

    def _options(self) -> dict[str, Any]:
        """What decides the result besides the views."""
        return {
            "inner_iterations": self.config.inner_iterations,
            "update_gating": self.config.update_gating,
            "keep_empty": self.config.keep_empty,
            "tile_px": self.config.tile_px,
            "overlap_px": self.config.overlap_px,
            "weights": self.weights,
            "in_place": self.output.in_place,
        }

    def _reads(
        self,
        index: int,
        sources: tuple[SourceChoice, ...],
        maps: tuple[MapRead, ...],
    ) -> tuple[Path, ...]:
        names = [self.scene.views[choice.index].name for choice in sources]
        names.insert(0, self.scene.views[index].name)
        others = (self.scene.views[found.view_index].name for found in maps)
        masks = self.workspace.masks
        masked = dict.fromkeys((*names, *others))
        return (
            *(self.workspace.image_path(name) for name in names),
            self._initial(index).path,
            *(found.path for found in maps),
            *(path for name in masked for path in masks.files(name)),
        )

    def _initial(self, index: int) -> InitialMap:
        found = self.initial[index]
        assert found is not None  # noqa: S101 (a view with a task has a map)
        return found

    def _initial_map(self, index: int) -> InitialMap | None:
        view = self.scene.views[index]
        kinds = candidate_kinds(self.workspace, view.name, self.config.input)
        if not kinds:
            return None
        return choose_initial_map(
            self.workspace, view.name, view.camera, kinds, self.fingerprints
        )

    def _fit_scales(self) -> None:
        """Give each map that is off the scale of the model."""
        maps = {index: it for index, it in enumerate(self.initial) if it is not None}
        fits = initial_scales(self.workspace, self.scene, maps)
        for index, factor in fitted_scales(self.scene, fits).items():
            found = self.initial[index]
            if found is not None:
                self.initial[index] = dataclasses.replace(found, scale=factor)

    def _image(self, name: str) -> str | None:
        path = self.workspace.image_path(name)
        return self.fingerprints.of(path) if path.is_file() else None

    def _mask(self, name: str) -> list[str]:
        files = self.workspace.masks.files(name)
        return [self.fingerprints.of(path) for path in files]

    def _earlier_map(self, name: str, iteration: int) -> tuple[Path]:
        folder = self.output.path / ITERATIONS_FOLDER / str(iteration)
        return (folder / f"{safe_name(name)}.bin",)

    def _no_map(self, name: str) -> str:
        kinds = self.workspace.original_kinds(name)
        if not kinds:
            return "no depth map"
        return f"no {self.config.input} depth map (there is: {', '.join(kinds)})"


def _content(found: InitialMap | None) -> list[Any]:
    return [] if found is None else [found.digest, found.scale]


def _stage(iteration: int) -> str:
    return f"{STAGE}, outer iteration {iteration}"


def _listed_sources(workspace: Workspace, scene: Scene) -> dict[str, tuple[int, ...]]:
    """The sources that patch-match.cfg names for an image, where it names any."""
    path = workspace.stereo_path / "patch-match.cfg"
    if not path.is_file():
        return {}
    listed = {}
    for name, spec in read_sources(path).items():
        if spec.kind is not SourceKind.EXPLICIT:
            continue
        indices = tuple(scene.index(source) for source in spec.names)
        known = tuple(index for index in indices if index >= 0)
        if known:
            listed[name] = known
        else:
            logger.warning(
                "%s: the model has none of the sources of %s; choosing others.",
                path,
                name,
            )
    return listed
