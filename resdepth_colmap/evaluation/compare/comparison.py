"""Filtered, unfiltered and refined maps of workspaces, side by side."""

import dataclasses
import datetime
import logging
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from resdepth_colmap.errors import ResDepthError
from resdepth_colmap.evaluation.cloud.reference_cloud import (
    ReferenceCloud,
    read_reference_cloud,
)
from resdepth_colmap.evaluation.cloud.scores import CloudScores
from resdepth_colmap.evaluation.compare.config import CompareConfig
from resdepth_colmap.evaluation.compare.method_clouds import (
    MethodCloud,
    fuse_methods,
    fusion_settings,
)
from resdepth_colmap.evaluation.compare.method_maps import MethodMaps
from resdepth_colmap.evaluation.compare.methods import find_methods
from resdepth_colmap.evaluation.compare.result import Comparison, GroundTruth
from resdepth_colmap.evaluation.compare.view_metrics import (
    MeasuredView,
    MetricInputs,
    measure_views,
)
from resdepth_colmap.evaluation.datasets.scenes import distinct_names
from resdepth_colmap.evaluation.metrics.measures import MEASURES
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.colmap.sparse_points import read_sparse_points
from resdepth_colmap.io.colmap.workspace import check_images, open_workspace
from resdepth_colmap.pipeline.masks import with_masks
from resdepth_colmap.pipeline.view_images import ViewImages
from resdepth_colmap.progress import Progress, SilentProgress
from resdepth_colmap.scene import Scene
from resdepth_colmap.versions import versions

IMAGE_CACHE_BYTES = 256 << 20
LIKELY_RATIOS = (0.5, 2.0)
"""Limits of the median of refined over true depth; outside, the units differ."""

NO_TRUTH = (
    "no ground truth (no ground_truth/, no --ground-truth): the clouds have no scores. "
    "The other measures are reference-free; none of them is an accuracy."
)
NO_POINTS = "no sparse points with tracks, so none are compared with the maps."

logger = logging.getLogger(__name__)


def compare_workspaces(
    paths: Sequence[Path],
    config: CompareConfig,
    truth: GroundTruth | None = None,
    *,
    in_place: bool = False,
    on_failure: Callable[[str, str], None] | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Compare the methods of each workspace; a broken workspace stops no other.

    Args:
        paths: The workspaces.
        config: Which maps, and how they are fused and scored.
        truth: What to score all clouds against; None = each one's `ground_truth/`.
        in_place: Whether the maps were refined in place.
        on_failure: Called with the name of a broken workspace and the reason.
        progress: Reports the progress.

    Returns:
        Plain values, ready for JSON: the results and the failures by name.
    """
    results, failed = {}, {}
    for name, path in zip(distinct_names(paths), paths, strict=True):
        try:
            comparison = compare_workspace(
                path, config, truth, in_place=in_place, progress=progress
            )
        except ResDepthError as error:
            failed[name] = " ".join(str(error).split())
            if on_failure:
                on_failure(name, failed[name])
        else:
            results[name] = comparison.to_mapping()
    return {
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "versions": versions(),
        "options": {**config.to_mapping(), "in_place": in_place},
        "measures": MEASURES,
        "workspaces": results,
        "failed": failed,
    }


def compare_workspace(
    path: Path,
    config: CompareConfig,
    truth: GroundTruth | None = None,
    *,
    in_place: bool = False,
    progress: Progress | None = None,
) -> Comparison:
    """Compare the methods of a workspace, which stays as it is.

    Args:
        path: The workspace, or a parent of it, with refined maps and initial ones.
        config: Which maps, and how they are fused and scored.
        truth: What to score the clouds against; None = `ground_truth/`, if present.
        in_place: Whether the maps were refined in place.
        progress: Reports the progress.

    Raises:
        WorkspaceError: If the workspace is broken, or has no refined or no initial map.
    """
    start, progress = time.perf_counter(), progress or SilentProgress()
    workspace = open_workspace(path)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    workspace = with_masks(workspace, scene, config.masks, after_run=True)
    output = OutputWorkspace(source=workspace, in_place=in_place)
    found = find_methods(output, scene, config)
    check_images(workspace, dataclasses.replace(scene, views=found.views))
    reference = read_reference_cloud(workspace, scene, config.tolerances)
    inputs = MetricInputs(
        scene=scene,
        images=ViewImages(workspace, IMAGE_CACHE_BYTES),
        points=read_sparse_points(workspace.sparse_path).about(scene.origin_in_world),
        reference=reference,
    )
    maps = MethodMaps(found.methods, config.fuse.min_confidence)
    views = measure_views(maps, inputs, progress)
    clouds = fuse_methods(workspace, scene, found.methods, config.fuse, progress)
    truth = truth or reference
    return Comparison(
        found=found,
        clouds=clouds,
        scores=_scored(clouds, truth, progress),
        settings=dict(fusion_settings(config.fuse, len(found.views))),
        truth=truth,
        views=tuple(views),
        notes=(*found.notes, *_notes(scene, truth, reference, views)),
        seconds=time.perf_counter() - start,
    )


def _scored(
    clouds: dict[str, dict[str, MethodCloud]],
    truth: GroundTruth | None,
    progress: Progress,
) -> dict[str, dict[str, CloudScores]]:
    if truth is None:
        return {}
    return {
        fuser: {
            method: truth.score(it.cloud.points, progress)
            for method, it in methods.items()
            if it.cloud is not None
        }
        for fuser, methods in clouds.items()
    }


def _notes(
    scene: Scene,
    truth: GroundTruth | None,
    reference: ReferenceCloud | None,
    views: Sequence[MeasuredView],
) -> list[str]:
    notes = []
    if truth is None:
        notes.append(NO_TRUTH)
    elif reference is not None and len(reference.maps) < len(scene.views):
        notes.append(
            f"ground truth of {len(reference.maps)} of {len(scene.views)} views: "
            "points outside of these views are not scored."
        )
    if scene.num_shared_points is None:
        notes.append(NO_POINTS)
    ratios = [view.depth_ratio for view in views if view.depth_ratio is not None]
    if ratios:
        ratio = float(np.median(ratios))
        if not LIKELY_RATIOS[0] <= ratio <= LIKELY_RATIOS[1]:
            notes.append(
                f"the refined depth is {ratio:.3g} times the true depth (median): the "
                "ground truth is in other units or of another scene; scale it to the "
                "units of the model."
            )
            logger.warning(notes[-1])
    return notes
