"""Refinement of a sample as in a workspace, with the maps of its sources."""

import functools
import itertools
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
    """The refined depth of a sample.

    Attributes:
        depth: Of its reference, shape (H, W), in units.
        cpu_s: Processor seconds of all threads, of the last outer iteration of the
            reference.
    """

    depth: DepthMap
    cpu_s: float


class _SampleView(NamedTuple):
    """A view of a sample; no depth = it has no map."""

    view: MatchView
    depth: DepthMap | None
    colors: UnitColors | None


def refine_sample(
    sample: DepthSample,
    initial: InitialDepth,
    network: ResDepthNet,
    config: RefineConfig,
) -> RefinedSample:
    """Refine the depth of the reference of a sample.

    Earlier outer iterations refine the sources, too, from each other and from the
    reference, as far as the sample has the views for it.
    """
    views = _views(sample, initial)
    num_earlier = config.outer_iterations - 1 if network.config.source_depth else 0

    @functools.cache
    def map_of(index: int, num_iterations: int) -> DepthMap | None:
        depth = views[index].depth
        if num_iterations == 0 or depth is None or not (depth > 0).any():
            return depth
        return refine_view(inputs(index, num_iterations - 1), network, config).depth

    def inputs(index: int, num_iterations: int) -> ViewInputs:
        """Of a view, after that many outer iterations of the others."""
        others = [other for other in range(len(views)) if other != index]
        maps = {
            other: map_of(other, num_iterations) for other in others[:NUM_SOURCE_MAPS]
        }
        return _inputs(views, index, maps)

    own = inputs(0, num_earlier)
    start = time.process_time()
    depth = refine_view(own, network, config).depth
    return RefinedSample(depth, time.process_time() - start)


def _views(sample: DepthSample, initial: InitialDepth) -> list[_SampleView]:
    """The reference first."""
    sources = itertools.zip_longest(
        sample.sources, initial.source_depths, sample.source_colors
    )
    return [
        _SampleView(sample.reference, initial.depth, sample.colors),
        *itertools.starmap(_SampleView, itertools.islice(sources, len(sample.sources))),
    ]


def _inputs(
    views: list[_SampleView], index: int, maps: dict[int, DepthMap | None]
) -> ViewInputs:
    own = views[index]
    assert own.depth is not None  # noqa: S101 (for the type checker)

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
            for i, (source, *_) in enumerate(views)
            if i != index
        ),
        source_maps=tuple(
            SourceMap(
                depth=depth,
                K=views[i].view.K,
                source_from_reference=cam_from_cam(views[i].view, own.view),
            )
            for i, depth in maps.items()
            if depth is not None
        ),
    )
