import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from resdepth_colmap.geometry.projection import (
    back_project,
    lift,
    look_up,
    project,
    transform,
)

K = np.array([[50.0, 0.0, 11.3], [0.0, 52.0, 7.9], [0.0, 0.0, 1.0]])


@given(seed=st.integers(0, 2**32))
def test_a_pixel_back_projected_and_projected_is_that_pixel(seed: int) -> None:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(0.1, 100.0, (12, 17)).astype(np.float32)
    xy, z = project(back_project(depth, K), K)
    x, y = np.meshgrid(np.arange(17), np.arange(12))
    np.testing.assert_allclose(xy, np.stack([x, y], -1), atol=1e-9)
    np.testing.assert_allclose(z, depth)


def test_a_pixel_without_depth_is_the_origin_and_projects_to_numbers() -> None:
    xyz = back_project(np.zeros((2, 3), dtype=np.float32), K)
    xy, z = project(xyz, K)
    assert not xyz.any()
    assert not z.any()
    assert np.isfinite(xy).all()


def test_a_pose_and_its_inverse_give_the_points_back() -> None:
    rng = np.random.default_rng(0)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    pose = np.column_stack([rotation, [1.0, -2.0, 3.0]])
    inverse = np.column_stack([rotation.T, -rotation.T @ pose[:, 3]])
    xyz = rng.normal(size=(4, 5, 3))
    np.testing.assert_allclose(transform(inverse, transform(pose, xyz)), xyz)


@given(seed=st.integers(0, 2**32))
def test_lifted_pixels_are_looked_up_where_they_were(seed: int) -> None:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(0.1, 100.0, (12, 17)).astype(np.float32)
    pixels = np.sort(rng.choice(depth.size, 50, replace=False))
    xyz = lift(pixels, depth, K)
    assert xyz.dtype == np.float32
    np.testing.assert_allclose(
        xyz, back_project(depth, K).reshape(-1, 3)[pixels], rtol=1e-5, atol=1e-5
    )
    points, found = look_up(xyz, K, depth.shape)
    assert np.array_equal(points, np.arange(50))
    assert np.array_equal(found, pixels)


def test_points_behind_the_camera_and_beside_the_map_are_not_found() -> None:
    xy = [(0, 0), (-0.4, 0), (-0.6, 0), (16.4, 11.4), (16.6, 11), (1e30, 0), (3, 2)]
    x, y = np.array(xy, np.float64).T
    xyz = np.stack([(x - K[0, 2]) / K[0, 0], (y - K[1, 2]) / K[1, 1], 0 * x + 1], 1)
    points, pixels = look_up(xyz, K, (12, 17))
    assert points.tolist() == [0, 1, 3, 6]
    assert pixels.tolist() == [0, 0, 16 + 17 * 11, 3 + 17 * 2]
    nothing = np.array([[0.0, 0.0, 0.0], [np.nan, 0.0, 1.0], [0.0, 0.0, np.nan]])
    for unseen in (-xyz, nothing):
        assert look_up(unseen, K, (12, 17)).points.size == 0


def test_the_precision_is_that_of_the_pose_and_of_the_points() -> None:
    pose, xyz = np.eye(3, 4), np.ones((2, 3), np.float32)
    assert transform(pose, xyz).dtype == np.float64
    assert transform(pose.astype(np.float32), xyz).dtype == np.float32
    assert project(xyz, K)[0].dtype == np.float32
    assert project(xyz.astype(np.float64), K)[0].dtype == np.float64
