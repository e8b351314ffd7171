"""Stage "refine": a loop over the views of a workspace round `refine_view`."""

import collections
import dataclasses
import logging
import time
from typing import Any

import numpy as np

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.geometry.view_selection import SourceChoice
from resdepth_colmap.io.model import read_scene
from resdepth_colmap.io.output import OutputWorkspace, read_record, write_record
from resdepth_colmap.io.workspace import Workspace
from resdepth_colmap.network.device import resolve_device
from resdepth_colmap.network.inference import for_inference
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.network.weights import load_weights, weights_hash
from resdepth_colmap.pipeline.initial_map import (
    InitialMap,
    candidate_kinds,
    check_maps_exist,
    choose_initial_map,
)
from resdepth_colmap.pipeline.progress import Progress, SilentProgress
from resdepth_colmap.pipeline.refine import RefinedView, refine_view
from resdepth_colmap.pipeline.refine_plan import Skipped, ViewPlan, plan_views
from resdepth_colmap.pipeline.source_maps import NUM_SOURCE_MAPS
from resdepth_colmap.pipeline.view_images import ViewImages
from resdepth_colmap.pipeline.view_inputs import view_inputs
from resdepth_colmap.scene import DepthMap, Scene

logger = logging.getLogger(__name__)

MOST_NAMES_SHOWN = 3
IMAGE_CACHE_BYTES = 1 << 28  # the next view's sources are often those of this one

