"""Laws of paired differences, and of sums over tiles."""

import numpy as np
import numpy.typing as npt
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from resdepth_colmap.evaluation.metrics.paired_difference import paired_difference
from resdepth_colmap.evaluation.metrics.view_maps import TileSums

VALUES = arrays(np.float64, 7, elements=st.floats(-1, 1))
Array = npt.NDArray[np.float64]


@given(VALUES)
def test_a_method_does_not_differ_from_itself(values: Array) -> None:
    found = paired_difference(values, values)
    assert found.mean == found.median == 0
    assert found.interval == (0.0, 0.0)
    assert found.num_better == found.num_worse == 0


@given(VALUES, VALUES)
def test_swapped_methods_swap_better_and_worse(first: Array, second: Array) -> None:
    there, back = paired_difference(first, second), paired_difference(second, first)
    assert there.mean is not None
    assert back.mean is not None
    assert np.isclose(there.mean, -back.mean)
    assert (there.num_better, there.num_worse) == (back.num_worse, back.num_better)


@given(VALUES, VALUES)
def test_the_interval_lies_within_the_differences(first: Array, second: Array) -> None:
    found = paired_difference(first, second)
    assert found.interval is not None
    low, high = found.interval
    pairs = first - second
    assert pairs.min() - 1e-6 <= low <= high <= pairs.max() + 1e-6


def test_the_interval_covers_the_mean_as_often_as_it_says() -> None:
    rng = np.random.default_rng(0)
    covered = 0
    for _ in range(100):
        found = paired_difference(rng.normal(0.3, 1, 40), np.zeros(40))
        low, high = found.interval or (0, 0)
        covered += low <= 0.3 <= high
    assert 85 <= covered <= 100


def test_views_without_the_measure_are_no_pairs() -> None:
    nan = np.nan
    found = paired_difference([1, nan, 0.5], [0.5, 0.5, nan])
    assert (found.num_pairs, found.mean, found.interval) == (1, 0.5, None)
    assert paired_difference([nan], [1]).to_mapping()["mean"] is None


@given(st.integers(1, 150), st.integers(1, 150), st.integers(0, 9))
def test_tiles_sum_up_to_the_view(height_px: int, width_px: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.random((height_px, width_px))
    counted = rng.random((height_px, width_px)) < 0.5
    tiles = TileSums.of(values, counted)
    num_tiles = -(-height_px // 64) * -(-width_px // 64)
    assert tiles.sums.shape == tiles.counts.shape == (num_tiles,)
    assert tiles.counts.sum() == counted.sum()
    assert np.isclose(tiles.sums.sum(), values[counted].sum())
    assert np.isnan(tiles.mean) == (not counted.any())
    first = counted[:64, :64]
    if first.any():
        assert np.isclose(tiles.means[0], values[:64, :64][first].mean())
