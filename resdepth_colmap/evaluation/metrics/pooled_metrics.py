"""Errors pooled over all pixels of several depth maps, as the paper's table does.

Means, squares and shares of the maps add up; the median is read off a histogram of all
residuals, so that memory does not grow with the number of maps.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import Self

import numpy as np
import numpy.typing as npt

from resdepth_colmap.evaluation.datasets.paper import PAPER_MAX_RESIDUAL
from resdepth_colmap.evaluation.metrics.depth_metrics import DepthMetrics, depth_metrics
from resdepth_colmap.scene import DepthMap

SMALLEST = 1e-9
"""Residuals below it, in workspace units, fall into the first bin."""

_BINS_A_DECADE = 500
_NUM_DECADES = 15
_NUM_BINS = _BINS_A_DECADE * _NUM_DECADES
_SHARES = ("bad_1", "bad_2", "bad_1cm", "bad_2cm", "bad_5cm")


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class ErrorSample:
    """Errors of one map or of many, which can be pooled.

    Attributes:
        metrics: The errors.
        histogram: Number of valid residuals by size, logarithmic, shape (7500,).
    """

    metrics: DepthMetrics
    histogram: npt.NDArray[np.uint32]

    @classmethod
    def of(
        cls,
        depth: DepthMap,
        truth: DepthMap,
        region: npt.NDArray[np.bool_] | None = None,
        max_residual: float | None = PAPER_MAX_RESIDUAL,
    ) -> Self:
        """Measure one map; arguments and errors are those of `depth_metrics`."""
        metrics = depth_metrics(depth, truth, region, max_residual)
        valid = (truth > 0) & (depth > 0) & np.isfinite(depth)
        if region is not None:
            valid &= region
        residual = np.abs(depth[valid].astype(np.float64) - truth[valid])
        if max_residual is not None:
            residual = residual[residual <= max_residual]
        return cls(metrics=metrics, histogram=_histogram(residual))


def pooled(samples: Sequence[ErrorSample]) -> ErrorSample:
    """The errors over all pixels of all maps; exact but for the median of several.

    Args:
        samples: At least one.

    Returns:
        A single sample as it is; of several the median is right to half a per cent.
    """
    if len(samples) == 1:
        return samples[0]
    metrics = [sample.metrics for sample in samples]
    valid = [m.num_valid for m in metrics]
    square = _mean([m.rmse**2 for m in metrics], valid)
    pixels = [m.num_pixels for m in metrics]
    shares = {n: _mean([getattr(m, n) for m in metrics], pixels) for n in _SHARES}
    histogram: npt.NDArray[np.uint32] = np.zeros(_NUM_BINS, np.uint32)
    for sample in samples:
        histogram += sample.histogram
    return ErrorSample(
        metrics=DepthMetrics(
            num_pixels=sum(pixels),
            num_valid=sum(valid),
            num_missing=sum(m.num_missing for m in metrics),
            num_discarded=sum(m.num_discarded for m in metrics),
            mae=_mean([m.mae for m in metrics], valid),
            rmse=math.sqrt(square),
            medae=_median(histogram),
            **shares,
        ),
        histogram=histogram,
    )


def _mean(values: Sequence[float], weights: Sequence[int]) -> float:
    """Weighted mean; what has no weight may be NaN, and all of it gives NaN."""
    total = sum(weights)
    if not total:
        return math.nan
    weighted = (v * w for v, w in zip(values, weights, strict=True) if w)
    return sum(weighted) / total


def _histogram(residual: npt.NDArray[np.float64]) -> npt.NDArray[np.uint32]:
    position = np.log10(np.maximum(residual, SMALLEST) / SMALLEST) * _BINS_A_DECADE
    bins = np.clip(position.astype(np.int64), 0, _NUM_BINS - 1)
    return np.bincount(bins, minlength=_NUM_BINS).astype(np.uint32)


def _median(histogram: npt.NDArray[np.uint32]) -> float:
    reached = np.cumsum(histogram, dtype=np.int64)
    if not reached[-1]:
        return math.nan
    half = 0.5 * float(reached[-1])
    index = int(np.searchsorted(reached, half))
    before = float(reached[index - 1]) if index else 0.0
    inside = (half - before) / float(histogram[index])
    if index == 0:
        return SMALLEST * inside
    return float(SMALLEST * 10.0 ** ((index + inside) / _BINS_A_DECADE))
