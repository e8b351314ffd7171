"""Filtered, unfiltered and refined maps of a workspace, side by side."""

import dataclasses
import logging
import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

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
from resdepth_colmap.evaluation.compare.methods import (
    REFINED,
    FoundMethods,
    Method,
    find_methods,
)
from resdepth_colmap.evaluation.compare.view_metrics import (
    MeasuredView,
    Witnesses,
    measure_views,
)
from resdepth_colmap.evaluation.metrics.measures import MEASURES
from resdepth_colmap.evaluation.metrics.paired_difference import paired_difference
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.colmap.sparse_points import read_sparse_points
from resdepth_colmap.io.colmap.workspace import check_images, open_workspace
from resdepth_colmap.pipeline.view_images import ViewImages
from resdepth_colmap.progress import Progress, SilentProgress
from resdepth_colmap.scene import Scene

IMAGE_CACHE_BYTES = 256 << 20
LIKELY_RATIOS = (0.5, 2.0)
"""Of refined over true depth, the median; beyond, the units differ."""

NO_TRUTH = (
    "no truth (no ground_truth/, no --ground-truth): the clouds have no scores, and "
    "what is left are witnesses, none of which is an accuracy."
)
NO_POINTS = "no sparse points with tracks: they cannot be witnesses."

logger = logging.getLogger(__name__)


