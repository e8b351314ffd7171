"""Laws of the fusion, on exact maps of a sphere before a plane."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest
from fusion_scene import (
    fuse_view_list,
    surface_colors,
    surface_distance,
    surface_normals,
)

from resdepth_colmap.config import FuseConfig
from resdepth_colmap.pipeline.fuse import geometric_consistency as consistency
from resdepth_colmap.pipeline.fuse.geometric_consistency import Consistent, fuse_views
from resdepth_colmap.pipeline.fuse.views import FuseView


def _fuse(views: Sequence[FuseView], **options: float) -> Consistent:
    numbers = range(len(views))
    neighbours = [[other for other in numbers if other != index] for index in numbers]
    return fuse_views(views, neighbours, FuseConfig(**options))  # type: ignore[arg-type]


def _with_depth_times(view: FuseView, factor: float) -> FuseView:
    return dataclasses.replace(view, depth=view.depth * np.float32(factor))


def test_points_lie_on_the_surface_with_its_normals_and_colours() -> None:
    cloud, statistics = _fuse(fuse_view_list())
    assert len(cloud) == statistics.num_points > 2500
    assert surface_distance(cloud.points).max() < 4e-3  # means of a curved surface
    assert np.median(surface_distance(cloud.points)) < 1e-4
    cosine = (cloud.normals * surface_normals(cloud.points)).sum(axis=1)
    assert np.median(cosine) > 0.9999 and cosine.min() > 0.9
    error = np.abs(cloud.colors - surface_colors(cloud.points).astype(float))
    assert np.median(error) <= 2


def test_normals_have_unit_length_and_face_the_cameras() -> None:
    views = fuse_view_list()
    cloud, _ = _fuse(views)
    assert np.linalg.norm(cloud.normals, axis=1) == pytest.approx(1.0, abs=1e-5)
    rotation, translation = (
        views[0].cam_from_world[:, :3],
        views[0].cam_from_world[:, 3],
    )
    towards = -rotation.T @ translation - cloud.points
    assert ((cloud.normals * towards).sum(axis=1) > 0).all()


def test_a_surface_seen_by_many_views_does_not_become_many_clouds() -> None:
    views = fuse_view_list()
    num_pixels = views[0].depth.size
    cloud, statistics = _fuse(views)
    assert len(cloud) < 1.8 * num_pixels
    assert statistics.num_explained > 1.5 * num_pixels


def test_one_view_being_enough_keeps_every_pixel_once() -> None:
    views = fuse_view_list()
    cloud, statistics = _fuse(views, min_num_views=1)
    assert len(cloud) + statistics.num_explained == statistics.num_pixels
    assert statistics.num_pixels == sum(view.depth.size for view in views)
    alone, _ = _fuse(views[:1], min_num_views=1)
    assert len(alone) == views[0].depth.size


def test_a_view_whose_map_is_wrong_contributes_nothing() -> None:
    right = fuse_view_list()
    wrong = [*right[:3], _with_depth_times(right[3], 1.05)]
    cloud, _ = _fuse(wrong)
    expected, _ = _fuse(right[:3])
    # Its own points would lie 0.1 off; a few agree where the wrong sphere cuts a plane.
    assert len(cloud) == pytest.approx(len(expected), abs=5)
    assert surface_distance(cloud.points).max() < 0.02
    assert (surface_distance(cloud.points) > 4e-3).sum() <= 10


def test_in_every_order_a_wrong_view_contributes_nothing() -> None:
    right = fuse_view_list()
    cloud, _ = _fuse([_with_depth_times(right[0], 1.05), *right[1:]])
    expected, _ = _fuse(right[1:])
    assert np.array_equal(cloud.points, expected.points)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_the_scale_of_the_scene_changes_nothing_but_the_scale(scale: float) -> None:
    views = fuse_view_list()
    scaled = [
        dataclasses.replace(
            _with_depth_times(view, scale),
            cam_from_world=view.cam_from_world * [1, 1, 1, scale],
        )
        for view in views
    ]
    (cloud, statistics), (other, others) = _fuse(views), _fuse(scaled)
    # Rounding decides differently on a handful of pixels at the thresholds.
    assert others.num_points == pytest.approx(statistics.num_points, abs=5)
    low, high = cloud.points.min(axis=0), cloud.points.max(axis=0)
    assert other.points.min(axis=0) / scale == pytest.approx(low, rel=1e-3)
    assert other.points.max(axis=0) / scale == pytest.approx(high, rel=1e-3)


def test_far_from_the_origin_points_are_as_consistent() -> None:
    views = fuse_view_list()
    offset = np.array([4e5, 5e6, 300.0])
    moved = []
    for view in views:
        pose = view.cam_from_world.copy()
        pose[:, 3] -= pose[:, :3] @ offset
        moved.append(dataclasses.replace(view, cam_from_world=pose))
    expected = _fuse(views).statistics.num_points
    assert _fuse(moved).statistics.num_points == pytest.approx(expected, abs=5)


def test_holes_contribute_nothing() -> None:
    views = fuse_view_list()
    views[0].depth[:, :20] = 0
    for view in views[1:]:
        view.depth[:] = 0
    _, statistics = _fuse(views, min_num_views=1)
    assert statistics.num_points == statistics.num_pixels == 48 * 44
    assert _fuse(views, min_num_views=2).statistics.num_unseen == 48 * 44


def test_pixels_of_little_confidence_are_holes() -> None:
    views = fuse_view_list()
    confidence = np.ones_like(views[0].depth)
    confidence[:, :20] = 0.3
    doubtful = [dataclasses.replace(view, confidence=confidence) for view in views]
    for view in views:
        view.depth[:, :20] = 0
    cloud, _ = _fuse(doubtful, min_confidence=0.5)
    expected, _ = _fuse(views)
    # The depth arrays are shared, so the holes of `views` are in `doubtful` as well.
    assert np.array_equal(cloud.points, expected.points)
    whole = [
        dataclasses.replace(view, confidence=confidence) for view in fuse_view_list()
    ]
    by_confidence, _ = _fuse(whole, min_confidence=0.5)
    assert np.array_equal(by_confidence.points, expected.points)


def test_normals_that_contradict_each_other_agree_on_nothing() -> None:
    views = fuse_view_list(2)
    turned = dataclasses.replace(views[1], normals=-views[1].normals)
    cloud, statistics = _fuse([views[0], turned])
    assert len(cloud) == 0
    assert statistics.num_normal_disagrees > 0.7 * statistics.num_pixels


def test_a_view_without_normals_agrees_by_depth_alone() -> None:
    views = fuse_view_list()
    bare = [
        dataclasses.replace(view, normals=np.zeros_like(view.normals)) for view in views
    ]
    cloud, statistics = _fuse(bare)
    assert statistics.num_points > 2500 and statistics.num_normal_disagrees == 0
    assert not cloud.normals.any()


def test_two_views_can_be_fused_though_three_are_asked_for() -> None:
    cloud, statistics = _fuse(fuse_view_list(2), min_num_views=3)
    assert statistics.num_views_needed == 2
    assert len(cloud) > 2000 and surface_distance(cloud.points).max() < 4e-3


def test_every_pixel_is_accounted_for_once() -> None:
    views = fuse_view_list()
    _, counts = _fuse([*views[:3], _with_depth_times(views[3], 1.05)])
    assert counts.num_pixels == (
        counts.num_points
        + counts.num_explained
        + counts.num_unseen
        + counts.num_depth_disagrees
        + counts.num_normal_disagrees
    )
    assert counts.num_depth_disagrees >= 0.7 * views[3].depth.size


def test_working_in_small_portions_changes_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    expected, _ = _fuse(fuse_view_list())
    monkeypatch.setattr(consistency, "_PIXELS_AT_ONCE", 1000)
    cloud, _ = _fuse(fuse_view_list())
    assert np.array_equal(cloud.points, expected.points)


def test_without_views_there_are_no_points() -> None:
    cloud, statistics = fuse_views([], [], FuseConfig())
    assert len(cloud) == statistics.num_pixels == 0


def test_progress_is_one_for_each_view() -> None:
    advanced: list[float] = []
    views = fuse_view_list(3)
    fuse_views(views, [[1, 2], [0, 2], [0, 1]], FuseConfig(), advanced.append)
    assert advanced == [1.0, 1.0, 1.0]
