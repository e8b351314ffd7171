"""The measures of the compared views of a workspace."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from resdepth_colmap.evaluation.compare.methods import REFINED, MethodMaps
from resdepth_colmap.evaluation.metrics.reference_free import (
    Sums,
    against_truth,
    agreement,
    coverage,
    merged,
    sparse_points,
)
from resdepth_colmap.evaluation.metrics.rewarped_photos import photo_correlation
from resdepth_colmap.geometry.resize import nearest_resized
from resdepth_colmap.geometry.view_selection import choose_sources
from resdepth_colmap.io.colmap.model import SparsePoints
from resdepth_colmap.pipeline.refine.load_view import view_inputs
from resdepth_colmap.pipeline.view_images import ViewImages
from resdepth_colmap.progress import Progress
from resdepth_colmap.scene import DepthMap, Scene

NUM_NEIGHBOURS = 4
"""Number of neighbours that a map is compared with; the best of its sources."""

NUM_PHOTOS = 2
"""Number of neighbours that an image is compared with."""


class MeasuredView(NamedTuple):
    """The measures of one view.

    Attributes:
        name: Image name.
        sums: By method, then by measure.
        depth_ratio: Median of refined over true depth; None without ground truth.
    """

    name: str
    sums: dict[str, Sums]
    depth_ratio: float | None = None


def measure_views(
    maps: MethodMaps,
    scene: Scene,
    images: ViewImages,
    points: SparsePoints,
    truth: Mapping[str, DepthMap],
    progress: Progress,
) -> list[MeasuredView]:
    """Measure each view; WorkspaceError if a map or image cannot be read.

    Args:
        maps: The compared views.
        scene: All views of the workspace.
        images: Loads their images.
        points: The sparse points, maybe none.
        truth: True depth of some or all views, by name, shape (H, W); 0 = unknown.
        progress: Reports the progress.
    """
    compared = [scene.index(maps[index].view.name) for index in range(len(maps))]
    measured = []
    with progress.stage("Measuring", len(maps)) as advance:
        for own, index in zip(maps, compared, strict=True):
            choices = choose_sources(scene, index, NUM_NEIGHBOURS, compared)
            neighbours = [choice.index for choice in choices]
            parts, ratio = [coverage(own), sparse_points(own, points)], None
            if own.view.name in truth:
                known = nearest_resized(truth[own.view.name], own.shape[::-1])
                parts.append(against_truth(own, known))
                ratio = _ratio(own.depths[REFINED], known)
            if neighbours:
                others = [maps[compared.index(it)] for it in neighbours]
                parts.append(agreement(own, others))
                depth, photos = own.depths[REFINED], neighbours[:NUM_PHOTOS]
                inputs = view_inputs(scene, index, photos, depth, images)
                parts.append(photo_correlation(own, inputs))
            measured.append(MeasuredView(own.view.name, merged(parts), ratio))
            advance(1)
    return measured


def _ratio(depth: DepthMap, truth: DepthMap) -> float | None:
    both = (depth > 0) & (truth > 0)
    return float(np.median(depth[both] / truth[both])) if both.any() else None