class CloudTruth(Protocol):
    """What clouds are scored against."""

    def score(self, points: Any, progress: Progress) -> CloudScores:
        """Score the points of a cloud, shape (N, 3)."""

    def to_mapping(self) -> dict[str, Any]:
        """What is true, as plain values, ready for JSON."""


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """What was found out about the arms of a workspace.

    Attributes:
        found: The arms.
        clouds: By fuser, then by arm.
        scores: Likewise; without truth, there are none.
        settings: What each fuser was told.
        truth: What the clouds were scored against.
        views: The measures of each view.
        notes: What is missing, and what looks wrong.
        seconds: Wall time of all.
    """

    found: FoundMethods
    clouds: dict[str, dict[str, MethodCloud]]
    scores: dict[str, dict[str, CloudScores]]
    settings: dict[str, dict[str, Any]]
    truth: CloudTruth | None
    views: tuple[MeasuredView, ...]
    notes: tuple[str, ...]
    seconds: float

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, ready for JSON; no path of this machine among them."""
        methods = self.found.methods
        return {
            "views": [view.name for view in self.found.views],
            "methods": {
                method.name: {
                    "kind": method.kind,
                    "normals": "own"
                    if method.own_normals
                    else "computed from the depth",
                }
                for method in methods
            },
            "notes": list(self.notes),
            "fusion": self.settings,
            "truth": None if self.truth is None else self.truth.to_mapping(),
            "clouds": {
                fuser: {
                    method: {
                        **cloud.to_mapping(),
                        "scores": self._scores(fuser, method),
                    }
                    for method, cloud in clouds.items()
                }
                for fuser, clouds in self.clouds.items()
            },
            "measures": {method.name: self._means(method) for method in methods},
            "paired": {
                f"{REFINED} - {method.name}": self._paired(method)
                for method in methods
                if method.name != REFINED
            },
            "per_view": {
                view.name: {
                    method: {name: _plain(it.mean) for name, it in sums.items()}
                    for method, sums in view.sums.items()
                }
                for view in self.views
            },
            "seconds": round(self.seconds, 2),
        }

    def _scores(self, fuser: str, method: str) -> dict[str, Any] | None:
        scores = self.scores.get(fuser, {}).get(method)
        return None if scores is None else scores.to_mapping()

    def _values(self, method: str, measure: str) -> list[float]:
        """The measure of each view; NaN where it has none."""
        return [
            view.sums[method][measure].mean
            if measure in view.sums.get(method, {})
            else math.nan
            for view in self.views
        ]

    def _tiles(self, method: str, measure: str) -> Any:
        tiles = [
            view.sums[method][measure].means
            for view in self.views
            if measure in view.sums.get(method, {})
        ]
        return np.concatenate(tiles) if tiles else np.zeros(0)

    def _means(self, method: Method) -> dict[str, float | None]:
        means = {}
        for measure in MEASURES:
            values = [
                it for it in self._values(method.name, measure) if math.isfinite(it)
            ]
            means[measure] = _plain(sum(values) / len(values)) if values else None
        return means

    def _paired(self, method: Method) -> dict[str, Any]:
        """By measure the differences of the views, and of their tiles."""
        paired = {}
        for measure in MEASURES:
            values = (self._values(it, measure) for it in (REFINED, method.name))
            tiles = (self._tiles(it, measure) for it in (REFINED, method.name))
            paired[measure] = {
                "views": paired_difference(*values).to_mapping(),
                "tiles": paired_difference(*tiles, resample=False).to_mapping(),
            }
        return paired


def compare_workspace(
    path: Path,
    config: CompareConfig,
    truth: CloudTruth | None = None,
    *,
    in_place: bool = False,
    progress: Progress | None = None,
) -> Comparison:
    """Compare the arms of a workspace; nothing is written into it.

    Args:
        path: The workspace, or a parent of it, with refined maps and initial ones.
        config: Which maps, and how they are fused and scored.
        truth: What to score the clouds against; None = `ground_truth/`, if it is there.
        in_place: Whether the maps were refined in place.
        progress: Who listens.

    Raises:
        WorkspaceError: If the workspace is broken, or has no refined or no initial map.
    """
    start, progress = time.perf_counter(), progress or SilentProgress()
    workspace = open_workspace(path)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    output = OutputWorkspace(source=workspace, in_place=in_place)
    found = find_methods(output, scene, config)
    _check_images(output, scene, found)
    depth_truth = read_reference_cloud(workspace, scene, config.tolerances)
    witnesses = Witnesses(
        scene=scene,
        images=ViewImages(workspace, IMAGE_CACHE_BYTES),
        points=read_sparse_points(workspace.sparse_path),
        truth=depth_truth,
    )
    maps = MethodMaps(found.methods, config.fuse.min_confidence)
    views = measure_views(maps, witnesses, progress)
    clouds = fuse_methods(workspace, scene, found.methods, config.fuse, progress)
    truth = truth or depth_truth
    return Comparison(
        found=found,
        clouds=clouds,
        scores=_scored(clouds, truth, progress),
        settings=dict(fusion_settings(config.fuse, len(found.views))),
        truth=truth,
        views=tuple(views),
        notes=(*found.notes, *_notes(scene, truth, depth_truth, views)),
        seconds=time.perf_counter() - start,
    )


def _check_images(output: OutputWorkspace, scene: Scene, found: FoundMethods) -> None:
    """The photos of the compared views have to be there; others may be missing."""
    compared = dataclasses.replace(scene, views=found.views)
    check_images(output.source, compared)


def _scored(
    clouds: dict[str, dict[str, MethodCloud]],
    truth: CloudTruth | None,
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
    truth: CloudTruth | None,
    depth_truth: ReferenceCloud | None,
    views: Sequence[MeasuredView],
) -> list[str]:
    notes = []
    if truth is None:
        notes.append(NO_TRUTH)
    elif depth_truth is not None and len(depth_truth.maps) < len(scene.views):
        notes.append(
            f"true depth of {len(depth_truth.maps)} of {len(scene.views)} views: points"
            " that none of them looks at are not scored."
        )
    if scene.num_shared_points is None:
        notes.append(NO_POINTS)
    ratios = [view.depth_ratio for view in views if view.depth_ratio is not None]
    if ratios:
        ratio = float(np.median(ratios))
        if not LIKELY_RATIOS[0] <= ratio <= LIKELY_RATIOS[1]:
            notes.append(
                f"the refined depth is {ratio:.3g} times the true one (median): the "
                "truth is in other units or of another scene; scale it to those of the "
                "model."
            )
            logger.warning(notes[-1])
    return notes


def _plain(value: float) -> float | None:
    return None if math.isnan(value) else round(value, 6)
