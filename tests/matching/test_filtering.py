"""Laws of the filter, on an exact plane seen by five cameras."""

import numpy as np
import numpy.typing as npt
import pytest
from planes import plane_views

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.geometry.projection import back_project, project, transform
from resdepth_colmap.matching.filtering import Filtered, filter_result
from resdepth_colmap.matching.patch_match import MatchResult, MatchView
from resdepth_colmap.scene import cam_from_cam

PLANE = plane_views()
DEPTHS = [view.depth for view in PLANE]
VIEWS = [
    MatchView(
        gray=np.zeros_like(view.depth),
        K=index_K(view.view.camera),
        cam_from_world=view.view.cam_from_world,
    )
    for view in PLANE
]
NUM_SOURCES = len(PLANE) - 1
SHAPE = DEPTHS[0].shape


def exact(**changes: npt.NDArray[np.float32]) -> MatchResult:
    """The truth of the first view, that all sources look alike in, but for changes."""
    truth = {
        "depth": DEPTHS[0],
        "normals": PLANE[0].normals,
        "source_costs": np.zeros((NUM_SOURCES, *SHAPE), np.float32),
    }
    return MatchResult(**{**truth, **changes})


def filtered(result: MatchResult, geometric: bool = True, **options: float) -> Filtered:
    config = StereoConfig(**options)  # type: ignore[arg-type] # passed on
    depths = DEPTHS[1:] if geometric else None
    return filter_result(result, VIEWS[0], VIEWS[1:], depths, config)


def seen_by(margin_px: float) -> npt.NDArray[np.int64]:
    """How many sources see each pixel of the first view at least so far inside."""
    xyz = back_project(DEPTHS[0], VIEWS[0].K)
    counts = np.zeros(SHAPE, np.int64)
    for source in PLANE[1:]:
        moved = transform(cam_from_cam(source.view, PLANE[0].view), xyz)
        xy, _ = project(moved, index_K(source.view.camera))
        last = np.array(SHAPE[::-1]) - 1
        counts += ((xy >= margin_px) & (xy <= last - margin_px)).all(axis=-1)
    return counts


def test_the_truth_stays_where_two_sources_see_it_and_nowhere_else() -> None:
    result, _ = filtered(exact())
    assert (result.depth[seen_by(1.0) >= 2] > 0).all()
    assert not result.depth[seen_by(-1.0) < 2].any()
    assert 0.5 < np.mean(result.depth > 0) < 1  # both cases are there
    kept = result.depth > 0
    assert np.array_equal(result.depth[kept], DEPTHS[0][kept])
    assert np.array_equal(result.normals.any(axis=2), kept)


@pytest.mark.parametrize("factor", [0.8, 1.25])
def test_a_depth_that_leads_elsewhere_is_dropped(factor: float) -> None:
    depth = DEPTHS[0].copy()
    depth[30, 40] *= factor
    assert filtered(exact(depth=depth)).surface.depth[30, 40] == 0
    assert filtered(exact(depth=depth)).surface.depth[30, 39] > 0
    alone = filtered(exact(depth=depth), geometric=False).surface.depth
    assert alone[30, 40] > 0  # photographs alone do not tell


def test_a_larger_error_there_and_back_may_be_allowed() -> None:
    depth = DEPTHS[0].copy()
    depth[30, 40] *= 1.2
    assert filtered(exact(depth=depth)).surface.depth[30, 40] == 0
    loose = filtered(exact(depth=depth), filter_geom_consistency_max_cost=5.0)
    assert loose.surface.depth[30, 40] > 0


def test_patches_that_look_unlike_do_not_agree() -> None:
    costs = np.zeros((NUM_SOURCES, *SHAPE), np.float32)
    costs[:, 10, 20], costs[:, 10, 21] = 0.95, 0.85
    result, agrees = filtered(exact(source_costs=costs))
    assert result.depth[10, 20] == 0
    assert result.depth[10, 21] > 0
    assert not agrees[:, 10, 20].any()
    assert filtered(exact(source_costs=costs), filter_min_ncc=0.0).surface.depth[10, 20]


def test_rays_that_meet_at_a_small_angle_do_not_agree() -> None:
    assert filtered(exact(), filter_min_triangulation_angle=4.0).surface.depth.any()
    assert not filtered(
        exact(), filter_min_triangulation_angle=20.0
    ).surface.depth.any()


def test_a_surface_is_seen_from_its_front_only() -> None:
    assert not filtered(exact(normals=-PLANE[0].normals)).agrees.any()


def test_the_sources_that_agree_are_named_and_only_where_depth_is_kept() -> None:
    costs = np.zeros((NUM_SOURCES, *SHAPE), np.float32)
    costs[2] = 2.0
    result, agrees = filtered(exact(source_costs=costs))
    assert not agrees[2].any()
    assert np.array_equal(agrees.sum(axis=0) >= 2, result.depth > 0)
    assert not agrees[:, result.depth == 0].any()
    needs_four, _ = filtered(exact(source_costs=costs), filter_min_num_consistent=4)
    assert not needs_four.depth.any()


def test_with_one_source_that_one_has_to_agree() -> None:
    config = StereoConfig()
    one = exact(source_costs=np.zeros((1, *SHAPE), np.float32))
    kept = filter_result(one, VIEWS[0], VIEWS[1:2], DEPTHS[1:2], config).surface.depth
    assert 0.3 < np.mean(kept > 0) < 1


def test_a_source_at_the_same_place_or_without_depth_agrees_with_nothing() -> None:
    config = StereoConfig()
    one = exact(source_costs=np.zeros((1, *SHAPE), np.float32))
    same = filter_result(one, VIEWS[0], VIEWS[:1], DEPTHS[:1], config)
    assert not same.agrees.any()
    none = filter_result(one, VIEWS[0], VIEWS[1:2], [0 * DEPTHS[1]], config)
    assert not none.agrees.any()


def test_what_has_no_depth_stays_without() -> None:
    depth = DEPTHS[0].copy()
    depth[:, :5] = 0
    result, agrees = filtered(exact(depth=depth), filter_min_num_consistent=0)
    assert not result.depth[:, :5].any()
    assert not result.normals[:, :5].any()
    assert not agrees[:, :, :5].any()
    assert (result.depth[:, 5:] > 0).all()
