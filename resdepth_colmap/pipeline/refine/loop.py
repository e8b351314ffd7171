"""The loop over the views: rounds, and each view refined, written and recorded."""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.geometry.view_selection import SourceChoice
from resdepth_colmap.io.colmap.output import OutputWorkspace, read_record, write_record
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.pipeline.initial_map import (
    InitialMap,
    candidate_kinds,
    choose_initial_map,
)
from resdepth_colmap.pipeline.refine.load_view import view_inputs
from resdepth_colmap.pipeline.refine.plan import ViewPlan
from resdepth_colmap.pipeline.refine.round_maps import EarlierMaps
from resdepth_colmap.pipeline.refine.view import RefinedView, refine_view
from resdepth_colmap.pipeline.view_images import ViewImages
from resdepth_colmap.progress import Progress
from resdepth_colmap.scene import DepthMap, Scene

IMAGE_CACHE_BYTES = 1 << 28  # the next view's sources are often those of this one

RECORD_KEY = "images"
"""Where run.json holds what is known of each refined image."""

EARLIER_FOLDER = "earlier_rounds"
"""In the output: the maps of earlier rounds, as long as the last one is not done."""


class RefineLoop:
    """Refines the images one by one; holds what they share.

    Attributes:
        images: What is known of each refined or kept image, by name.
    """

    def __init__(
        self,
        workspace: Workspace,
        scene: Scene,
        config: RefineConfig,
        network: ResDepthNet,
        output: OutputWorkspace,
    ) -> None:
        """Read the record of what is finished.

        Args:
            workspace: Where images and initial maps lie.
            scene: Its model.
            config: Options.
            network: Ready for use.
            output: Where the maps go.

        Raises:
            WorkspaceError: If the record is broken.
        """
        self.images: dict[str, dict[str, Any]] = {}
        self._workspace = workspace
        self._scene = scene
        self._config = config
        self._network = network
        self._output = output
        self._view_images = ViewImages(workspace, IMAGE_CACHE_BYTES)
        self._earlier = EarlierMaps(folder=output.path / EARLIER_FOLDER)
        self._record = read_record(output.record_path)
        self._plans: dict[int, ViewPlan] = {}

    def run(
        self, plans: tuple[ViewPlan, ...], overwrite: bool, progress: Progress
    ) -> tuple[list[str], list[str], list[tuple[str, str]]]:
        """Refine what is not finished.

        Args:
            plans: Of all images that can be refined.
            overwrite: Refine what is finished, too.
            progress: Is told of each image.

        Returns:
            Names of the images that were refined, of those that were kept, and of those
            that turned out to have nothing to refine, each with the reason.

        Raises:
            WorkspaceError: If a file is broken, or the result cannot be written.
        """
        self._plans = {plan.index: plan for plan in plans}
        known = dict(self._record.get(RECORD_KEY, {}))
        pending = []
        for plan in plans:
            name = self._name(plan)
            if not overwrite and self._is_finished(name, plan, known):
                self.images[name] = known[name]
            else:
                pending.append(plan)
        kept, refined, empty = list(self.images), [], []
        # A record must never vouch for maps that are about to be replaced.
        self._save()
        if overwrite:
            self._earlier.forget()
        for number, wanted in enumerate(self._earlier_rounds(pending)):
            self._refine_earlier(wanted, number, progress)
        with progress.stage(_stage(pending), len(pending)) as advance:
            for plan in pending:
                reason = self._refine(plan)
                if reason:
                    empty.append((self._name(plan), reason))
                else:
                    refined.append(self._name(plan))
                advance(1)
        self._earlier.forget()
        if self.images:
            self._output.write_cfgs(self._in_order())
        return refined, kept, empty

    def _is_finished(self, name: str, plan: ViewPlan, known: dict[str, Any]) -> bool:
        record = known.get(name)
        return (
            isinstance(record, dict)
            and record.get("fingerprint") == plan.fingerprints[-1]
            and self._output.is_written(name)
        )

    def _earlier_rounds(self, pending: Sequence[ViewPlan]) -> list[list[ViewPlan]]:
        """Of each round before the last one, the first first, what the next needs."""
        rounds: list[list[ViewPlan]] = []
        needed = list(pending)
        for _ in range(len(pending[0].fingerprints) - 1 if pending else 0):
            others = {index for plan in needed for index in plan.map_sources}
            needed = [self._plans[i] for i in sorted(others & self._plans.keys())]
            rounds.insert(0, needed)
        return rounds

    def _refine_earlier(
        self, plans: Sequence[ViewPlan], number: int, progress: Progress
    ) -> None:
        """Make the maps of a round that the next one needs, but for those there are."""
        missing = [
            plan
            for plan in plans
            if not self._earlier.has(self._name(plan), plan.fingerprints[number])
        ]
        with progress.stage(_stage(plans, number), len(missing)) as advance:
            for plan in missing:
                initial = self._initial_map(plan)
                if initial.filled:
                    depth = self._refined(plan, initial, number).depth
                    fingerprint = plan.fingerprints[number]
                    self._earlier.write(self._name(plan), fingerprint, depth)
                advance(1)

    def _refine(self, plan: ViewPlan) -> str:
        """Refine one image in the last round, record it; returns why not, or ""."""
        start = time.perf_counter()
        initial, name = self._initial_map(plan), self._name(plan)
        if not initial.filled:
            return f"its {initial.kind} depth map has no depth at all"
        result = self._refined(plan, initial, len(plan.fingerprints) - 1)
        self._output.write_maps(name, result.depth, result.normals, result.confidence)
        seconds = time.perf_counter() - start
        self.images[name] = _image_record(plan, self._scene, initial, result)
        self.images[name]["seconds"] = round(seconds, 3)
        self._save()
        return ""

    def _refined(self, plan: ViewPlan, initial: InitialMap, number: int) -> RefinedView:
        inputs = view_inputs(
            self._scene,
            plan.index,
            [choice.index for choice in plan.sources],
            initial.depth,
            self._view_images,
            self._maps_of_others(plan, number),
        )
        return refine_view(inputs, self._network, self._config)

    def _maps_of_others(self, plan: ViewPlan, number: int) -> dict[int, DepthMap]:
        """What the round before made of the others' maps; else the initial ones."""
        maps = {}
        for index in plan.map_sources:
            depth = self._earlier_map(index, number - 1) if number > 0 else None
            depth = self._initial_depth(index) if depth is None else depth
            if depth is not None:
                maps[index] = depth
        return maps

    def _earlier_map(self, index: int, number: int) -> DepthMap | None:
        plan = self._plans.get(index)
        if plan is None:
            return None
        return self._earlier.read(self._name(plan), plan.fingerprints[number])

    def _initial_depth(self, index: int) -> DepthMap | None:
        view = self._scene.views[index]
        kinds = candidate_kinds(self._workspace, view.name, self._config.input)
        if not kinds:
            return None
        return choose_initial_map(self._workspace, view.name, view.camera, kinds).depth

    def _initial_map(self, plan: ViewPlan) -> InitialMap:
        view = self._scene.views[plan.index]
        return choose_initial_map(self._workspace, view.name, view.camera, plan.kinds)

    def _name(self, plan: ViewPlan) -> str:
        return self._scene.views[plan.index].name

    def _save(self) -> None:
        self._record = {**self._record, RECORD_KEY: self.images}
        write_record(self._output.record_path, self._record)

    def _in_order(self) -> list[str]:
        return [view.name for view in self._scene.views if view.name in self.images]


