"""What one arm has more than another, view by view: differences before means.

Views differ far more from each other than two depth maps of one view, so only the
difference within a view tells whether one map is better.
"""

import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt

NUM_RESAMPLES = 2000
INTERVAL = (2.5, 97.5)
_SEED = 0
_SAME = 1e-9  # rounding of two equal means


@dataclasses.dataclass(frozen=True, kw_only=True)
class PairedDifference:
    """Differences of a measure of which more is better.

    Attributes:
        num_pairs: Views, or tiles, that have the measure in both arms.
        mean: Mean difference; None without pairs.
        median: Median difference; likewise.
        num_better: Pairs in which the first arm has more.
        num_worse: Pairs in which it has less.
        interval: 95 % of the means of pairs drawn anew, with repetition, lie between
            these two (percentile bootstrap, 2,000 draws, fixed seed); None with
            fewer than two pairs.
    """

    num_pairs: int
    mean: float | None
    median: float | None
    num_better: int
    num_worse: int
    interval: tuple[float, float] | None = None

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, ready for JSON: six digits."""
        values = dataclasses.asdict(self)
        for name in ("mean", "median"):
            values[name] = None if values[name] is None else round(values[name], 6)
        if self.interval is not None:
            values["interval"] = [round(bound, 6) for bound in self.interval]
        return values


def paired_difference(
    first: npt.ArrayLike, second: npt.ArrayLike, *, resample: bool = True
) -> PairedDifference:
    """Compare two arms.

    Args:
        first: The measure of the first arm, one value a view or tile, shape (N,); NaN =
            it has none.
        second: The same of the second arm, in the same order.
        resample: Whether to draw the pairs anew: not where they depend on each other,
            as the tiles of a view do.
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
    rng = np.random.default_rng(_SEED)
    drawn = rng.integers(0, pairs.size, (NUM_RESAMPLES, pairs.size))
    low, high = np.percentile(pairs[drawn].mean(axis=1), INTERVAL)
    return float(low), float(high)
