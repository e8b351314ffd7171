"""Filtered, unfiltered and refined maps of workspaces, side by side."""

import dataclasses
import datetime
import logging
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

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
from resdepth_colmap.evaluation.compare.methods import (
    REFINED,
    MethodMaps,
    find_methods,
)
from resdepth_colmap.evaluation.compare.view_metrics import (
    MeasuredView,
    measure_views,
)
from resdepth_colmap.evaluation.datasets.scenes import distinct_names
from resdepth_colmap.evaluation.metrics.paired_difference import paired_difference
from resdepth_colmap.evaluation.metrics.view_maps import MEASURES, TileSums
from resdepth_colmap.evaluation.plain import finite_mean, plain
from resdepth_colmap.io.colmap.model import read_scene, read_sparse_points
from resdepth_colmap.io.colmap.output import OutputWorkspace
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


class GroundTruth(Protocol):
    """What clouds are scored against."""

    def score(self, points: npt.NDArray[np.float32], progress: Progress) -> CloudScores:
        """Score the points of a cloud, shape (N, 3)."""

    def to_mapping(self) -> dict[str, Any]:
        """Kind and size of the ground truth, ready for JSON."""


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
        paths: The workspaces; they stay as they are.
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
            results[name] = _compared(
                path, config, truth, in_place, progress or SilentProgress()
            )
        except ResDepthError as error:
            failed[name] = " ".join(str(error).split())
            if on_failure:
                on_failure(name, failed[name])
    return {
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "versions": versions(),
        "options": {**config.to_mapping(), "in_place": in_place},
        "measures": MEASURES,
        "workspaces": results,
        "failed": failed,
    }


def _compared(
    path: Path,
    config: CompareConfig,
    truth: GroundTruth | None,
    in_place: bool,
    progress: Progress,
) -> dict[str, Any]:
    """The comparison of the methods of a workspace, ready for JSON."""
    start = time.perf_counter()
    workspace = open_workspace(path)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    workspace = with_masks(workspace, scene, config.masks, after_run=True)
    output = OutputWorkspace(source=workspace, in_place=in_place)
    methods, notes = find_methods(output, scene, config)
    compared = tuple(file.view for file in methods[0].files)
    check_images(workspace, dataclasses.replace(scene, views=compared))
    reference = read_reference_cloud(workspace, scene, config.tolerances)
    points = read_sparse_points(workspace.sparse_path).about(scene.origin_in_world)
    images = ViewImages(workspace, IMAGE_CACHE_BYTES)
    known = {it.view.name: it.depth for it in (reference.maps if reference else ())}
    maps = MethodMaps(methods, config.fuse.min_confidence)
    views = measure_views(maps, scene, images, points, known, progress)
    clouds = fuse_methods(workspace, scene, methods, config.fuse, progress)
    truth = truth or reference
    return {
        "views": [view.name for view in compared],
        "methods": {method.name: method.to_mapping() for method in methods},
        "notes": [*notes, *_notes(scene, truth, reference, views)],
        "fusion": fusion_settings(config.fuse, len(compared)),
        "truth": None if truth is None else truth.to_mapping(),
        "clouds": {
            fuser: {name: _scored(it, truth, progress) for name, it in fused.items()}
            for fuser, fused in clouds.items()
        },
        **_measures(views, [method.name for method in methods]),
        "seconds": round(time.perf_counter() - start, 2),
    }


def _scored(
    cloud: MethodCloud, truth: GroundTruth | None, progress: Progress
) -> dict[str, Any]:
    scores = None
    if truth is not None and cloud.cloud is not None:
        scores = truth.score(cloud.cloud.points, progress).to_mapping()
    return {**cloud.to_mapping(), "scores": scores}


def _measures(
    views: Sequence[MeasuredView], methods: Sequence[str]
) -> dict[str, dict[str, Any]]:
    """Means over the views, differences of the refined maps from others, each view."""

    def sums(method: str, measure: str) -> list[TileSums]:
        """Of the views that have the measure; the same views for every method."""
        found = (view.sums[method] for view in views)
        return [it[measure] for it in found if measure in it]

    def means(method: str, measure: str) -> list[float]:
        return [it.mean for it in sums(method, measure)]

    def tile_means(method: str, measure: str) -> list[float]:
        return [mean for it in sums(method, measure) for mean in it.means]

    def paired(method: str, measure: str) -> dict[str, Any]:
        """Differences of the views, and of their tiles."""
        by_view = [means(name, measure) for name in (REFINED, method)]
        by_tile = [tile_means(name, measure) for name in (REFINED, method)]
        return {
            "views": paired_difference(*by_view).to_mapping(),
            "tiles": paired_difference(*by_tile, resample=False).to_mapping(),
        }

    return {
        "measures": {
            name: {it: plain(finite_mean(means(name, it))) for it in MEASURES}
            for name in methods
        },
        "paired": {
            f"{REFINED} - {name}": {it: paired(name, it) for it in MEASURES}
            for name in methods
            if name != REFINED
        },
        "per_view": {
            view.name: {
                method: {name: plain(it.mean) for name, it in by_measure.items()}
                for method, by_measure in view.sums.items()
            }
            for view in views
        },
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
    ratio = float(np.median(ratios)) if ratios else 1.0
    if not LIKELY_RATIOS[0] <= ratio <= LIKELY_RATIOS[1]:
        notes.append(
            f"the refined depth is {ratio:.3g} times the true depth (median): the "
            "ground truth is in other units or of another scene; scale it to the "
            "units of the model."
        )
        logger.warning(notes[-1])
    return notes
