"""Laws of slanted planes."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from resdepth_colmap.matching.plane import (
    Plane,
    faces_camera,
    inverse_depth_beside,
    load_plane,
    plane_normal,
    plane_through,
    store_plane,
    viewing_ray,
)

K = np.array([[70, 0, 39.5], [0, 60, 29.5], [0, 0, 1]], np.float32)
PIXEL = (np.float32(12), np.float32(50))

w = st.floats(0.125, 2.0, width=32)
slope = st.floats(-0.5, 0.5, width=32)


def _normal(nx: float, ny: float) -> tuple[np.float32, np.float32, np.float32]:
    unit = np.array([nx, ny, -1.0]) / np.sqrt(nx**2 + ny**2 + 1)
    x, y, z = unit.astype(np.float32)
    return x, y, z


@given(w, slope, slope)
def test_a_plane_has_the_normal_that_it_is_made_from(
    w: float, nx: float, ny: float
) -> None:
    normal = _normal(nx, ny)
    plane = plane_through(np.float32(w), normal, *PIXEL, K)
    np.testing.assert_allclose(plane_normal(plane, *PIXEL, K), normal, atol=1e-4)


@given(w, slope, slope)
def test_a_plane_goes_through_its_pixel_and_is_flat(
    w: float, nx: float, ny: float
) -> None:
    normal = np.array(_normal(nx, ny))
    plane = plane_through(np.float32(w), tuple(normal), *PIXEL, K)
    points = []
    for dx, dy in ((0, 0), (3, 1), (-2, 4)):
        there = inverse_depth_beside(plane, np.float32(dx), np.float32(dy))
        ray = [*viewing_ray(PIXEL[0] + dx, PIXEL[1] + dy, K), 1.0]
        points.append(np.array(ray) / there)
    assert np.isclose(points[0][2], 1 / w, rtol=1e-5)
    np.testing.assert_allclose(
        [normal @ point for point in points], normal @ points[0], rtol=1e-3
    )


def test_only_planes_seen_from_their_front_face_the_camera() -> None:
    assert faces_camera(_normal(0.1, 0.2), *PIXEL, K)
    assert not faces_camera(tuple(-np.array(_normal(0.1, 0.2))), *PIXEL, K)


def test_a_stored_plane_is_loaded() -> None:
    plane = Plane(np.float32(0.5), np.float32(0.25), np.float32(-0.125))
    values = np.zeros(3, np.float32)
    store_plane(values, plane)
    assert load_plane(values) == plane
