import numpy as np
import pytest

from resdepth_colmap.evaluation.cloud.point_shares import VoxelGrids


def grids(points: list[list[float]]) -> VoxelGrids:
    return VoxelGrids(np.array(points, np.float32), 0.01)


def test_a_crowded_voxel_counts_as_one() -> None:
    crowd = [[0.501, 0.501, 0.501]] * 98
    points = grids([*crowd, [0.7, 0.7, 0.7], [0.9, 0.9, 0.9]])
    good = np.arange(100) >= 98
    assert points.mean_share(good, np.ones(100, bool)) == pytest.approx(2 / 3)


def test_the_second_grid_joins_what_the_first_one_parts() -> None:
    # 1 mm apart, on both sides of a border of the first grid: 2 voxels there, 1 here.
    points = grids([[0.0095, 0.002, 0.002], [0.0105, 0.002, 0.002]])
    share = points.mean_share(np.array([True, False]), np.ones(2, bool))
    assert share == pytest.approx((1 + 0 + 1 / 2) / 3)


def test_voxels_about_0_are_as_large_as_others() -> None:
    points = grids([[-0.004, 0, 0], [0.004, 0, 0], [0.003, 0, 0]])
    share = points.mean_share(np.array([True, False, False]), np.ones(3, bool))
    assert share == pytest.approx((1 + 0 + 1 / 3) / 3)


def test_a_voxel_without_a_counted_point_is_left_out() -> None:
    points = grids([[0.1, 0.1, 0.1], [0.5, 0.5, 0.5], [0.9, 0.9, 0.9]])
    counted = np.array([True, False, True])
    assert points.mean_share(np.array([True, False, False]), counted) == 0.5
    assert points.mean_share(np.zeros(3, bool), np.zeros(3, bool)) == 0


def test_borders_are_those_of_float32() -> None:
    # 1.4 as float32 is less than 1.4, yet times 100 it is rounded to 140.
    points = grids([[1.4, 0, 0], [1.404, 0, 0], [1.396, 0, 0]])
    share = points.mean_share(np.array([False, True, False]), np.ones(3, bool))
    # First grid {1.4, 1.404}, {1.396}; second grid {1.396, 1.4, 1.404}.
    assert share == pytest.approx((1 / 2 + 0 + 1 / 3) / 3)


def test_no_point_and_points_far_out_are_fine() -> None:
    empty = np.zeros(0, bool)
    assert VoxelGrids(np.empty((0, 3), np.float32), 0.01).mean_share(empty, empty) == 0
    far = grids([[3e38, 0, 0], [-3e38, 0, 0], [0, 0, 0]])
    good = np.array([True, False, False])
    assert far.mean_share(good, np.ones(3, bool)) == pytest.approx(1 / 3)
