"""The measures of the compared views of a workspace."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from resdepth_colmap.evaluation.cloud.reference_cloud import ReferenceCloud
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
from resdepth_colmap.evaluation.metrics.view_maps import ViewMaps
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


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredView:
    """The measures of one view.

    Attributes:
        name: Image name.
        sums: By method, then by measure.
        depth_ratio: Median of refined over true depth; None without ground truth.
    """

    name: str
    sums: dict[str, Sums]
    depth_ratio: float | None = None


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class MetricInputs:
    """What the maps are compared with.

    Attributes:
        scene: All views of the workspace.
        images: Loads the images.
        points: The sparse points, maybe none.
        reference: Ground truth; None without.
    """

    scene: Scene
    images: ViewImages
    points: SparsePoints
    reference: ReferenceCloud | None = None

    def true_depth(self, maps: ViewMaps) -> DepthMap | None:
        """The true depth of a view at the size of its maps; None if unknown."""
        for truth in () if self.reference is None else self.reference.maps:
            if truth.view.name == maps.view.name:
                return nearest_resized(truth.depth, maps.shape[::-1])
        return None


def measure_views(
    maps: MethodMaps, inputs: MetricInputs, progress: Progress
) -> list[MeasuredView]:
    """Measure each view; WorkspaceError if a map or image cannot be read."""
    scene = inputs.scene
    compared = [scene.index(maps[index].view.name) for index in range(len(maps))]
    measured = []
    with progress.stage("Measuring", len(maps)) as advance:
        for index, view_index in enumerate(compared):
            choices = choose_sources(scene, view_index, NUM_NEIGHBOURS, compared)
            neighbours = [compared.index(choice.index) for choice in choices]
            measured.append(_measured(maps, index, neighbours, inputs))
            advance(1)
    return measured


def _measured(
    all_maps: MethodMaps, index: int, neighbours: Sequence[int], inputs: MetricInputs
) -> MeasuredView:
    maps = all_maps[index]
    scene = inputs.scene
    parts = [coverage(maps), sparse_points(maps, inputs.points)]
    ratio = None
    truth = inputs.true_depth(maps)
    if truth is not None:
        parts.append(against_truth(maps, truth))
        ratio = _ratio(maps.depths[REFINED], truth)
    if neighbours:
        others = [all_maps[it] for it in neighbours]
        parts.append(agreement(maps, others))
        images = view_inputs(
            scene,
            scene.index(maps.view.name),
            [scene.index(other.view.name) for other in others[:NUM_PHOTOS]],
            maps.depths[REFINED],
            inputs.images,
        )
        parts.append(photo_correlation(maps, images))
    return MeasuredView(name=maps.view.name, sums=merged(parts), depth_ratio=ratio)


def _ratio(depth: DepthMap, truth: DepthMap) -> float | None:
    both = (depth > 0) & (truth > 0)
    return float(np.median(depth[both] / truth[both])) if both.any() else None
