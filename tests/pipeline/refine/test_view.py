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
from resdepth_colmap.pipeline.refine.network_inputs import seen_by_sources
from resdepth_colmap.pipeline.refine.photometric_error import NO_EVIDENCE
from resdepth_colmap.pipeline.refine.view import (
    RefinedView,
    ViewInputs,
    refine_view,
    view_tensors,
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


def masked_view(seed: int) -> ViewInputs:
    """A view of which masks leave out other content for each seed."""
    rng = np.random.default_rng(seed)
    initial = view(outliers=True)
    (source,) = initial.sources
    flags = np.ones(initial.depth.shape, np.bool_)
    flags[10:30, 20:50] = False
    flags[:, :8] = False
    source_flags = np.ones(source.gray.shape, np.bool_)
    source_flags[20:40, 10:30] = False
    noise = rng.random((3, *initial.depth.shape)).astype(np.float32)
    source_noise = rng.random(source.gray.shape).astype(np.float32)
    gray = np.where(flags, initial.gray, noise[0])
    hidden = dataclasses.replace(
        source,
        gray=np.where(source_flags, source.gray, source_noise),
        wanted=source_flags,
    )
    return dataclasses.replace(
        initial,
        depth=np.where(flags, initial.depth, np.float32(3 + seed) * noise[1]),
        gray=gray,
        colors=np.repeat(gray[..., None], 3, axis=2),
        sources=(hidden,),
        wanted=flags,
    )


@pytest.mark.parametrize("confidence", [False, True])
@pytest.mark.parametrize("inner_iterations", [1, 2])
def test_what_masks_leave_out_is_neither_seen_nor_given_a_depth(
    confidence: bool, inner_iterations: int
) -> None:
    net = network(seed=5, confidence=confidence)
    config = dataclasses.replace(TILES, inner_iterations=inner_iterations)
    one, other = masked_view(0), masked_view(1)
    refined, again = (refine_view(it, net, config) for it in (one, other))
    assert one.wanted is not None
    for found in (refined, again):
        assert not found.depth[~one.wanted].any()
        assert not found.normals[~one.wanted].any()
        assert not found.confidence[~one.wanted].any()
        assert (found.depth[one.wanted] > 0).all()
        assert (found.normals[..., 2][one.wanted] < 0).all()
    np.testing.assert_allclose(refined.depth, again.depth, rtol=1e-5)
    np.testing.assert_allclose(refined.normals, again.normals, atol=1e-5)
    np.testing.assert_allclose(refined.confidence, again.confidence, atol=1e-5)


def test_a_mask_that_leaves_nothing_out_changes_nothing() -> None:
    net, initial = network(seed=5), view(outliers=True)
    flags = np.ones(initial.depth.shape, np.bool_)
    (source,) = initial.sources
    masked = dataclasses.replace(
        initial,
        wanted=flags,
        sources=(
            dataclasses.replace(source, wanted=np.ones(source.gray.shape, np.bool_)),
        ),
    )
    refined, again = (refine_view(it, net, TILES) for it in (initial, masked))
    np.testing.assert_allclose(refined.depth, again.depth, rtol=1e-6)
    np.testing.assert_allclose(refined.confidence, again.confidence, atol=1e-6)


def test_empty_pixels_are_kept_on_request() -> None:
    initial = view()
    config = dataclasses.replace(TILES, keep_empty=True)
    refined = refine_view(initial, network(seed=5), config)
    filled = refine_view(initial, network(seed=5), TILES)
    assert np.array_equal(refined.depth > 0, initial.depth > 0)
    known = initial.depth > 0
    np.testing.assert_allclose(refined.depth[known], filled.depth[known], rtol=1e-6)
    assert not refined.confidence[~known].any()


def test_masked_pixels_of_either_view_are_as_outside_of_the_source() -> None:
    masked, cpu = masked_view(0), torch.device("cpu")
    assert masked.wanted is not None
    plain = dataclasses.replace(masked.sources[0], wanted=None)
    blind = dataclasses.replace(plain, wanted=np.zeros(plain.gray.shape, np.bool_))
    errors = {}
    for name, source in (("plain", plain), ("blind", blind), ("half", None)):
        sources = masked.sources if source is None else (source,)
        tensors = view_tensors(
            dataclasses.replace(masked, sources=sources), cpu, use_maps=False
        )
        seen = seen_by_sources(tensors, 1)
        ((image, inside),) = seen.warped
        assert not inside[0, 0].numpy()[~masked.wanted].any()
        assert not image[~inside].any()
        errors[name] = (seen.error[0, 0].numpy(), inside[0, 0].numpy())
    assert not errors["blind"][1].any()
    assert (errors["blind"][0] == NO_EVIDENCE).all()
    hidden = errors["plain"][1] & ~errors["half"][1]
    assert 0 < hidden.mean() < 0.5
    assert (errors["half"][0][hidden] == NO_EVIDENCE).all()
    np.testing.assert_array_equal(errors["half"][1] | hidden, errors["plain"][1])
