"""Laws of what other views' depth maps say."""

import dataclasses

import numpy as np
import pytest
from analytic_scene import (
    CAMERA,
    PLANE_NORMAL,
    PLANE_OFFSET,
    depth_of_plane,
    turned,
    two_views,
    view_at,
)
from hypothesis import assume, given
from hypothesis import strategies as st

from resdepth_colmap.geometry.inverse_depth import invert_map
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.pipeline.refine.cross_view import (
    SourceMap,
    goes_along_rows,
    reprojected_depth,
    start_from,
)
from resdepth_colmap.scene import FloatMap, View, cam_from_cam

SIZE_PX = (CAMERA.height_px, CAMERA.width_px)
K = index_K(CAMERA)


def plane_seen_by(view: View) -> FloatMap:
    return depth_of_plane(view, PLANE_NORMAL, PLANE_OFFSET).astype(np.float32)


def inverse_seen_by(view: View) -> FloatMap:
    return invert_map(plane_seen_by(view))


def map_of(source: View, factor: float = 1.0) -> SourceMap:
    return SourceMap(
        depth=plane_seen_by(source) * np.float32(factor),
        K=index_K(source.camera),
        source_from_reference=cam_from_cam(source, two_views()[0]),
    )


def test_a_right_map_confirms_a_right_depth_and_not_a_wrong_one() -> None:
    reference, source = two_views()
    right = inverse_seen_by(reference)
    reprojected, num_consistent = reprojected_depth(right, K, [map_of(source)])
    arrived = reprojected > 0
    assert arrived.mean() > 0.6
    assert num_consistent[arrived].mean() > 0.95
    np.testing.assert_allclose(reprojected[arrived], right[arrived], rtol=0.02)
    for factor in (0.8, 1.2):  # more than a pixel
        wrong: FloatMap = (factor * right).astype(np.float32)
        assert not reprojected_depth(wrong, K, [map_of(source)]).num_consistent.any()


def test_of_several_maps_the_one_that_confirms_counts() -> None:
    reference, source = two_views()
    right = inverse_seen_by(reference)
    maps = [map_of(source, factor) for factor in (0.8, 1.0, 1.3)]
    alone = reprojected_depth(right, K, [maps[1]])
    consistent = alone.num_consistent > 0
    for order in (maps, maps[::-1]):
        together = reprojected_depth(right, K, order)
        np.testing.assert_array_equal(together.num_consistent, alone.num_consistent)
        change = np.abs(together.inverse_depth - right)
        assert (change <= np.abs(alone.inverse_depth - right))[consistent].all()


def test_each_map_that_says_the_same_is_counted() -> None:
    reference, source = two_views()
    right = inverse_seen_by(reference)
    once = reprojected_depth(right, K, [map_of(source)]).num_consistent
    maps = [map_of(source), map_of(source, 1.3), map_of(source), map_of(source)]
    counts = reprojected_depth(right, K, maps).num_consistent
    np.testing.assert_array_equal(counts, 3 * once)


def test_without_maps_nothing_is_said() -> None:
    right = inverse_seen_by(two_views()[0])
    reprojected, num_consistent = reprojected_depth(right, K, [])
    assert not reprojected.any()
    assert not num_consistent.any()


@given(st.floats(0.002, 0.1), st.floats(-0.2, 0.2))
def test_a_pixel_of_the_other_image_is_allowed_however_short_the_baseline(
    baseline: float, change: float
) -> None:
    reference = two_views()[0]
    source = view_at((baseline, 0.0, 0.0), CAMERA)
    wall = np.full(SIZE_PX, 4.0, np.float32)
    other = dataclasses.replace(
        map_of(source),
        depth=wall,
        source_from_reference=cam_from_cam(source, reference),
    )
    found = invert_map((wall / (1 + change)).astype(np.float32))
    moved_px = abs(change) / 4.0 * baseline * CAMERA.fx
    assume(abs(moved_px - 1.0) > 0.01 and abs(abs(change) / (1 + change) - 0.02) > 1e-4)
    is_consistent_with = reprojected_depth(found, K, [other]).num_consistent > 0
    expected = moved_px < 1.0 or abs(change) / (1 + change) < 0.02
    assert is_consistent_with[:, 8:-8].all() == expected


@pytest.mark.parametrize(
    ("center", "along_rows"),
    [((0.5, 0.1, 0), True), ((-0.3, 0, 0.1), True), ((0.1, 0.6, 0), False)],
)
@pytest.mark.parametrize("turn", [0.0, 0.2])
def test_the_way_of_the_epipolar_lines_is_that_of_the_baseline(
    center: tuple[float, float, float], along_rows: bool, turn: float
) -> None:
    source = view_at(center, CAMERA, turned(turn, -turn))
    assert goes_along_rows(map_of(source), K, SIZE_PX) == along_rows


def test_a_map_of_another_size_says_the_same() -> None:
    reference, source = two_views()
    half = dataclasses.replace(
        source,
        camera=source.camera.resized(CAMERA.width_px // 2, CAMERA.height_px // 2),
    )
    right = inverse_seen_by(reference)
    reprojected, num_consistent = reprojected_depth(right, K, [map_of(half)])
    assert num_consistent[reprojected > 0].mean() > 0.95


def test_the_holes_of_a_filtered_map_take_what_other_views_measured() -> None:
    reference, source = two_views()
    depth = plane_seen_by(reference)
    holes = np.zeros(SIZE_PX, bool)
    holes[10:30, 24:40] = True
    found = np.where(holes, 0, depth)
    start = start_from(found, K, [map_of(source)])
    inverse_depth = inverse_seen_by(reference)
    seen = reprojected_depth(inverse_depth, K, [map_of(source)]).num_consistent > 0
    error = np.abs(start.inverse_depth * depth - 1)
    assert error[holes & seen].max() < 0.02
    np.testing.assert_array_equal(start.valid, ~holes)
    assert start.num_consistent is not None
    assert not start.num_consistent[holes].any()
    np.testing.assert_array_equal(
        start.inverse_depth[~holes], invert_map(found)[~holes]
    )


def test_maps_of_another_scene_are_not_listened_to() -> None:
    reference, source = two_views()
    depth = plane_seen_by(reference)
    alone = start_from(depth, K, [])
    start = start_from(depth, K, [map_of(source, 3.0)])
    assert start.reprojected is None and start.num_consistent is None
    np.testing.assert_array_equal(start.inverse_depth, alone.inverse_depth)
    assert start.valid.all()
