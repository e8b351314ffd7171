"""Laws of what a network must not change, and of what it is not given at all."""

import dataclasses

import numpy as np
import pytest
import torch
from analytic_scene import PLANE_NORMAL, PLANE_OFFSET, depth_of_plane, two_views
from refined_plane import TILES, expect_error, network, view

from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.pipeline.refine.acceptance import SUPPORTED_ERROR, UpdateGate
from resdepth_colmap.pipeline.refine.cross_view import SourceMap, start_from
from resdepth_colmap.pipeline.refine.network_inputs import ViewTensors, seen_by_sources
from resdepth_colmap.pipeline.refine.source_sampler import SourceTensors
from resdepth_colmap.pipeline.refine.view import ViewInputs, refine_view
from resdepth_colmap.scene import DepthMap, cam_from_cam


def test_the_photometric_error_is_small_where_the_photographs_agree() -> None:
    right = facing_wall()
    wrong = right._replace(inverse_depth=1.3 * right.inverse_depth)
    middle = (..., slice(4, -4), slice(4, -DISPARITY_PX - 8))
    assert seen_by_sources(right, 1).error[middle].max() < SUPPORTED_ERROR
    assert seen_by_sources(wrong, 1).error[middle].median() > SUPPORTED_ERROR


def with_and_without_rule(initial: ViewInputs) -> tuple[DepthMap, DepthMap]:
    """The depth that a network gives that changes much, with the rule and without."""
    net = network(seed=1)
    without = dataclasses.replace(TILES, update_gating=False)
    configs = (TILES, without)
    first, second = (refine_view(initial, net, config).depth for config in configs)
    return first, second


DISPARITY_PX = 20
INVERSE_DEPTH = 0.5


def facing_wall(texture: float = 1.0, num_consistent: int | None = None) -> ViewTensors:
    """Two views of a wall of random texture, at its true depth."""
    rng = np.random.default_rng(0)
    wall = torch.from_numpy(0.5 + texture * (rng.random((1, 1, 32, 84)) - 0.5)).float()
    K = torch.tensor([[[100.0, 0.0, 32.0], [0.0, 100.0, 16.0], [0.0, 0.0, 1.0]]])
    pose = torch.eye(3, 4)[None].clone()
    pose[..., 0, 3] = DISPARITY_PX / 100.0 / INVERSE_DEPTH
    depth = torch.full((1, 1, 32, 64), INVERSE_DEPTH)
    valid = torch.ones_like(depth, dtype=torch.bool)
    return ViewTensors(
        inverse_depth=depth,
        valid=valid,
        gray=wall[..., DISPARITY_PX:],
        K=K,
        sources=(SourceTensors(wall[..., :64], K, pose),),
        num_consistent=(
            None if num_consistent is None else valid.to(torch.uint8) * num_consistent
        ),
    )


def kept_share(view: ViewTensors, change: float, num_errors: float = 1e6) -> float:
    """Where the source sees it, of a relative change of so many expected errors."""
    gate = UpdateGate(view, 1, seen_by_sources(view, 1).error)
    error = torch.full_like(view.inverse_depth, abs(change) / num_errors)
    refined = view.inverse_depth * (1.0 + change)
    is_rejected = gate.rejects(refined, error * view.inverse_depth)
    return float(is_rejected[..., 4 : -DISPARITY_PX - 8].float().mean())


def test_a_small_change_that_the_photographs_contradict_is_not_taken() -> None:
    assert kept_share(facing_wall(), 0.025) > 0.98
    assert kept_share(facing_wall(texture=0.0, num_consistent=1), 0.025) == 0.0
    assert kept_share(facing_wall(), 0.1) == 0.0  # the correction of an outlier


def test_what_the_photographs_like_better_is_taken_from_any_map() -> None:
    right = facing_wall(num_consistent=1)
    wrong = right._replace(inverse_depth=right.inverse_depth / 1.025)
    assert kept_share(wrong, 0.025) == 0.0


def test_what_more_maps_confirm_stays_within_more_of_the_expected_error() -> None:
    for texture, num_consistent, num_errors in (
        (1.0, 3, 4.0),  # contradicted by the photographs
        (1.0, 2, 4.0),
        (1.0, 1, 0.5),
        (0.0, 3, 1.0),
        (0.0, 1, 0.3),
        (0.0, 0, 0.1),
        (0.0, None, 0.1),
    ):
        wall = facing_wall(texture, num_consistent)
        assert kept_share(wall, 0.1, 0.98 * num_errors) > 0.98
        assert kept_share(wall, 0.1, 1.02 * num_errors) < 0.02


def test_what_a_filter_has_left_stays_though_no_photograph_contradicts() -> None:
    wall = facing_wall(texture=0.0)
    assert kept_share(wall, 0.025) == 0.0
    assert kept_share(wall._replace(is_filtered=True), 0.025) == 1.0


