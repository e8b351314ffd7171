"""Errors pooled over all pixels of several depth maps, as in the table of the paper.

Means, squares and shares are weighted means of those of the maps. The median comes from
a histogram of all residuals, so memory does not grow with the number of maps.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import Self

import numpy as np
import numpy.typing as npt

from resdepth_colmap.evaluation.datasets.paper import PAPER_MAX_RESIDUAL
from resdepth_colmap.evaluation.metrics.depth_metrics import (
    DepthMetrics,
    find_residuals,
)
from resdepth_colmap.scene import DepthMap

SMALLEST = 1e-9
"""Smaller residuals, in workspace units, fall into the first bin."""

_BINS_A_DECADE = 500
_NUM_DECADES = 15
_NUM_BINS = _BINS_A_DECADE * _NUM_DECADES
_SHARES = ("bad_1", "bad_2", "bad_1cm", "bad_2cm", "bad_5cm")


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class PooledErrors:
    """Errors of one or several depth maps, which can be pooled further.

    Attributes:
        metrics: The errors.
        histogram: Number of valid residuals by size, in logarithmic bins, shape
            (7500,).
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
        """The errors of one map; arguments as in `find_residuals`."""
        residuals = find_residuals(depth, truth, region, max_residual)
        return cls(
            metrics=DepthMetrics.of(residuals), histogram=_histogram(residuals.valid)
        )


def pooled(parts: Sequence[PooledErrors]) -> PooledErrors:
    """The errors over all pixels of all maps.

    Args:
        parts: At least one.

    Returns:
        Exact values, except for the median of several parts: right to half a per cent.
    """
    if len(parts) == 1:
        return parts[0]
    metrics = [part.metrics for part in parts]
    valid = [m.num_valid for m in metrics]
    square = _mean([m.rmse**2 for m in metrics], valid)
    pixels = [m.num_pixels for m in metrics]
    shares = {n: _mean([getattr(m, n) for m in metrics], pixels) for n in _SHARES}
    histogram: npt.NDArray[np.uint32] = np.zeros(_NUM_BINS, np.uint32)
    for part in parts:
        histogram += part.histogram
    return PooledErrors(
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
    """Weighted mean; values of weight 0 may be NaN. NaN without any weight."""
    total = sum(weights)
    if not total:
        return math.nan
    weighted = (v * w for v, w in zip(values, weights, strict=True) if w)
    return sum(weighted) / total


def _histogram(residuals: npt.NDArray[np.float64]) -> npt.NDArray[np.uint32]:
    position = np.log10(np.maximum(residuals, SMALLEST) / SMALLEST) * _BINS_A_DECADE
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
