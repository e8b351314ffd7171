"""Laws of what a network must not change, and of what it is not given at all."""

import dataclasses

import numpy as np
import pytest
from analytic_scene import PLANE_NORMAL, PLANE_OFFSET, depth_of_plane, two_views
from refined_plane import TILES, expect_error, network, view

from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.pipeline.refine import ViewInputs, refine_view
from resdepth_colmap.pipeline.source_maps import SourceMap
from resdepth_colmap.scene import DepthMap, cam_from_cam


def with_and_without_rule(initial: ViewInputs) -> tuple[DepthMap, DepthMap]:
    """The depth that a network gives that changes much, with the rule and without."""
    net = network(seed=1)
    without = dataclasses.replace(TILES, keep_confirmed=False)
    configs = (TILES, without)
    first, second = (refine_view(initial, net, config).depth for config in configs)
    return first, second


def test_what_the_photographs_confirm_stays_and_outliers_do_not() -> None:
    initial = view()
    exact = depth_of_plane(two_views()[0], PLANE_NORMAL, PLANE_OFFSET)
    wrong = np.zeros(exact.shape, bool)
    wrong[10:20, 10:20] = True
    depth = np.where(wrong, 0.5 * exact, exact).astype(np.float32)
    initial = dataclasses.replace(initial, depth=depth)
    with_rule, without = with_and_without_rule(initial)
    kept = np.isclose(with_rule, depth, rtol=1e-6)
    changed = ~np.isclose(with_rule, without, rtol=1e-6)
    assert kept.mean() > 2 * np.isclose(without, depth, rtol=1e-6).mean()
    # What the rule changed, it set back to the initial depth, by less than 5 %.
    assert kept[changed].all()
    assert (np.abs(1 / without - 1 / depth)[changed] < 0.05 / depth[changed]).all()


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


def test_what_another_map_confirms_stays() -> None:
    kept = {}
    initial = exact_view()
    for factor in (1.0, 1.3):
        looked = dataclasses.replace(initial, source_maps=maps_of([factor]))
        with_rule, without = with_and_without_rule(looked)
        changed = ~np.isclose(without, initial.depth, rtol=1e-4)
        same = np.isclose(with_rule, initial.depth, rtol=1e-6)
        kept[factor] = same[changed].mean()
    assert kept[1.0] > 0.6
    assert kept[1.3] < 0.05


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
    without = dataclasses.replace(TILES, keep_confirmed=False)
    free = refine_view(initial, net, without).depth
    assert not np.isclose(free, unchanged, rtol=1e-3).all()
