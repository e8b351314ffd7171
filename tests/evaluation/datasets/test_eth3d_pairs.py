"""Laws of choosing stereo pairs."""

import dataclasses

import numpy as np
import pytest
from analytic_scene import CAMERA, view_at

from resdepth_colmap.evaluation.datasets.eth3d_pairs import Pair, choose_pairs
from resdepth_colmap.geometry.view_selection import choose_sources
from resdepth_colmap.scene import Scene

NUM_VIEWS = 6


def row_of_views(step: float, *, angle_deg: float = 5.0) -> Scene:
    """Cameras side by side before a wall 4 away; neighbours share the most points."""
    views = tuple(view_at((step * i, 0, 0), CAMERA) for i in range(NUM_VIEWS))
    indices = np.arange(NUM_VIEWS)
    apart = np.abs(indices[:, None] - indices)
    shared = np.where(apart > 0, 100 // np.maximum(apart, 1) + indices + 1, 0)
    return Scene(
        views=views,
        num_points=1000,
        num_shared_points=shared.astype(np.int64),
        triangulation_angle_deg=angle_deg * apart,
        depth_range=np.tile([3.0, 6.0], (NUM_VIEWS, 1)),
    )


def test_no_view_is_in_two_pairs_while_others_are_left() -> None:
    pairs = choose_pairs(row_of_views(0.4), range(NUM_VIEWS), 3)
    assert len(pairs) == 3
    assert len({index for pair in pairs for index in pair}) == 6
    assert all(abs(pair.reference - pair.source) == 1 for pair in pairs)


def test_more_pairs_than_that_share_views() -> None:
    pairs = choose_pairs(row_of_views(0.4), range(NUM_VIEWS), 5)
    assert len(pairs) == 5 == len({pair.reference for pair in pairs})
    assert len(choose_pairs(row_of_views(0.4), range(NUM_VIEWS), 99)) == NUM_VIEWS


def test_only_views_with_truth_are_references() -> None:
    pairs = choose_pairs(row_of_views(0.4), [2], 4)
    assert len(pairs) == 1 and pairs[0].reference == 2


def test_views_that_hardly_overlap_are_no_pair() -> None:
    assert choose_pairs(row_of_views(3.0), range(NUM_VIEWS), 4) == ()


@pytest.mark.parametrize("angle_deg", [1.0, 16.0])
def test_an_unreasonable_baseline_is_no_pair(angle_deg: float) -> None:
    scene = row_of_views(0.4, angle_deg=angle_deg)
    chosen = choose_pairs(scene, range(NUM_VIEWS), 4)
    # At 1 degree a view further away is at a reasonable angle; at 16 none is.
    assert all(abs(pair.reference - pair.source) > 1 for pair in chosen)
    assert bool(chosen) == (angle_deg == 1.0)


def test_the_next_best_source_serves_where_the_best_is_unreasonable() -> None:
    scene = row_of_views(0.4)
    indices = np.arange(NUM_VIEWS)
    is_next = np.abs(indices[:, None] - indices) == 1
    angles = np.where(is_next, 17.0, 8.0)  # neighbours still score highest
    wide = dataclasses.replace(scene, triangulation_angle_deg=angles)
    assert choose_sources(wide, 0, 1)[0].index == 1
    assert choose_pairs(wide, [0], 1) == (Pair(0, 2),)


def test_without_points_the_poses_decide() -> None:
    scene = Scene(views=row_of_views(0.4).views)
    assert choose_pairs(scene, [0], 1)[0].reference == 0


def test_the_choice_does_not_depend_on_the_order() -> None:
    scene = row_of_views(0.4)
    backwards = choose_pairs(scene, list(reversed(range(NUM_VIEWS))), 3)
    assert backwards == choose_pairs(scene, range(NUM_VIEWS), 3)
    assert all(isinstance(pair, Pair) for pair in backwards)
