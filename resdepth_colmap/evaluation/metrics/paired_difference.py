"""Paired differences of two methods: per view first, then the mean.

Views differ far more from each other than two depth maps of one view do, so only the
difference within a view shows which map is better.
"""

import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.stats import bootstrap

from resdepth_colmap.evaluation.plain import plain

_SAME = 1e-9  # rounding of two equal means


@dataclasses.dataclass(frozen=True, kw_only=True)
class PairedDifference:
    """Differences of a measure of which more is better.

    Attributes:
        num_pairs: Number of views, or tiles, that have the measure by both methods.
        mean: Mean difference; None without pairs.
        median: Median difference; likewise.
        num_better: Number of pairs in which the first method has more.
        num_worse: Number of pairs in which it has less.
        interval: 95 % confidence interval of the mean difference: percentile bootstrap
            of the pairs with 2,000 resamples and a fixed seed. None with fewer than two
            pairs.
    """

    num_pairs: int
    mean: float | None
    median: float | None
    num_better: int
    num_worse: int
    interval: tuple[float, float] | None = None

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return dict(plain(dataclasses.asdict(self)))


def paired_difference(
    first: npt.ArrayLike, second: npt.ArrayLike, *, resample: bool = True
) -> PairedDifference:
    """Compare two methods.

    Args:
        first: The measure by the first method, one value per view or tile, shape (N,);
            NaN = none.
        second: Likewise by the second method.
        resample: Whether to compute the interval. The bootstrap needs independent
            pairs, which the tiles of a view are not.
    """
    pairs = np.asarray(first, np.float64) - np.asarray(second, np.float64)
    pairs = pairs[np.isfinite(pairs)]
    pairs[np.abs(pairs) < _SAME] = 0.0
    if pairs.size == 0:
        return PairedDifference(
            num_pairs=0, mean=None, median=None, num_better=0, num_worse=0
        )
    return PairedDifference(
        num_pairs=pairs.size,
        mean=float(pairs.mean()),
        median=float(np.median(pairs)),
        num_better=int((pairs > 0).sum()),
        num_worse=int((pairs < 0).sum()),
        interval=_interval(pairs) if resample and pairs.size > 1 else None,
    )


def _interval(pairs: npt.NDArray[np.float64]) -> tuple[float, float]:
    """Percentile bootstrap of the mean (Efron and Tibshirani 1993, chapter 13)."""
    rng, options = np.random.default_rng(0), {"method": "percentile"}
    found = bootstrap(
        (pairs,), np.mean, n_resamples=2000, random_state=rng, **options
    ).confidence_interval
    return float(found.low), float(found.high)
