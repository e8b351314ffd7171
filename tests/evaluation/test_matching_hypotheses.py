"""Laws of the costs of hypotheses, on views of an exact plane."""

import dataclasses

import numpy as np
import numpy.typing as npt
import pytest
from planes import PlaneView, plane_views

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.evaluation.matching_evidence import costs_of_both, preferences
from resdepth_colmap.evaluation.matching_hypotheses import (
    Hypotheses,
    PhotoCost,
    best_half,
)
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.matching.patch_match import MatchView

WRONG = 1.25  # the views are close together and their texture is smooth
MARGIN = 0.02
COLMAP = StereoConfig(window_radius=5, window_step=1, sigma_color=0.2)


@pytest.fixture(scope="module")
def plane() -> list[PlaneView]:
    return plane_views(80, 60)


def match_view(of: PlaneView) -> MatchView:
    gray = of.image.astype(np.float32)
    gray = gray.mean(axis=2) if gray.ndim == 3 else gray
    view = of.view
    return MatchView(
        gray=gray / np.float32(255),
        K=index_K(view.camera),
        cam_from_world=view.cam_from_world,
    )


def middle(of: PlaneView) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]:
    """Pixels off the border, and their true depth."""
    x, y = np.meshgrid(np.arange(25, 55, 3), np.arange(20, 40, 3))
    pixels = np.column_stack([x.ravel(), y.ravel()]).astype(np.int64)
    return pixels, of.depth[pixels[:, 1], pixels[:, 0]].astype(np.float64)


def normals_at(of: PlaneView, pixels: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    return of.normals[pixels[:, 1], pixels[:, 0]].astype(np.float64)


@pytest.mark.parametrize("widens", [True, False])
def test_the_true_plane_matches_and_a_wrong_one_does_not(
    plane: list[PlaneView], widens: bool
) -> None:
    reference, *sources = (match_view(it) for it in plane)
    cost = PhotoCost(reference, sources, COLMAP, widens=widens)
    pixels, depth = middle(plane[0])
    normals = normals_at(plane[0], pixels)
    true = best_half(cost.of_planes(pixels, 1 / depth, normals))
    wrong = best_half(cost.of_planes(pixels, 1 / (WRONG * depth), normals))
    assert np.median(true) < 0.05
    assert np.median(wrong) > np.median(true) + 0.1


def test_trials_only_better_a_hypothesis_and_never_leave_it(
    plane: list[PlaneView],
) -> None:
    reference, *sources = (match_view(it) for it in plane)
    cost = PhotoCost(reference, sources, StereoConfig())
    pixels, depth = middle(plane[0])
    facing = np.tile([0.0, 0.0, -1.0], (len(pixels), 1))
    wrong = Hypotheses(depth=WRONG * depth, normals=[facing])
    true = dataclasses.replace(wrong, depth=depth)
    start = best_half(cost.of_planes(pixels, 1 / depth, facing))
    found = cost.least(pixels, true, np.random.default_rng(0))
    assert (found <= start + 1e-9).all()
    assert found.mean() < start.mean()
    # A hypothesis that is off by a quarter does not find the truth.
    elsewhere = cost.least(pixels, wrong, np.random.default_rng(0))
    assert np.median(elsewhere) > np.median(found) + 0.1


def test_sources_that_do_not_see_a_plane_are_neither_good_nor_bad(
    plane: list[PlaneView],
) -> None:
    reference, source, *_ = (match_view(it) for it in plane)
    behind = dataclasses.replace(
        source, cam_from_world=np.diag([-1.0, 1, -1]) @ source.cam_from_world
    )
    cost = PhotoCost(reference, [behind], StereoConfig())
    pixels, depth = middle(plane[0])
    costs = cost.of_planes(pixels, 1 / depth, normals_at(plane[0], pixels))
    np.testing.assert_array_equal(costs, np.ones((len(pixels), 1)))


def test_the_better_half_of_the_sources_counts() -> None:
    costs = np.array([[0.9, 0.1, 0.3, 2.0], [1.0, 1.0, 0.0, 0.0]])
    np.testing.assert_allclose(best_half(costs), [0.2, 0.0])
    np.testing.assert_allclose(best_half(costs[:, :3]), [0.2, 0.5])


def test_the_photographs_prefer_the_true_depth_by_every_cost(
    plane: list[PlaneView],
) -> None:
    views = [match_view(it) for it in plane]
    pixels, depth = middle(plane[0])
    normals = [normals_at(plane[0], pixels)]
    found = costs_of_both(views, pixels, depth, WRONG * depth, normals, MARGIN)
    swapped = costs_of_both(views, pixels, WRONG * depth, depth, normals, MARGIN)
    assert set(found) == {"own_6", "own_20", "colmap_6", "colmap_20"}
    for label, shares in found.items():
        assert shares["ours"] > 0.8
        assert shares["theirs"] < 0.1
        assert shares["ours"] + shares["theirs"] + shares["tie"] == pytest.approx(1)
        assert swapped[label]["theirs"] == shares["ours"]


def test_a_difference_within_the_margin_is_a_tie() -> None:
    ours, theirs = np.array([0.1, 0.2, 0.6, 1.0]), np.array([0.2, 0.1, 0.62, 0.4])
    shares = preferences(ours, theirs, 0.05)
    assert shares == {"ours": 0.25, "theirs": 0.5, "tie": 0.25, "neither": 0.25}
