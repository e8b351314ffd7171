import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from analytic_scene import CAMERA, turned, view_at
from looking_views import lookers

from resdepth_colmap.geometry.view_selection import choose_sources, spread_choices
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.workspace import Workspace, open_workspace
from resdepth_colmap.scene import Scene

ROW = Scene(views=tuple(view_at((0.4 * i, 0.0, 0.0), CAMERA) for i in range(5)))


def scene_with_points(shared: list[int], angles_deg: list[float]) -> Scene:
    """Row 0 of the statistics as given; the others say nothing."""
    num = len(ROW.views)
    num_shared = np.zeros((num, num), dtype=np.int64)
    angle = np.zeros((num, num))
    num_shared[0], num_shared[:, 0] = shared, shared
    angle[0], angle[:, 0] = angles_deg, angles_deg
    return dataclasses.replace(
        ROW, num_points=10, num_shared_points=num_shared, triangulation_angle_deg=angle
    )


def chosen(scene: Scene, num: int = 4, reference: int = 0) -> list[int]:
    return [choice.index for choice in choose_sources(scene, reference, num)]


def test_most_shared_points_win_at_equal_angles() -> None:
    scene = scene_with_points([0, 100, 300, 200, 50], [0, 6, 6, 6, 6])
    assert chosen(scene) == [2, 3, 1, 4]
    assert chosen(scene, 2) == [2, 3]


def test_a_tiny_or_huge_angle_costs_more_than_some_points() -> None:
    scene = scene_with_points([0, 500, 300, 500, 100], [0, 0.5, 8, 50, 8])
    assert chosen(scene)[0] == 2


def test_views_without_a_shared_point_are_left_out_when_others_share_some() -> None:
    assert chosen(scene_with_points([0, 0, 30, 0, 0], [0, 0, 6, 0, 0])) == [2]


def test_the_reason_names_points_and_angle() -> None:
    scene = scene_with_points([0, 312, 0, 0, 0], [0, 6.1, 0, 0, 0])
    (choice,) = choose_sources(scene, 0, 1)
    assert choice.reason == "312 shared points, 6.1 deg"
    assert choice.num_shared_points == 312
    assert choice.angle_deg == pytest.approx(6.1)
    assert choice.baseline == pytest.approx(0.4)


def test_without_points_the_poses_decide_and_the_reason_says_so() -> None:
    choices = choose_sources(ROW, 2, 4)
    assert {choice.index for choice in choices[:2]} == {1, 3}
    assert choices[0].reason.startswith("no sparse points: ")
    assert choices[0].reason.endswith("overlap by pose, 0.0 deg between axes")
    assert choices[0].num_shared_points == 0


def test_a_view_that_looks_away_is_never_chosen() -> None:
    away = view_at((0.4, 0.0, 0.0), CAMERA, turned(0.0, np.pi))
    assert chosen(Scene(views=(ROW.views[0], away, ROW.views[2]))) == [2]


def test_round_an_object_the_neighbours_are_chosen() -> None:
    angles = np.radians(30.0) * np.arange(12)
    ring = Scene(
        views=tuple(
            view_at((2 * np.sin(a), 0.0, -2 * np.cos(a)), CAMERA, turned(0.0, a))
            for a in angles
        )
    )
    for index in range(12):
        assert set(chosen(ring, 2, index)) == {(index - 1) % 12, (index + 1) % 12}


@pytest.mark.parametrize("with_points", [False, True])
def test_a_view_at_the_same_place_is_never_chosen(with_points: bool) -> None:
    scene = scene_with_points([0, 9, 9, 9, 9], [0, 6, 6, 6, 6]) if with_points else ROW
    twin = dataclasses.replace(
        scene, views=(ROW.views[0], *ROW.views[:1], *ROW.views[2:])
    )
    assert 1 not in chosen(twin)
    assert choose_sources(twin, 0, 3, candidates=[1]) == ()


def test_a_rotating_camera_has_no_source() -> None:
    views = tuple(
        view_at((1.0, 2.0, 3.0), CAMERA, turned(0.0, a)) for a in (0, 0.1, 0.2)
    )
    assert choose_sources(Scene(views=views), 0, 2) == ()


def test_a_single_view_has_no_source() -> None:
    assert choose_sources(Scene(views=ROW.views[:1]), 0, 2) == ()


def test_only_candidates_are_chosen_each_once() -> None:
    indices = [c.index for c in choose_sources(ROW, 2, 4, candidates=[4, 0, 4, 2])]
    assert sorted(indices) == [0, 4]


def test_the_scale_of_the_scene_does_not_matter() -> None:
    small = Scene(views=tuple(view_at((4e-4 * i, 0, 0), CAMERA) for i in range(5)))
    assert chosen(small, reference=2) == chosen(ROW, reference=2)


def spread(scene: Scene, num: int) -> list[int]:
    choices = choose_sources(scene, 0, len(scene.views))
    return [choice.index for choice in spread_choices(scene, 0, choices, num)]


def test_spread_sources_see_all_of_the_view() -> None:
    scene = lookers()
    assert chosen(scene, 3) == [1, 2, 3]
    for num, num_right in ((3, 1), (4, 2)):  # two see the left of it, if two can
        assert len(set(spread(scene, num)) & {4, 5}) == num_right


def test_all_choices_are_taken_as_they_are_if_they_are_few() -> None:
    scene = lookers()
    assert spread(scene, 5) == spread(scene, 9) == chosen(scene, 5)
    assert spread_choices(scene, 0, (), 3) == ()


def test_the_best_stay_where_others_see_nothing_more() -> None:
    shared = scene_with_points([0, 100, 300, 200, 50], [0, 6, 6, 6, 6])
    near = tuple(view_at((0.01 * i, 0.4 * i, 0.0), CAMERA) for i in range(5))
    scene = dataclasses.replace(shared, views=near)
    assert spread(scene, 2) == chosen(scene, 2) == [2, 3]


def test_a_source_too_near_to_tell_depth_sees_nothing() -> None:
    scene = lookers()
    views = list(scene.views)
    for index in (4, 5):  # they look right from where the first one stands
        views[index] = view_at((0.0, 0.001 * index, 0.0), CAMERA, turned(0.0, 0.6))
    assert spread(dataclasses.replace(scene, views=tuple(views)), 3) == [1, 2, 3]


def scene_of(workspace: Workspace) -> Scene:
    return read_scene(workspace.sparse_path, workspace.images_path, workspace.path)


@pytest.mark.data
def test_round_the_walnut_the_neighbours_are_chosen(
    shared_data: Callable[[str], Path],
) -> None:
    scene = scene_of(open_workspace(shared_data("walnut")))
    for index in range(12):
        assert set(chosen(scene, 2, index)) == {(index - 1) % 12, (index + 1) % 12}
