"""The loop over the tasks: load, refine, store."""

import shutil
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.geometry.view_selection import SourceChoice
from resdepth_colmap.io.colmap.maps import write_depth_map
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.pipeline.manifest import Manifest
from resdepth_colmap.pipeline.map_scale import check_scales, initial_scales
from resdepth_colmap.pipeline.refine.load_view import load_view
from resdepth_colmap.pipeline.refine.plan import (
    ITERATIONS_FOLDER,
    STAGE,
    RefinePlan,
    ViewTask,
)
from resdepth_colmap.pipeline.refine.view import RefinedView, ViewInputs, refine_view
from resdepth_colmap.pipeline.view_images import ViewImages
from resdepth_colmap.progress import Progress
from resdepth_colmap.scene import Scene

IMAGE_CACHE_BYTES = 1 << 28  # the next view's sources are often those of this one


class RefineLoop:
    """Makes the results that are not fresh; holds what the tasks share."""

    def __init__(
        self,
        scene: Scene,
        config: RefineConfig,
        network: ResDepthNet,
        output: OutputWorkspace,
        manifest: Manifest,
    ) -> None:
        """Make nothing yet.

        Args:
            scene: The views.
            config: Options.
            network: Ready for use.
            output: Where the maps go.
            manifest: Knows what is fresh.
        """
        self._scene = scene
        self._config = config
        self._network = network
        self._output = output
        self._manifest = manifest
        self._images = ViewImages(output.source, IMAGE_CACHE_BYTES)

    def run(
        self, plan: RefinePlan, overwrite: bool, progress: Progress
    ) -> tuple[ViewTask, ...]:
        """Refine what is not fresh.

        Args:
            plan: The tasks.
            overwrite: Refine what is fresh, too.
            progress: Is told of each view.

        Returns:
            The tasks of the last iteration that were done now.

        Raises:
            WorkspaceError: If a file is broken, or a result cannot be written.
        """
        *_, last = plan.iterations
        pending = [t for t in last if overwrite or not self._manifest.is_fresh(t)]
        if pending and not self._config.fit_scale:
            maps = {task.index: task.initial for task in last}
            fits = initial_scales(
                self._output.source, self._scene, maps, self._images.whole_map
            )
            check_scales(self._scene, maps, fits)
        if overwrite:
            self._forget_earlier(plan)
        for iteration, needed in enumerate(_needed(plan, pending)):
            title = _title(iteration, len(plan.iterations))
            missing = [t for t in needed if not self._manifest.is_fresh(t)]
            tasks = pending if needed is pending else missing
            with progress.stage(title, len(tasks)) as advance:
                for task in tasks:
                    self._do(task)
                    advance(1)
        self._forget_earlier(plan)
        return tuple(pending)

    def _do(self, task: ViewTask) -> None:
        start = time.perf_counter()
        data = load_view(task, self._scene, self._images)
        result = refine_view(data, self._network, self._config)
        self._manifest.start(task)
        facts = {}
        if task.stage == STAGE:
            self._output.write_maps(
                task.name, result.depth, result.normals, result.confidence
            )
            facts = view_record(task, self._scene, data, result)
            facts["seconds"] = round(time.perf_counter() - start, 3)
        else:
            write_depth_map(task.writes[0], result.depth)
        self._manifest.finish(task, facts)

    def _forget_earlier(self, plan: RefinePlan) -> None:
        for tasks in plan.iterations[:-1]:
            for stage in {task.stage for task in tasks}:
                self._manifest.forget(stage)
        shutil.rmtree(self._output.path / ITERATIONS_FOLDER, ignore_errors=True)


def _needed(plan: RefinePlan, pending: list[ViewTask]) -> list[list[ViewTask]]:
    """Of each iteration the tasks whose maps the next one's tasks look at."""
    needed = [pending]
    for tasks in reversed(plan.iterations[:-1]):
        looked_at = {it.view_index for task in needed[0] for it in task.source_maps}
        needed.insert(0, [task for task in tasks if task.index in looked_at])
    return needed


def _title(iteration: int, num_iterations: int) -> str:
    return "Refining" if num_iterations == 1 else f"Refining, round {iteration + 1}"


def view_record(
    task: ViewTask, scene: Scene, data: ViewInputs, result: RefinedView
) -> dict[str, Any]:
    """What run.json says of a refined image."""
    depth, filled = data.depth, task.initial.filled
    if data.wanted is not None:
        depth = data.wanted_depth
        filled = float(np.mean(depth > 0))
    known = (depth > 0) & (result.depth > 0)
    before, after = depth[known], result.depth[known]
    change = float(np.median(np.abs(after - before) / before)) if known.any() else 0.0
    return {
        "input": task.initial.kind,
        "scale": task.initial.scale,
        "sources": _sources(task.sources, scene),
        "source_maps": [scene.views[it.view_index].name for it in task.source_maps],
        "filled_before": round(filled, 6),
        "filled_after": round(float(np.mean(result.depth > 0)), 6),
        "median_relative_change": round(change, 6),
    }


def _sources(choices: Sequence[SourceChoice], scene: Scene) -> list[dict[str, Any]]:
    return [
        {
            "name": scene.views[choice.index].name,
            "reason": choice.reason,
            "num_shared_points": choice.num_shared_points,
            "angle_deg": round(choice.angle_deg, 3),
            "baseline": round(choice.baseline, 6),
        }
        for choice in choices
    ]
