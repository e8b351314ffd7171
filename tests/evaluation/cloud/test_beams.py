"""The beams found through the grid of directions are those found by trying them all."""

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from resdepth_colmap.evaluation.cloud.config import CloudConfig
from resdepth_colmap.evaluation.cloud.laser_scan import (
    NUM_COLUMNS,
    NUM_ROWS,
    Floats,
    columns_of,
    judge,
    rows_of,
    sort_scan,
    spherical,
)

CONFIG = CloudConfig()


def judged_by_trying_all(
    points: Floats, scan: Floats
) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """ETH3D's rule, pair by pair."""
    squared_distance = np.full(len(points), np.inf, np.float32)
    is_in_front = np.zeros(len(points), bool)
    radii = np.linalg.norm(scan, axis=1)
    directions = scan / radii[:, np.newaxis]
    for index, point in enumerate(points):
        widening = np.tan(np.radians(CONFIG.beam_divergence_halfangle_deg))
        beam = CONFIG.beam_start_radius_meters + np.linalg.norm(point) * widening
        along = directions @ point
        aside = np.linalg.norm(point - along[:, np.newaxis] * directions, axis=1)
        inside = (along >= 0) & (aside <= beam)
        if inside.any():
            apart = ((scan - point)[inside] ** 2).sum(axis=1)
            squared_distance[index] = apart.min()
            is_in_front[index] = (along[inside] < radii[inside]).any()
    return squared_distance, is_in_front


def check(points: npt.ArrayLike, scan: npt.ArrayLike) -> int:
    """Compare the two; returns how many points were in some beam."""
    points32, scan32 = np.asarray(points, np.float32), np.asarray(scan, np.float32)
    squared, in_front = judge(points32, sort_scan(scan32), CONFIG)
    expected, expected_in_front = judged_by_trying_all(points32, scan32)
    np.testing.assert_allclose(squared, expected, rtol=1e-3, atol=1e-6)
    np.testing.assert_array_equal(in_front, expected_in_front)
    return int(np.isfinite(squared).sum())


def directions(rng: np.random.Generator, num: int) -> npt.NDArray[np.float64]:
    vectors = rng.normal(size=(num, 3))
    units: npt.NDArray[np.float64] = vectors / np.linalg.norm(
        vectors, axis=1, keepdims=True
    )
    return units


@given(
    seed=st.integers(0, 2**32 - 1),
    radius_m=st.sampled_from([0.005, 0.05, 0.4, 3.0]),
    share=st.sampled_from([0.3, 0.95, 1.04]),
)
def test_all_around_the_scanner(seed: int, radius_m: float, share: float) -> None:
    rng = np.random.default_rng(seed)
    scan = radius_m * directions(rng, 400)
    turned = scan[:60] + rng.normal(0, 0.001, (60, 3))
    assert check(share * turned, scan) > 5


@given(seed=st.integers(0, 2**32 - 1), up=st.sampled_from([-1, 1]))
def test_about_the_poles(seed: int, up: int) -> None:
    rng = np.random.default_rng(seed)
    aside = rng.normal(0, 0.02, (400, 2))
    scan = np.column_stack([aside, np.full(400, 2.0 * up)])
    assert check(0.8 * scan[:60], scan) == 60


@given(seed=st.integers(0, 2**32 - 1))
def test_where_the_azimuth_turns_over(seed: int) -> None:
    rng = np.random.default_rng(seed)
    y, z = rng.normal(0, 0.01, (2, 400))
    scan = np.column_stack([np.full(400, -2.0), y, z])
    assert check(0.8 * scan[:60] * [1, -1, 1], scan) > 30


def test_a_point_in_the_scanner_lies_in_the_beams_of_the_lowest_row_alone() -> None:
    # So it does in ETH3D's program: an angle that is no number ends there.
    down, aside = [[0.001, 0, -2]], [[2, 0, 0]]
    nowhere = np.zeros((1, 3), np.float32)
    for scan, is_seen in ((down, True), (aside, False)):
        sorted_scan = sort_scan(np.array(scan, np.float32))
        assert judge(nowhere, sorted_scan, CONFIG)[1][0] == is_seen


def test_a_point_of_the_scan_in_the_scanner_does_no_harm() -> None:
    scan = np.array([[0, 0, 0], [2, 0, 0]], np.float32)
    squared, in_front = judge(
        np.array([[1.5, 0, 0]], np.float32), sort_scan(scan), CONFIG
    )
    assert squared[0] == pytest.approx(0.25)
    assert in_front[0]


@pytest.mark.parametrize("x_m", [-1, -0.0005])  # the second within the beam's width
def test_the_opposite_side_is_unobserved(x_m: float) -> None:
    scan = sort_scan(np.array([[2, 0, 0]], np.float32))
    squared, in_front = judge(np.array([[x_m, 0, 0]], np.float32), scan, CONFIG)
    assert np.isinf(squared[0])
    assert not in_front[0]


def test_cells_hold_their_points() -> None:
    points = directions(np.random.default_rng(0), 1000).astype(np.float32)
    scan = sort_scan(points)
    assert scan.cell_starts[-1] == 1000
    azimuth, inclination, _ = spherical(scan.points)
    cells = rows_of(inclination) * NUM_COLUMNS + columns_of(azimuth) % NUM_COLUMNS
    assert (scan.cell_starts[cells] <= np.arange(1000)).all()
    assert (np.arange(1000) < scan.cell_starts[cells + 1]).all()
    assert len(scan.cell_starts) == NUM_ROWS * NUM_COLUMNS + 1
    assert sorted(map(tuple, scan.points)) == sorted(map(tuple, points))


def test_no_point_and_no_scan_are_fine() -> None:
    nothing = np.empty((0, 3), np.float32)
    assert len(judge(nothing, sort_scan(nothing), CONFIG)[0]) == 0
    squared, in_front = judge(np.ones((2, 3), np.float32), sort_scan(nothing), CONFIG)
    assert np.isinf(squared).all()
    assert not in_front.any()
