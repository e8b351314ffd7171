"""Laws of the choice among the sources at a pixel."""

import numpy as np
import pytest

from resdepth_colmap.matching.cost import OUTSIDE
from resdepth_colmap.matching.view_selection import select_views


def _weights(*costs_of_sources: list[float]) -> list[float]:
    costs = np.array(costs_of_sources, np.float32).T.copy()
    weights = np.zeros(len(costs_of_sources), np.float32)
    select_views(costs, len(costs), 1, weights)
    assert weights.sum() == pytest.approx(1.0, abs=1e-6)
    return [float(weight) for weight in weights]


def test_sources_that_match_alike_count_alike() -> None:
    assert _weights([0.1, 0.2], [0.1, 0.2]) == pytest.approx([0.5, 0.5])


def test_one_good_hypothesis_is_not_enough_where_another_source_has_two() -> None:
    assert _weights([0.1, 0.9, 0.9], [0.1, 0.2, 0.9])[0] == 0


@pytest.mark.parametrize("bad", [1.5, float(OUTSIDE)])
def test_a_source_with_four_bad_hypotheses_does_not_count(bad: float) -> None:
    assert _weights([0.1, 0.1, *[bad] * 4], [0.7, 0.7, *[0.9] * 4])[0] == 0


def test_where_no_source_counts_the_best_hypothesis_of_each_does() -> None:
    weights = _weights([0.9, 1.5], [1.1, 1.5])
    assert weights[0] > weights[1] > 0
