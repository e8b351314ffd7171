"""Laws of the roughness of a surface."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from resdepth_colmap.matching.plane import Plane
from resdepth_colmap.matching.smoothness import (
    DX,
    DY,
    NUM_NEIGHBORS,
    Neighbors,
    gather_neighbors,
    roughness,
)

Array = NDArray[Any]

SHAPE = (20, 24)


def _around(gray: Array, inverse: Array, x: int, y: int) -> Neighbors:
    planes = np.zeros((*SHAPE, 3), np.float32)
    planes[..., 0] = inverse
    neighbors = Neighbors(
        np.empty(NUM_NEIGHBORS, np.float32), np.empty(NUM_NEIGHBORS, np.float32)
    )
    gather_neighbors(gray.astype(np.float32), planes, x, y, neighbors)
    return neighbors


def _plane(w: float, gx: float = 0.0, gy: float = 0.0) -> Plane:
    return Plane(np.float32(w), np.float32(gx), np.float32(gy))


def test_all_neighbours_are_of_the_other_colour_of_the_checkerboard() -> None:
    assert np.all((DX + DY) % 2 == 1)


@given(st.floats(-0.01, 0.01), st.floats(-0.01, 0.01))
def test_a_plane_that_goes_on_is_not_rough(gx: float, gy: float) -> None:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    inverse = 0.5 + gx * (x - 12) + gy * (y - 10)
    neighbors = _around(np.full(SHAPE, 0.5), inverse, 12, 10)
    assert roughness(_plane(0.5, gx, gy), np.float32(100), neighbors) < 1e-3


@given(st.floats(0.0, 1e3))
def test_roughness_is_a_share(offset: float) -> None:
    neighbors = _around(np.full(SHAPE, 0.5), np.full(SHAPE, 0.5), 12, 10)
    rough = roughness(_plane(0.5 + offset), np.float32(100), neighbors)
    assert rough == pytest.approx(min((100 * offset) ** 2, 1.0), abs=1e-3)


@pytest.mark.parametrize("at", [(0, 0), (23, 19), (1, 18), (12, 10)])
def test_neighbours_beyond_the_border_have_no_weight(at: tuple[int, int]) -> None:
    weights = _around(np.full(SHAPE, 0.5), np.full(SHAPE, 0.5), *at).weights
    x, y = at[0] + DX, at[1] + DY
    inside = (x >= 0) & (x < SHAPE[1]) & (y >= 0) & (y < SHAPE[0])
    assert np.all((weights > 0) == inside)
    assert weights.sum() == pytest.approx(1.0, abs=1e-5)


def test_across_an_edge_of_the_photo_a_step_in_depth_costs_little() -> None:
    gray = np.full(SHAPE, 0.2)
    gray[:, 13:] = 0.9
    step = np.full(SHAPE, 0.5)
    step[:, 13:] = 1.0
    plane = _plane(0.5)
    at_edge = roughness(plane, np.float32(100), _around(gray, step, 12, 10))
    without = roughness(
        plane, np.float32(100), _around(np.full(SHAPE, 0.2), step, 12, 10)
    )
    assert at_edge < 0.1 < 0.3 < without