def test_a_map_is_filtered_by_its_own_holes_not_by_what_others_deny() -> None:
    whole = exact_view()
    holes = whole.depth.copy()
    holes[::3] = 0.0
    half_denied = whole.depth.copy()
    half_denied[:, ::2] *= 0.5
    for maps in ((), maps_of([1.0])):
        for depth, expected in (
            (whole.depth, False),
            (half_denied, False),
            (holes, True),
        ):
            assert start_from(depth, whole.K, maps).is_filtered == expected


def test_outliers_do_not_stay() -> None:
    initial = view()
    exact = depth_of_plane(two_views()[0], PLANE_NORMAL, PLANE_OFFSET)
    wrong = np.zeros(exact.shape, bool)
    wrong[10:20, 10:20] = True
    depth = np.where(wrong, 0.5 * exact, exact).astype(np.float32)
    initial = dataclasses.replace(initial, depth=depth, source_maps=maps_of([1.0]))
    refined = refine_view(initial, network(), TILES).depth
    assert (refined[wrong] > 0.9 * exact[wrong]).all()
    np.testing.assert_allclose(refined[~wrong], exact[~wrong], rtol=1e-5)


def test_a_hole_is_never_confirmed() -> None:
    initial = view()
    exact = depth_of_plane(two_views()[0], PLANE_NORMAL, PLANE_OFFSET)
    depth = np.where(initial.depth > 0, exact, 0.0).astype(np.float32)
    initial = dataclasses.replace(initial, depth=depth)
    with_rule, without = with_and_without_rule(initial)
    holes = initial.depth == 0
    np.testing.assert_array_equal(with_rule[holes], without[holes])


def test_what_a_filter_left_stays_where_it_is_changed_a_little() -> None:
    initial = dataclasses.replace(view(), sources=())  # nothing to confirm it by
    with_rule, without = with_and_without_rule(initial)
    measured = initial.depth > 0
    safe = np.where(measured, initial.depth, 1.0)
    little = measured & (np.abs(1 / without - 1 / safe) < 0.0499 / safe)
    assert little.any()
    np.testing.assert_allclose(with_rule[little], initial.depth[little], rtol=1e-6)
    np.testing.assert_allclose(with_rule[~measured], without[~measured], rtol=1e-5)


def maps_of(factors: list[float]) -> tuple[SourceMap, ...]:
    """The source's own map of the plane, each time as far off as that."""
    reference, source = two_views()
    depth = depth_of_plane(source, PLANE_NORMAL, PLANE_OFFSET)
    return tuple(
        SourceMap(
            depth=(factor * depth).astype(np.float32),
            K=index_K(source.camera),
            source_from_reference=cam_from_cam(source, reference),
        )
        for factor in factors
    )


def exact_view() -> ViewInputs:
    """A right depth map, and photographs that confirm nothing."""
    initial = view()
    exact = depth_of_plane(two_views()[0], PLANE_NORMAL, PLANE_OFFSET)
    source = initial.sources[0]
    unlike = dataclasses.replace(source, gray=np.full_like(source.gray, 0.5))
    return dataclasses.replace(
        initial,
        depth=exact.astype(np.float32),
        gray=np.full_like(initial.gray, 0.5),
        sources=(unlike,),
    )


def test_what_other_maps_confirm_stays() -> None:
    kept, net = {}, network(seed=1)
    expect_error(net, -5.4)
    for factor in (1.0, 1.3):
        looked = dataclasses.replace(exact_view(), source_maps=maps_of([factor] * 2))
        refined = refine_view(looked, net, TILES).depth
        kept[factor] = np.isclose(refined, looked.depth, rtol=1e-6).mean()
    assert kept[1.0] > 0.3
    assert kept[1.3] < 0.1


def test_what_no_map_confirms_is_completed_before_the_network() -> None:
    initial = exact_view()
    wrong = initial.depth.copy()
    wrong[20:30, 30:34] *= 0.5
    initial = dataclasses.replace(initial, depth=wrong, source_maps=maps_of([1.0, 1.3]))
    exact = exact_view().depth
    for options, limit in (({}, 0.1), ({"source_depth": False}, 0.5)):
        refined = refine_view(initial, network(**options), TILES).depth
        error = np.abs(refined / exact - 1)[20:30, 30:34]
        assert error.max() == pytest.approx(limit, abs=0.1)


def test_a_filtered_map_is_not_completed_from_the_background() -> None:
    initial = dataclasses.replace(view(), source_maps=maps_of([1.3]))
    refined = refine_view(initial, network(), TILES).depth
    measured = initial.depth > 0
    np.testing.assert_allclose(refined[measured], initial.depth[measured], rtol=2e-7)


def test_a_change_within_the_expected_error_is_not_made() -> None:
    initial, net = view(), network(seed=1)
    changed = refine_view(initial, net, TILES).depth
    expect_error(net, 12.0)
    unchanged = refine_view(initial, net, TILES).depth
    measured = initial.depth > 0
    np.testing.assert_allclose(unchanged[measured], initial.depth[measured], rtol=1e-6)
    assert not np.isclose(changed, unchanged, rtol=1e-5).all()
    without = dataclasses.replace(TILES, update_gating=False)
    free = refine_view(initial, net, without).depth
    assert not np.isclose(free, unchanged, rtol=1e-3).all()
