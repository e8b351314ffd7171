import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from resdepth_colmap.geometry.projection import back_project, project, transform

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
