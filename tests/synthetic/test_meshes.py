"""Laws of the meshes and of the things built of them."""

import numpy as np
import pytest

from resdepth_colmap.synthetic import meshes, objects, thin_objects

BUILDERS = sorted(
    {*objects.SMALL, *thin_objects.THIN, *thin_objects.FURNITURE},
    key=lambda b: b.__name__,
)


@pytest.mark.parametrize("builder", BUILDERS, ids=lambda builder: builder.__name__)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_things_are_finite_sound_and_of_furniture_size(
    builder: objects.Builder, seed: int
) -> None:
    mesh = builder(np.random.default_rng(seed))
    assert np.isfinite(mesh.vertices).all()
    assert np.isfinite(mesh.uv).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-6)
    assert mesh.faces.min() >= 0
    assert mesh.faces.max() < len(mesh.vertices)
    assert 0.01 < mesh.size.max() < 4
    assert mesh.slots.shape == (len(mesh.faces),)


def test_normals_of_a_ball_point_along_its_radius() -> None:
    ball = meshes.superquadric([2, 2, 2])
    along = np.abs(np.sum(ball.normals * ball.vertices, axis=1))
    assert np.median(along) > 0.99


def test_merged_parts_keep_or_part_their_slots() -> None:
    cube = meshes.box([1, 1, 1])
    assert meshes.merge([cube, cube]).num_slots == 1
    assert meshes.merge([cube, cube], keep_slots=False).num_slots == 2


def test_a_curve_goes_through_its_knots() -> None:
    knots = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, 1]])
    curve = meshes.smooth_path(knots, 301)
    for knot in knots:
        assert np.linalg.norm(curve - knot, axis=1).min() < 1e-6


def test_a_random_rotation_is_a_rotation() -> None:
    turn = meshes.random_rotation(np.random.default_rng(0))
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) > 0
