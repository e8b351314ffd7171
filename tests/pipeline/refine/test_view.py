import dataclasses

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from refined_plane import TILES, network, view

from resdepth_colmap.network.network_config import (
    InputVariant,
    Normalisation,
)
from resdepth_colmap.pipeline.refine.view import (
    RefinedView,
    ViewInputs,
    refine_view,
)


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
@pytest.mark.parametrize("inner_iterations", [1, 2])
@pytest.mark.parametrize("outliers", [False, True])
def test_a_fresh_network_gives_the_initial_depth_back(
    normalisation: Normalisation, inner_iterations: int, outliers: bool
) -> None:
    initial = view(outliers=outliers)
    config = dataclasses.replace(TILES, inner_iterations=inner_iterations)
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
    refined = refine_view(initial, net, dataclasses.replace(TILES, inner_iterations=2))
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
    without = dataclasses.replace(TILES, update_gating=False)
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


def test_colours_of_another_size_are_a_bug_of_the_caller() -> None:
    initial = view()
    with pytest.raises(ValueError, match="colors"):
        dataclasses.replace(initial, colors=np.zeros((3, 4, 3), np.float32))
