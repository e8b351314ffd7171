"""Three methods on a sample, against its ground truth: unfiltered, median, refined.

The protocol of the paper: the unfiltered depth of a matcher, its 5 x 5 median as the
baseline, and the refined depth; residuals beyond a limit are discarded.
"""

import dataclasses
from collections.abc import Mapping

import numpy as np

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.evaluation.datasets.sample import DepthSample, InitialDepth
from resdepth_colmap.evaluation.depth.sample_refinement import refine_sample
from resdepth_colmap.evaluation.metrics.depth_metrics import (
    edge_region,
    median_filtered,
)
from resdepth_colmap.evaluation.metrics.pooled_metrics import PooledErrors
from resdepth_colmap.network.unet import ResDepthNet

METHODS = ("unfiltered", "median", "refined")
REGIONS = ("all", "edges", "flat")


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class SampleResult:
    """The errors of one sample.

    Attributes:
        name: Name of the sample.
        origin: Where the initial depth comes from.
        errors: By region, then by method; see `REGIONS` and `METHODS`.
        seen: Errors of the initial depth at pixels that the first source sees, too;
            None if those are unknown.
        seen_median_relative_error: Median of error over true depth there; likewise.
        megapixels: Size of the view, in millions of pixels.
        matching_cpu_s: Processor seconds of all threads; None for existing depth.
        refining_cpu_s: Likewise, of the last outer iteration.
    """

    name: str
    origin: str
    errors: Mapping[str, Mapping[str, PooledErrors]]
    seen: PooledErrors | None
    seen_median_relative_error: float | None
    megapixels: float
    matching_cpu_s: float | None
    refining_cpu_s: float


def measure_sample(
    sample: DepthSample,
    initial: InitialDepth,
    network: ResDepthNet,
    config: RefineConfig,
    max_residual: float | None,
) -> SampleResult:
    """Refine the initial depth and compare all three maps with the ground truth.

    Errors beyond `max_residual`, in units, are discarded; None = no limit.
    """
    truth, depth, seen = sample.truth, initial.depth, sample.seen
    refined, cpu_s = refine_sample(sample, initial, network, config)
    maps = (depth, median_filtered(depth), refined)
    methods = dict(zip(METHODS, maps, strict=True))
    edges = edge_region(truth)
    regions = {"all": None, "edges": edges, "flat": ~edges}
    return SampleResult(
        name=sample.name,
        origin=initial.origin,
        errors={
            region: {
                method: PooledErrors.of(values, truth, inside, max_residual)
                for method, values in methods.items()
            }
            for region, inside in regions.items()
        },
        seen=None
        if seen is None
        else PooledErrors.of(depth, truth, seen, max_residual),
        seen_median_relative_error=_median_relative_error(sample, initial),
        megapixels=sample.megapixels,
        matching_cpu_s=initial.cpu_s,
        refining_cpu_s=cpu_s,
    )


def _median_relative_error(sample: DepthSample, initial: InitialDepth) -> float | None:
    if sample.seen is None:
        return None
    counted = sample.seen & (sample.truth > 0)
    if not counted.any():
        return float("nan")
    truth = sample.truth[counted]
    return float(np.median(np.abs(initial.depth[counted] - truth) / truth))
