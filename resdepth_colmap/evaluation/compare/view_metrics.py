"""All measures of all compared views of a workspace."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from resdepth_colmap.evaluation.cloud.reference_cloud import ReferenceCloud
from resdepth_colmap.evaluation.compare.method_maps import MethodMaps, ViewMaps
from resdepth_colmap.evaluation.compare.methods import REFINED
from resdepth_colmap.evaluation.metrics.reference_free import (
    Sums,
    against_truth,
    agreement,
    coverage,
    merged,
    sparse_points,
)
from resdepth_colmap.evaluation.metrics.rewarped_photos import photo_agreement
from resdepth_colmap.geometry.resize import nearest_resized
from resdepth_colmap.geometry.view_selection import choose_sources
from resdepth_colmap.io.colmap.sparse_points import SparsePoints
from resdepth_colmap.pipeline.refine.load_view import view_inputs
from resdepth_colmap.pipeline.view_images import ViewImages
from resdepth_colmap.progress import Progress
from resdepth_colmap.scene import DepthMap, Scene

NUM_NEIGHBOURS = 4
"""A view's map is compared with so many of the compared views', the best ones."""

NUM_PHOTOS = 2
"""And its photo with so many."""


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredView:
    """What was measured on one view.

    Attributes:
        name: Image name.
        sums: By arm, then by measure.
        depth_ratio: Median of refined over true depth; None without truth.
    """

    name: str
    sums: dict[str, Sums]
    depth_ratio: float | None = None


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Witnesses:
    """What the measures are taken from.

    Attributes:
        scene: All views of the workspace.
        images: Loads the photos.
        points: The sparse points; there may be none.
        truth: True depth maps; None if there are none.
    """

    scene: Scene
    images: ViewImages
    points: SparsePoints
    truth: ReferenceCloud | None = None

    def true_depth(self, maps: ViewMaps) -> DepthMap | None:
        """The true depth of a view at the size of its maps; None if not known."""
        if self.truth is None:
            return None
        for true_map in self.truth.maps:
            if true_map.view.name == maps.view.name:
                return nearest_resized(true_map.depth, maps.shape[::-1])
        return None


def measure_views(
    maps: MethodMaps, witnesses: Witnesses, progress: Progress
) -> list[MeasuredView]:
    """Measure view by view.

    Args:
        maps: The compared views; at least one.
        witnesses: What they are measured with.
        progress: Who listens.

    Raises:
        WorkspaceError: If a map or photo cannot be read.
    """
    scene = witnesses.scene
    compared = [scene.index(maps[index].view.name) for index in range(len(maps))]
    measured = []
    with progress.stage("Measuring", len(maps)) as advance:
        for place, index in enumerate(compared):
            choices = choose_sources(scene, index, NUM_NEIGHBOURS, compared)
            chosen = [compared.index(choice.index) for choice in choices]
            measured.append(_measured(maps, place, chosen, witnesses))
            advance(1)
    return measured


def _measured(
    all_maps: MethodMaps, place: int, neighbours: Sequence[int], witnesses: Witnesses
) -> MeasuredView:
    maps = all_maps[place]
    scene = witnesses.scene
    parts = [coverage(maps), sparse_points(maps, witnesses.points)]
    ratio = None
    truth = witnesses.true_depth(maps)
    if truth is not None:
        parts.append(against_truth(maps, truth))
        ratio = _ratio(maps.depths[REFINED], truth)
    if neighbours:
        others = [all_maps[it] for it in neighbours]
        parts.append(agreement(maps, others))
        photos = view_inputs(
            scene,
            scene.index(maps.view.name),
            [scene.index(other.view.name) for other in others[:NUM_PHOTOS]],
            maps.depths[REFINED],
            witnesses.images,
        )
        parts.append(photo_agreement(maps, photos))
    return MeasuredView(name=maps.view.name, sums=merged(parts), depth_ratio=ratio)


def _ratio(depth: DepthMap, truth: DepthMap) -> float | None:
    both = (depth > 0) & (truth > 0)
    return float(np.median(depth[both] / truth[both])) if both.any() else None
