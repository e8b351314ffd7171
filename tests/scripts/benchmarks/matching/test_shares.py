"""Laws of the shares of pixels near an expected depth."""

import numpy as np
import pytest

from scripts.benchmarks.matching.shares import mean_of, shares_within


def test_shares_count_holes_as_wrong_and_only_the_pixels_that_count() -> None:
    expected = np.array([[1, 2, 4, 8, 0]], np.float32)
    depth = np.array([[1.005, 2.03, 0, 80, 5]], np.float32)
    where = np.array([[True, True, True, False, False]])
    shares = shares_within(depth, expected, where, (0.01, 0.02))
    assert shares == {
        "0.01": pytest.approx(1 / 3),
        "0.02": pytest.approx(2 / 3),
        "median": pytest.approx(0.015, rel=1e-4),
    }
    assert mean_of([{"0.01": 1.0}, {"0.01": 0.5}]) == {"0.01": 0.75}


def test_shares_of_nothing_or_of_other_shapes_are_refused() -> None:
    depth = np.array([[1, 2]], np.float32)
    with pytest.raises(ValueError, match="no pixel counts"):
        shares_within(depth, depth, np.zeros((1, 2), np.bool_), (0.01,))
    with pytest.raises(ValueError, match="shapes"):
        shares_within(depth, depth.T, np.ones((1, 2), np.bool_), (0.01,))