def _stage(plans: Sequence[ViewPlan], number: int = -1) -> str:
    """What a round is called; the last one if no number says which."""
    count = len(plans[0].fingerprints) if plans else 1
    return "Refining" if count == 1 else f"Refining, round {number % count + 1}"


def _image_record(
    plan: ViewPlan, scene: Scene, initial: InitialMap, result: RefinedView
) -> dict[str, Any]:
    """What run.json says of an image."""
    known = (initial.depth > 0) & (result.depth > 0)
    before, after = initial.depth[known], result.depth[known]
    change = float(np.median(np.abs(after - before) / before)) if known.any() else 0.0
    return {
        "input": initial.kind,
        "sources": [
            {"name": scene.views[choice.index].name, **_choice_facts(choice)}
            for choice in plan.sources
        ],
        "source_maps": [scene.views[index].name for index in plan.map_sources],
        "filled_before": round(initial.filled, 6),
        "filled_after": round(float(np.mean(result.depth > 0)), 6),
        "median_relative_change": round(change, 6),
        "fingerprint": plan.fingerprints[-1],
    }


def _choice_facts(choice: SourceChoice) -> dict[str, Any]:
    return {
        "reason": choice.reason,
        "num_shared_points": choice.num_shared_points,
        "angle_deg": round(choice.angle_deg, 3),
        "baseline": round(choice.baseline, 6),
    }
