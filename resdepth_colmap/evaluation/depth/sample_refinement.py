"""Refining a case as a workspace would be: its sources' maps in earlier rounds, too."""

import functools
import time
from typing import NamedTuple

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.evaluation.datasets.sample import (
    DepthSample,
    InitialDepth,
)
from resdepth_colmap.matching.patch_match import MatchView
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.pipeline.refine.cross_view import NUM_SOURCE_MAPS, SourceMap
from resdepth_colmap.pipeline.refine.view import SourceView, ViewInputs, refine_view
from resdepth_colmap.scene import DepthMap, UnitColors, cam_from_cam


class RefinedSample(NamedTuple):
    """What became of a case.

    Attributes:
        depth: Of its reference, shape (H, W), in units.
        cpu_s: Processor seconds of all threads, for the last round of the reference:
            earlier ones count for the views that they refine, as in a workspace.
    """

    depth: DepthMap
    cpu_s: float


class _SampleView(NamedTuple):
    """One of a case's views; no depth = there is no map of it."""

    view: MatchView
    depth: DepthMap | None
    colors: UnitColors | None


def refine_sample(
    sample: DepthSample,
    initial: InitialDepth,
    network: ResDepthNet,
    config: RefineConfig,
) -> RefinedSample:
    """Refine the depth of a case's reference.

    In earlier rounds its sources are refined as far as the case shows what they look
    at: from each other and from the reference.

    Args:
        sample: The views.
        initial: Depth of the reference, and of the sources where there is any.
        network: On the device to run on.
        config: Rounds, passes and tiles.
    """
    views = _views(sample, initial)
    num_earlier = config.outer_iterations - 1 if network.config.source_depth else 0

    @functools.cache
    def map_of(index: int, num_rounds: int) -> DepthMap | None:
        depth = views[index].depth
        if num_rounds == 0 or depth is None or not (depth > 0).any():
            return depth
        return refine_view(inputs(index, num_rounds - 1), network, config).depth

    def inputs(index: int, num_rounds: int) -> ViewInputs:
        """Of a view after so many rounds of the others."""
        others = [other for other in range(len(views)) if other != index]
        maps = {other: map_of(other, num_rounds) for other in others[:NUM_SOURCE_MAPS]}
        return _inputs(views, index, maps)

    own = inputs(0, num_earlier)
    start = time.process_time()
    depth = refine_view(own, network, config).depth
    return RefinedSample(depth, time.process_time() - start)


def _views(sample: DepthSample, initial: InitialDepth) -> list[_SampleView]:
    """The reference first."""
    found = [_SampleView(sample.reference, initial.depth, sample.colors)]
    for place, source in enumerate(sample.sources):
        depths = initial.source_depths[place : place + 1] or (None,)
        colors = sample.source_colors[place : place + 1] or (None,)
        found.append(_SampleView(source, *depths, *colors))
    return found


def _inputs(
    views: list[_SampleView], index: int, maps: dict[int, DepthMap | None]
) -> ViewInputs:
    own = views[index]
    assert own.depth is not None  # noqa: S101 (asked only where it is there)
    others = [view.view for place, view in enumerate(views) if place != index]
    return ViewInputs(
        depth=own.depth,
        gray=own.view.gray,
        colors=own.colors,
        K=own.view.K,
        sources=tuple(
            SourceView(
                gray=source.gray,
                K=source.K,
                source_from_reference=cam_from_cam(source, own.view),
            )
            for source in others
        ),
        source_maps=tuple(
            SourceMap(
                depth=depth,
                K=views[place].view.K,
                source_from_reference=cam_from_cam(views[place].view, own.view),
            )
            for place, depth in maps.items()
            if depth is not None
        ),
    )
