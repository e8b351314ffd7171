"""Errors pooled over all pixels of several depth maps, as in the table of the paper.

Means, squares and shares are weighted means of those of the maps. The median comes from
a histogram of all residuals, so memory does not grow with the number of maps.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, Self

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
_COUNTS = ("num_pixels", "num_valid", "num_missing", "num_discarded")
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
    histogram: npt.NDArray[np.uint32] = np.zeros(_NUM_BINS, np.uint32)
    for part in parts:
        histogram += part.histogram

    def total(name: str) -> int:
        return sum(getattr(it, name) for it in metrics)

    def mean(name: str, weight: str, power: int = 1) -> float:
        """Weighted mean; NaN without any weight."""
        pairs = [(getattr(it, name), getattr(it, weight)) for it in metrics]
        weighted = [value**power * number for value, number in pairs if number]
        return sum(weighted) / total(weight) if weighted else math.nan

    values: dict[str, Any] = {
        **{name: total(name) for name in _COUNTS},
        "mae": mean("mae", "num_valid"),
        "rmse": math.sqrt(mean("rmse", "num_valid", power=2)),
        "medae": _median(histogram),
        **{name: mean(name, "num_pixels") for name in _SHARES},
    }
    return PooledErrors(metrics=DepthMetrics(**values), histogram=histogram)


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
