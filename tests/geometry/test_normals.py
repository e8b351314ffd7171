import numpy as np
import pytest
from analytic_scene import (
    CAMERA,
    PLANE_NORMAL,
    PLANE_OFFSET,
    depth_of_plane,
    depth_of_sphere,
    two_views,
)
from hypothesis import given
from hypothesis import strategies as st

from resdepth_colmap.geometry.normals import normals_from_depth
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.geometry.projection import back_project
from resdepth_colmap.scene import DepthMap, Matrix, View

K = index_K(CAMERA)


def plane_depth(view: View) -> DepthMap:
    return depth_of_plane(view, PLANE_NORMAL, PLANE_OFFSET).astype(np.float32)


def expected_normal(view: View) -> Matrix:
    in_cam = view.cam_from_world[:, :3] @ PLANE_NORMAL
    return np.asarray(in_cam / np.linalg.norm(in_cam))


@pytest.mark.parametrize("index", [0, 1])
@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e5])
def test_a_plane_has_its_normal_at_every_pixel(index: int, scale: float) -> None:
    view = two_views()[index]
    normals = normals_from_depth((plane_depth(view) * scale).astype(np.float32), K)
    expected = np.broadcast_to(expected_normal(view), normals.shape)
    np.testing.assert_allclose(normals, expected, atol=2e-4)
    assert (normals[..., 2] < 0).all()


def test_a_plane_with_random_holes_keeps_its_normal() -> None:
    view = two_views()[0]
    depth = plane_depth(view)
    depth[np.random.default_rng(0).random(depth.shape) < 0.3] = 0.0
    normals = normals_from_depth(depth, K)
    assert not normals[depth == 0].any()
    right = normals[depth > 0] @ expected_normal(view)
    assert (right > 0.9999).mean() > 0.8  # the others lack both neighbours of an axis


def test_next_to_a_depth_edge_each_side_keeps_its_normal() -> None:
    view = two_views()[0]
    depth = plane_depth(view)
    depth[:, 30:] *= 2.0  # a parallel plane, twice as far
    normals = normals_from_depth(depth, K)
    assert (normals @ expected_normal(view)).min() > 0.9999


def test_a_sphere_looks_away_from_its_centre() -> None:
    view = two_views()[0]
    center = np.array([0.1, 0.0, 4.0])
    depth = depth_of_sphere(view, center, 1.2).astype(np.float32)
    normals = normals_from_depth(depth, K)
    expected = (back_project(depth, K) - center) / 1.2
    cosine = (normals * expected).sum(-1)[depth > 0]
    assert np.median(cosine) > 0.999
    assert not normals[depth == 0].any()


@given(height=st.integers(1, 6), width=st.integers(1, 6), seed=st.integers(0, 99))
def test_every_depth_gets_a_unit_normal_towards_the_camera(
    height: int, width: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(0.01, 100.0, (height, width)).astype(np.float32)
    depth[rng.random(depth.shape) < 0.4] = 0.0
    normals = normals_from_depth(depth, K)
    lengths = np.linalg.norm(normals, axis=-1)
    np.testing.assert_allclose(lengths, depth > 0, atol=1e-5)
    assert (normals[depth > 0][:, 2] < 0).all()


def test_noise_of_a_few_per_mille_turns_normals_by_a_few_degrees() -> None:
    view = two_views()[0]
    noise = np.random.default_rng(0).normal(0.0, 0.003, plane_depth(view).shape)
    noisy = (plane_depth(view) * (1.0 + noise)).astype(np.float32)
    cosine = normals_from_depth(noisy, K) @ expected_normal(view)
    assert np.degrees(np.arccos(np.median(cosine))) < 3.0