RECORD_KEY = "images"
"""Where run.json holds what is known of each refined image."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class RefineReport:
    """What the stage did.

    Attributes:
        output: Where the maps are.
        refined: Names of the images refined now.
        kept: Names of the images that were finished and unchanged.
        skipped: Name and reason of each image that was not refined.
        images: What is known of each refined or kept image, by name.
        facts: Weights, network and device.
    """

    output: OutputWorkspace
    refined: tuple[str, ...]
    kept: tuple[str, ...]
    skipped: Skipped
    images: dict[str, dict[str, Any]]
    facts: dict[str, Any]


def refine_workspace(
    workspace: Workspace,
    config: RefineConfig | None = None,
    *,
    scene: Scene | None = None,
    in_place: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> RefineReport:
    """Refine the depth maps of a workspace and write them where COLMAP finds them.

    The record of each image is written as soon as its maps are: after an interruption
    the next call goes on, and it leaves alone what is finished and unchanged.

    Args:
        workspace: The workspace, with depth maps.
        config: Options; None = the defaults.
        scene: Its model, if it is read already.
        in_place: Replace the geometric maps of the workspace (originals are kept)
            instead of writing to `resdepth/`.
        overwrite: Refine again what is finished and unchanged.
        progress: Is told of each image.

    Raises:
        WorkspaceError: If no image has a map to start from, a file is broken, or the
            result cannot be written.
        WeightsError: If the weights cannot be read.
        BackendUnavailableError: If this machine has no such device.
    """
    config, progress = config or RefineConfig(), progress or SilentProgress()
    scene = scene or read_scene(
        workspace.sparse_path, workspace.images_path, workspace.path
    )
    check_maps_exist(workspace, scene, config.input)
    device = resolve_device(config.device)
    network = for_inference(load_weights(config.weights, device))
    _check_num_views(workspace, scene, network.config)
    facts = {
        "weights_sha256": weights_hash(config.weights),
        "network": network.config.to_mapping(),
        "device": str(device),
    }
    options = {
        "passes": config.passes,
        "keep_confirmed": config.keep_confirmed,
        "tile_px": config.tile_px,
        "overlap_px": config.overlap_px,
        "weights": facts["weights_sha256"],
        "in_place": in_place,
    }
    num_sources = network.config.num_sources if network.config.uses_sources else 0
    num_maps = NUM_SOURCE_MAPS if network.config.source_depth else 0
    plans, skipped = plan_views(
        workspace, scene, config.input, (num_sources, num_maps), options
    )
    output = OutputWorkspace(source=workspace, in_place=in_place)
    output.prepare([view.name for view in scene.views])
    loop = _Loop(workspace, scene, config, network, output)
    refined, kept, empty = loop.run(plans, overwrite, progress)
    _say_skipped((*skipped, *empty))
    _check_any(workspace, refined + kept, (*skipped, *empty))
    return RefineReport(
        output=output,
        refined=tuple(refined),
        kept=tuple(kept),
        skipped=(*skipped, *empty),
        images=loop.images,
        facts=facts,
    )


class _Loop:
    """Refines the images one by one; holds what they share."""

    def __init__(
        self,
        workspace: Workspace,
        scene: Scene,
        config: RefineConfig,
        network: ResDepthNet,
        output: OutputWorkspace,
    ) -> None:
        self.workspace = workspace
        self.scene = scene
        self.config = config
        self.network = network
        self.output = output
        self.view_images = ViewImages(workspace, IMAGE_CACHE_BYTES)
        self.record = read_record(output.record_path)
        self.images: dict[str, dict[str, Any]] = {}

    def run(
        self, plans: tuple[ViewPlan, ...], overwrite: bool, progress: Progress
    ) -> tuple[list[str], list[str], list[tuple[str, str]]]:
        """Refined, kept, and those that turned out to have nothing to refine."""
        known = dict(self.record.get(RECORD_KEY, {}))
        pending = []
        for plan in plans:
            name = self.scene.views[plan.index].name
            if not overwrite and self._is_finished(name, plan, known):
                self.images[name] = known[name]
            else:
                pending.append(plan)
        kept, refined, empty = list(self.images), [], []
        # A record must never vouch for maps that are about to be replaced.
        self._save()
        with progress.stage("Refining", len(pending)) as advance:
            for plan in pending:
                name = self.scene.views[plan.index].name
                reason = self._refine(plan)
                if reason:
                    empty.append((name, reason))
                else:
                    refined.append(name)
                advance(1)
        if self.images:
            self.output.write_cfgs(self._in_order())
        return refined, kept, empty

    def _is_finished(self, name: str, plan: ViewPlan, known: dict[str, Any]) -> bool:
        record = known.get(name)
        return (
            isinstance(record, dict)
            and record.get("fingerprint") == plan.fingerprint
            and self.output.is_written(name)
        )

    def _refine(self, plan: ViewPlan) -> str:
        """Refine one image and record it; returns why not, or ""."""
        start = time.perf_counter()
        view = self.scene.views[plan.index]
        initial = choose_initial_map(self.workspace, view.name, view.camera, plan.kinds)
        if not initial.filled:
            return f"its {initial.kind} depth map has no depth at all"
        sources = [choice.index for choice in plan.sources]
        inputs = view_inputs(
            self.scene,
            plan.index,
            sources,
            initial.depth,
            self.view_images,
            self._maps_of_others(plan),
        )
        result = refine_view(inputs, self.network, self.config)
        self.output.write_maps(
            view.name, result.depth, result.normals, result.confidence
        )
        seconds = time.perf_counter() - start
        self.images[view.name] = _image_record(plan, self.scene, initial, result)
        self.images[view.name]["seconds"] = round(seconds, 3)
        self._save()
        return ""

    def _maps_of_others(self, plan: ViewPlan) -> dict[int, DepthMap]:
        """The maps that other views start from themselves."""
        maps = {}
        for index in plan.map_sources:
            view = self.scene.views[index]
            kinds = candidate_kinds(self.workspace, view.name, self.config.input)
            if kinds:
                found = choose_initial_map(
                    self.workspace, view.name, view.camera, kinds
                )
                maps[index] = found.depth
        return maps

    def _save(self) -> None:
        self.record = {**self.record, RECORD_KEY: self.images}
        write_record(self.output.record_path, self.record)

    def _in_order(self) -> list[str]:
        return [view.name for view in self.scene.views if view.name in self.images]


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
        "fingerprint": plan.fingerprint,
    }


def _choice_facts(choice: SourceChoice) -> dict[str, Any]:
    return {
        "reason": choice.reason,
        "num_shared_points": choice.num_shared_points,
        "angle_deg": round(choice.angle_deg, 3),
        "baseline": round(choice.baseline, 6),
    }


def _check_num_views(workspace: Workspace, scene: Scene, config: NetworkConfig) -> None:
    if config.uses_sources and len(scene.views) < 2:
        raise WorkspaceError(
            f"{workspace.sparse_path}: the model has a single image, but refinement "
            "compares each image with a second one; add images of the same scene."
        )


def _say_skipped(skipped: Skipped) -> None:
    names_by_reason = collections.defaultdict(list)
    for name, reason in skipped:
        names_by_reason[reason].append(name)
    for reason, names in names_by_reason.items():
        shown = ", ".join(names[:MOST_NAMES_SHOWN])
        more = len(names) - MOST_NAMES_SHOWN
        logger.warning(
            "%d skipped, %s: %s%s (run.json has them all).",
            len(names),
            reason,
            shown,
            f" and {more} more" if more > 0 else "",
        )


def _check_any(workspace: Workspace, done: list[str], skipped: Skipped) -> None:
    if not done:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in skipped[:3])
        raise WorkspaceError(f"{workspace.path}: no image could be refined: {reasons}.")
