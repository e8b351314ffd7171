import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from analytic_scene import CAMERA, view_at

from resdepth_colmap.geometry.depth_range import depth_range
from resdepth_colmap.geometry.projection import transform
from resdepth_colmap.geometry.view_selection import choose_sources
from resdepth_colmap.io.colmap.maps import read_depth_map
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.workspace import Workspace, open_workspace
from resdepth_colmap.scene import Scene

ROW = Scene(views=tuple(view_at((0.4 * i, 0.0, 0.0), CAMERA) for i in range(3)))


def test_with_sparse_points_it_is_colmaps_range() -> None:
    ranges = np.array([[2.0, 9.0], [0.0, 0.0], [0.0, 0.0]])
    scene = dataclasses.replace(ROW, depth_range=ranges)
    assert depth_range(scene, 0, [1]) == (2.0, 9.0)


def test_a_view_without_sparse_points_gets_a_range_from_the_poses() -> None:
    scene = dataclasses.replace(ROW, depth_range=np.zeros((3, 2)))
    assert depth_range(scene, 0, [1]) == depth_range(ROW, 0, [1])


def test_parallel_views_look_from_half_overlap_to_a_pixel_of_disparity() -> None:
    near, far = depth_range(ROW, 0, [1])
    half_overlap = 0.4 * CAMERA.fx / (CAMERA.width_px / 2)
    one_pixel = 0.4 * CAMERA.fx
    assert half_overlap / 1.6 < near <= half_overlap
    assert one_pixel <= far < one_pixel * 1.6


def test_a_wider_baseline_sees_farther_but_not_less_near() -> None:
    near_one, far_one = depth_range(ROW, 0, [1])
    near_both, far_both = depth_range(ROW, 0, [1, 2])
    assert far_both > 1.5 * far_one
    assert near_both == pytest.approx(near_one, rel=0.2)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_the_range_scales_with_the_scene(scale: float) -> None:
    views = tuple(view_at((0.4 * i * scale, 0, 0), CAMERA) for i in range(3))
    expected = np.multiply(depth_range(ROW, 0, [1, 2]), scale)
    actual = depth_range(Scene(views=views), 0, [1, 2])
    np.testing.assert_allclose(actual, expected, rtol=1e-6)


@pytest.mark.parametrize("sources", [[], [0]])
def test_without_points_or_another_place_there_is_no_range(sources: list[int]) -> None:
    with pytest.raises(ValueError, match=r"view\.png.*has a baseline"):
        depth_range(ROW, 0, sources)


def scene_of(workspace: Workspace) -> Scene:
    return read_scene(workspace.sparse_path, workspace.images_path, workspace.path)


@pytest.mark.data
def test_the_walnut_lies_inside_the_range_of_each_view(
    shared_data: Callable[[str], Path],
) -> None:
    open3d = pytest.importorskip("open3d")
    folder = shared_data("walnut")
    cloud = open3d.io.read_point_cloud(str(folder / "reference" / "reference.ply"))
    scene = scene_of(open_workspace(folder))
    for index, view in enumerate(scene.views):
        sources = [choice.index for choice in choose_sources(scene, index, 4)]
        near, far = depth_range(scene, index, sources)
        depth = transform(view.cam_from_world, np.asarray(cloud.points))[:, 2]
        assert near < depth.min()
        assert depth.max() < far
        assert far / near < 10


@pytest.mark.data
def test_the_plants_depths_lie_inside_the_range(
    shared_data: Callable[[str], Path],
) -> None:
    workspace = open_workspace(shared_data("plant"))
    scene = scene_of(workspace)
    for index, view in enumerate(scene.views):
        sources = [choice.index for choice in choose_sources(scene, index, 4)]
        near, far = depth_range(scene, index, sources)
        depth = read_depth_map(workspace.depth_map_path(view.name, "geometric"))
        low, high = np.percentile(depth[depth > 0], [1, 99])
        assert near < low
        assert high < far
