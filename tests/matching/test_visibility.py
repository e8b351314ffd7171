"""Laws of the cost of a hypothesis beside the depth map of a source."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from resdepth_colmap.matching.cost import OUTSIDE
from resdepth_colmap.matching.views import Sources
from resdepth_colmap.matching.visibility import (
    HIDDEN,
    UNSEEN,
    WORST,
    WORST_MATCH,
    bounded_cost,
    geometric_cost,
)

FOCAL, BASELINE, WIDTH, HEIGHT = 100.0, 0.1, 64, 48


def _source(depth: float) -> Sources:
    """A source to the right that sees a wall at that depth everywhere; 0 = no depth."""
    inverse = 1.0 / depth if depth else 0.0
    return Sources(
        A=np.eye(3, dtype=np.float32)[None],
        b=np.array([[-FOCAL * BASELINE, 0, 0]], np.float32),
        pixels=np.zeros(WIDTH * HEIGHT, np.float32),
        inverse_depths=np.full(WIDTH * HEIGHT, inverse, np.float32),
        starts=np.zeros(1, np.int64),
        sizes=np.array([[WIDTH, HEIGHT]], np.int64),
    )


def _cost(match_cost: float, depth: float, wall: float) -> float:
    inverse = np.float32(1.0 / depth)
    cost = np.float32(match_cost)
    x, y = np.float32(40), np.float32(20)
    return float(geometric_cost(cost, x, y, inverse, _source(wall), 0))


@given(st.floats(0.0, 0.4))
def test_a_plane_where_the_source_saw_it_costs_what_it_matches(match: float) -> None:
    assert _cost(match, 2.0, 2.0) == pytest.approx(match, abs=1e-4)


@given(st.floats(0.0, 2.0).filter(lambda cost: cost != 1.0), st.floats(0.7, 8.0))
def test_no_map_makes_a_hypothesis_cheaper(match: float, depth: float) -> None:
    assert _cost(match, depth, 2.0) >= min(match, float(WORST_MATCH)) - 1e-6


def test_a_plane_in_front_of_what_the_source_saw_is_worse_than_one_behind() -> None:
    in_front, behind = _cost(0.3, 1.0, 2.0), _cost(0.3, 4.0, 2.0)
    assert behind <= float(HIDDEN) < in_front <= float(WORST)


def test_the_error_there_and_back_is_paid_by_the_pixel() -> None:
    # Disparity is focal * baseline / depth = 10 px a unit of inverse depth.
    one_px = 1.0 / (1.0 / 2.0 + 1.0 / (FOCAL * BASELINE))
    assert _cost(0.1, one_px, 2.0) == pytest.approx(0.15, abs=1e-3)


def test_a_hole_of_the_source_says_nothing() -> None:
    assert _cost(0.2, 1.0, 0.0) == pytest.approx(0.2)


def test_what_is_out_of_sight_stays_so_and_costs_the_same_in_both_passes() -> None:
    assert _cost(float(OUTSIDE), 2.0, 3.0) == OUTSIDE
    assert bounded_cost(OUTSIDE, True) == bounded_cost(OUTSIDE, False) == UNSEEN
