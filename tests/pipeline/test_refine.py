import dataclasses

import numpy as np
import pytest
import torch
from analytic_scene import (
    PLANE_NORMAL,
    PLANE_OFFSET,
    depth_of_plane,
    image_of,
    two_views,
)
from hypothesis import given
from hypothesis import strategies as st

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.network.network_config import (
    InputVariant,
    NetworkConfig,
    Normalisation,
)
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.pipeline.refine import (
    RefinedView,
    SourceView,
    ViewInputs,
    refine_view,
)
from resdepth_colmap.pipeline.source_maps import SourceMap
from resdepth_colmap.scene import DepthMap, cam_from_cam

SMALL = {"levels": 2, "base_channels": 4, "max_channels": 8}
TILES = RefineConfig(tile_px=32, overlap_px=8)
HOLES = 0.2


def view(
    num_sources: int = 1, scale: float = 1.0, outliers: bool = False
) -> ViewInputs:
    reference, source = two_views()
    rng = np.random.default_rng(0)
    exact = depth_of_plane(reference, PLANE_NORMAL, PLANE_OFFSET)
    exact_in_source = depth_of_plane(source, PLANE_NORMAL, PLANE_OFFSET)
    depth = exact * rng.uniform(0.98, 1.02, exact.shape)
    if outliers:
        depth[rng.random(depth.shape) < 0.05] *= 0.1
    depth[rng.random(depth.shape) < HOLES] = 0.0
    pose = cam_from_cam(source, reference)
    pose[:, 3] *= scale
    second = SourceView(
        gray=image_of(source, exact_in_source).astype(np.float32),
        K=index_K(source.camera),
        source_from_reference=pose,
    )
    return ViewInputs(
        depth=(depth * scale).astype(np.float32),
        gray=image_of(reference, exact).astype(np.float32),
        K=index_K(reference.camera),
        sources=(second,) * num_sources,
    )


def network(seed: int | None = None, **options: object) -> ResDepthNet:
    """Fresh without a seed; with one, its head does something, and is sure of it."""
    torch.manual_seed(seed or 0)
    net = ResDepthNet(NetworkConfig.from_mapping(SMALL | options))
    if seed is not None:
        torch.nn.init.normal_(net.head.weight, std=0.05)
        expect_error(net, -12.0)
    return net


def expect_error(net: ResDepthNet, log_scale: float) -> None:
    """Let a network expect an error of about that logarithm everywhere."""
    if net.config.confidence:
        with torch.no_grad():
            assert net.head.bias is not None
            net.head.bias[-1] = log_scale


def with_and_without_rule(initial: ViewInputs) -> tuple[DepthMap, DepthMap]:
    """The depth that a network gives that changes much, with the rule and without."""
    net = network(seed=1)
    without = dataclasses.replace(TILES, keep_confirmed=False)
    configs = (TILES, without)
    first, second = (refine_view(initial, net, config).depth for config in configs)
    return first, second


def check(refined: RefinedView, shape: tuple[int, ...]) -> None:
    assert refined.depth.shape == refined.confidence.shape == shape
    assert refined.normals.shape == (*shape, 3)
    assert refined.depth.dtype == refined.confidence.dtype == np.float32
    assert np.isfinite(refined.depth).all()
    assert (refined.depth > 0).all()
    assert (refined.confidence >= 0).all()
    assert (refined.confidence <= 1).all()
    assert (refined.normals[..., 2] < 0).all()


@pytest.mark.parametrize("normalisation", Normalisation)
@pytest.mark.parametrize("passes", [1, 2])
@pytest.mark.parametrize("outliers", [False, True])
def test_a_fresh_network_gives_the_initial_depth_back(
    normalisation: Normalisation, passes: int, outliers: bool
) -> None:
    initial = view(outliers=outliers)
    config = dataclasses.replace(TILES, passes=passes)
    refined = refine_view(initial, network(normalisation=normalisation), config)
    valid = initial.depth > 0
    np.testing.assert_allclose(refined.depth[valid], initial.depth[valid], rtol=2e-7)
    check(refined, initial.depth.shape)


@pytest.mark.parametrize("variant", InputVariant)
@pytest.mark.parametrize("normalisation", Normalisation)
@pytest.mark.parametrize("num_sources", [0, 1, 3])
@pytest.mark.parametrize("extras", [False, True])
def test_every_variant_gives_whole_maps(
    variant: InputVariant, normalisation: Normalisation, num_sources: int, extras: bool
) -> None:
    net = network(
        seed=1,
        variant=variant,
        normalisation=normalisation,
        num_sources=2,
        valid=extras,
        photo_consistency=extras,
        gate=extras,
        confidence=extras,
    )
    initial = view(num_sources, outliers=True)
    refined = refine_view(initial, net, dataclasses.replace(TILES, passes=2))
    check(refined, initial.depth.shape)


