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

from resdepth_colmap.geometry.inverse_depth import invert_map
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.pipeline.source_maps import (
    SourceMap,
    carried_inverse_depth,
    confirmed_by,
    goes_along_rows,
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
    carried = carried_inverse_depth(right, K, [map_of(source)])
    arrived = carried > 0
    assert arrived.mean() > 0.6
    assert confirmed_by(right, carried)[arrived].mean() > 0.95
    wrong: FloatMap = (1.05 * right).astype(np.float32)
    carried = carried_inverse_depth(wrong, K, [map_of(source)])
    assert not confirmed_by(wrong, carried).any()


def test_of_several_maps_the_one_that_confirms_counts() -> None:
    reference, source = two_views()
    right = inverse_seen_by(reference)
    maps = [map_of(source, factor) for factor in (0.8, 1.0, 1.3)]
    for order in (maps, maps[::-1]):
        carried = carried_inverse_depth(right, K, order)
        alone = carried_inverse_depth(right, K, [maps[1]])
        confirmed = confirmed_by(right, alone)
        assert confirmed_by(right, carried)[confirmed].all()


def test_without_maps_nothing_is_said() -> None:
    right = inverse_seen_by(two_views()[0])
    assert not carried_inverse_depth(right, K, []).any()
    assert not confirmed_by(right, np.zeros_like(right)).any()


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
    carried = carried_inverse_depth(right, K, [map_of(half)])
    confirmed = confirmed_by(right, carried)
    assert confirmed[carried > 0].mean() > 0.95
