"""Laws of the agreement of depth maps, on exact maps of a plane."""

import dataclasses

import numpy as np
import numpy.typing as npt
import pytest

from resdepth_colmap.evaluation.map_agreement import (
    ViewMap,
    confirmed,
    mean_of,
    num_confirming,
    shares_within,
)
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.scene import Camera, DepthMap, View

CAMERA = Camera(width_px=32, height_px=24, fx=30, fy=30, cx=16, cy=12)


def view(x: float, camera: Camera = CAMERA, turn_deg: float = 0.0) -> View:
    """A camera at (x, 0, 0), turned about its y axis."""
    c, s = np.cos(np.deg2rad(turn_deg)), np.sin(np.deg2rad(turn_deg))
    rotation = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    pose = np.column_stack([rotation, rotation @ [-x, 0, 0]])
    return View(image_id=1, name="a", camera=camera, cam_from_world=pose)


def plane_map(of: View, distance: float = 4.0, size: int = 1) -> ViewMap:
    """The depth of the plane z = distance, exactly; `size` shrinks the map."""
    height, width = of.camera.height_px // size, of.camera.width_px // size
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    K = index_K(of.camera.resized(width, height))
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ np.linalg.inv(K).T
    in_world = rays @ of.cam_from_world[:, :3]
    depth = distance / in_world[..., 2]
    return ViewMap(view=of, depth=depth.astype(np.float32))


def with_depth(view_map: ViewMap, depth: npt.ArrayLike) -> ViewMap:
    return dataclasses.replace(view_map, depth=np.asarray(depth, np.float32))


def test_a_map_confirms_itself_wherever_it_has_depth() -> None:
    exact = plane_map(view(0, turn_deg=10))
    holes = exact.depth * (np.random.default_rng(0).random(exact.depth.shape) > 0.3)
    holey = with_depth(exact, holes)
    np.testing.assert_array_equal(confirmed(holey, [holey], 1e-6), holes > 0)


@pytest.mark.parametrize("size", [1, 2])
def test_exact_maps_confirm_each_other_where_both_views_look(size: int) -> None:
    reference, other = plane_map(view(0)), plane_map(view(0.8), size=size)
    found = confirmed(reference, [other], 1e-3)
    # 0.8 to the side at a depth of 4 is 6 px.
    assert found[:, 8:].all()
    assert not found[:, :5].any()


def test_what_is_farther_off_than_the_limit_is_not_confirmed() -> None:
    reference, other = plane_map(view(0)), plane_map(view(0.4, turn_deg=5))
    wrong = with_depth(other, other.depth * 1.02)
    assert not confirmed(reference, [wrong], 0.01).any()
    assert confirmed(reference, [wrong], 0.04).any()


def test_one_map_that_agrees_is_enough() -> None:
    reference, other = plane_map(view(0)), plane_map(view(0.4))
    wrong = with_depth(other, other.depth * 2)
    both = confirmed(reference, [wrong, other], 0.01)
    np.testing.assert_array_equal(both, confirmed(reference, [other], 0.01))
    twice = num_confirming(reference, [other, wrong, other], 0.01)
    np.testing.assert_array_equal(twice, 2 * both)
    assert both.any()
    assert not confirmed(reference, [], 0.01).any()


def test_holes_and_what_lies_behind_a_view_confirm_nothing() -> None:
    reference = plane_map(view(0))
    empty = with_depth(reference, np.zeros_like(reference.depth))
    behind = plane_map(view(0, turn_deg=180))
    behind = with_depth(behind, np.full_like(behind.depth, 4))
    assert not confirmed(reference, [empty, behind], 0.5).any()
    assert not confirmed(empty, [reference], 0.5).any()


def depth_map(values: npt.ArrayLike) -> DepthMap:
    return np.asarray(values, np.float32)


def test_shares_count_holes_as_wrong_and_only_the_pixels_that_count() -> None:
    expected = depth_map([[1, 2, 4, 8, 0]])
    depth = depth_map([[1.005, 2.03, 0, 80, 5]])
    where = np.array([[True, True, True, False, False]])
    shares = shares_within(depth, expected, where, (0.01, 0.02))
    assert shares == {
        "0.01": pytest.approx(1 / 3),
        "0.02": pytest.approx(2 / 3),
        "median": pytest.approx(0.015, rel=1e-4),
    }
    assert mean_of([{"0.01": 1.0}, {"0.01": 0.5}]) == {"0.01": 0.75}


def test_shares_of_nothing_or_of_other_shapes_are_refused() -> None:
    depth = depth_map([[1, 2]])
    with pytest.raises(ValueError, match="no pixel counts"):
        shares_within(depth, depth, np.zeros((1, 2), np.bool_), (0.01,))
    with pytest.raises(ValueError, match="shapes"):
        shares_within(depth, depth.T, np.ones((1, 2), np.bool_), (0.01,))