@pytest.mark.parametrize("normalisation", Normalisation)
@pytest.mark.parametrize("num_sources", [0, 1])
@pytest.mark.parametrize("scale", [0.01, 8.0, 300.0])
def test_the_scale_of_the_scene_only_scales_the_depth(
    normalisation: Normalisation, num_sources: int, scale: float
) -> None:
    net = network(seed=2, normalisation=normalisation)
    one = refine_view(view(num_sources), net, TILES)
    scaled = refine_view(view(num_sources, scale=scale), net, TILES)
    np.testing.assert_allclose(scaled.depth, scale * one.depth, rtol=1e-3)
    np.testing.assert_allclose(scaled.confidence, one.confidence, atol=1e-3)
    assert np.abs(one.depth / view().depth.clip(1) - 1).max() > 0.01  # it did something


@given(height=st.integers(1, 41), width=st.integers(1, 41), seed=st.integers(0, 99))
def test_any_size_and_any_holes_will_do(height: int, width: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(1.0, 9.0, (height, width)).astype(np.float32)
    depth[rng.random(depth.shape) > 0.3] = 0.0
    depth.flat[rng.integers(depth.size)] = 3.0
    gray = rng.random((height, width)).astype(np.float32)
    initial = ViewInputs(
        depth=depth, gray=gray, K=np.diag([30.0, 30.0, 1.0]), sources=view().sources
    )
    check(refine_view(initial, network(seed=3), TILES), (height, width))


def test_the_depth_stays_near_the_range_that_was_measured() -> None:
    net = network(seed=4)
    torch.nn.init.constant_(net.head.bias, 1e6)  # type: ignore[arg-type]
    initial = view()
    without = dataclasses.replace(TILES, keep_confirmed=False)
    refined = refine_view(initial, net, without)
    measured = initial.depth[initial.depth > 0]
    np.testing.assert_allclose(refined.depth, measured.min() / 4, rtol=1e-5)


def test_numbers_gone_wild_leave_the_initial_depth() -> None:
    net = network(seed=4)
    torch.nn.init.constant_(net.head.bias, float("nan"))  # type: ignore[arg-type]
    initial = view()
    refined = refine_view(initial, net, TILES)
    valid = initial.depth > 0
    np.testing.assert_allclose(refined.depth[valid], initial.depth[valid], rtol=2e-7)
    check(refined, initial.depth.shape)
    assert refined.confidence.max() < 0.01


def test_the_confidence_is_the_probability_of_one_per_cent() -> None:
    net = network()
    initial = view()
    with torch.no_grad():
        assert net.head.bias is not None
        net.head.bias[-1] = -3.0
    sure = refine_view(initial, net, TILES).confidence
    with torch.no_grad():
        net.head.bias[-1] = 1.0
    unsure = refine_view(initial, net, TILES).confidence
    assert (sure > unsure).all()


def test_without_its_own_estimate_the_correlation_is_the_confidence() -> None:
    net = network(confidence=False)
    right = refine_view(view(), net, TILES).confidence
    alone = refine_view(view(num_sources=0), net, TILES).confidence
    assert np.median(right) > 0.9
    assert not alone.any()


def test_refining_leaves_the_network_as_it_was() -> None:
    net = network(seed=5).train()
    before = {name: value.clone() for name, value in net.state_dict().items()}
    refine_view(view(), net, TILES)
    assert net.training
    for name, value in net.state_dict().items():
        assert torch.equal(value, before[name])


def test_a_tile_smaller_than_the_network_allows_is_enlarged() -> None:
    net = network(levels=6)  # multiples of 64 px; the tiles have 32
    initial = view()
    check(refine_view(initial, net, TILES), initial.depth.shape)


def test_an_image_of_another_size_is_refused() -> None:
    initial = view()
    with pytest.raises(ValueError, match=r"\(10, 10\)"):
        dataclasses.replace(initial, gray=np.zeros((10, 10), dtype=np.float32))


def test_a_depth_map_without_any_depth_is_refused() -> None:
    initial = view()
    empty = dataclasses.replace(initial, depth=np.zeros_like(initial.depth))
    with pytest.raises(ValueError, match="no pixel"):
        refine_view(empty, network(), TILES)


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
    assert not np.isclose(changed, unchanged, rtol=1e-3).all()
    without = dataclasses.replace(TILES, keep_confirmed=False)
    free = refine_view(initial, net, without).depth
    assert not np.isclose(free, unchanged, rtol=1e-3).all()
