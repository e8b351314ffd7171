import dataclasses

import numpy as np
import pytest
import torch
from analytic_scene import (
    Pair,
    plane_pair,
    sphere_pair,
)

from resdepth_colmap.network.network_config import (
    BLUE,
    RED,
    REPROJECTED,
    REPROJECTED_CHANGE,
    InputVariant,
    NetworkConfig,
    Normalisation,
)
from resdepth_colmap.pipeline.refine.network_inputs import (
    InputStack,
    ViewTensors,
    build_inputs,
    initial_maps,
    network_input,
    tile_scaling,
    warp_sources,
)
from resdepth_colmap.pipeline.refine.photometric_error import photometric_error
from resdepth_colmap.pipeline.refine.source_sampler import SourceTensors


def view_of(pair: Pair, num_sources: int = 1, scale: float = 1.0) -> ViewTensors:
    pose = pair.source_from_reference.clone()
    pose[..., 3] *= scale
    source = SourceTensors(pair.source_gray, pair.source_K, pose)
    return ViewTensors(
        inverse_depth=pair.inverse_depth / scale,
        valid=pair.depth > 0,
        gray=pair.reference_gray,
        K=pair.reference_K,
        sources=(source,) * num_sources,
    )


CONFIGS = [
    NetworkConfig(variant=variant, valid=extra, photo_consistency=extra, num_sources=n)
    for variant in InputVariant
    for extra in (False, True)
    for n in (1, 2)
]


@pytest.mark.parametrize("config", CONFIGS)
@pytest.mark.parametrize("num_sources", [0, 1, 3])
def test_the_input_has_the_channels_that_the_configuration_names(
    config: NetworkConfig, num_sources: int
) -> None:
    view = view_of(plane_pair(), num_sources)
    stack, _ = network_input(build_inputs(view, config), config)
    assert stack.shape == (1, len(config.channels), 48, 64)
    assert torch.isfinite(stack).all()
    for name, values in zip(config.channels, stack[0], strict=True):
        if name == "reference":
            assert torch.equal(values, view.gray[0, 0])
        if name == "valid":
            assert torch.equal(values, view.valid[0, 0].to(values))
        if name.startswith("source_"):
            is_there = int(name.removeprefix("source_")) < num_sources
            assert values.any() == is_there
        if name == "photo_consistency" and num_sources == 0:
            assert (values == 0.5).all()


@pytest.mark.parametrize("kind", Normalisation)
@pytest.mark.parametrize("num_sources", [0, 1])
@pytest.mark.parametrize("scale", [1e-3, 0.3, 7.0, 1e3])
def test_the_scale_of_the_scene_does_not_reach_the_network(
    kind: Normalisation, num_sources: int, scale: float
) -> None:
    config = NetworkConfig(normalisation=kind)
    stacks = [
        network_input(
            build_inputs(view_of(plane_pair(), num_sources, factor), config), config
        )[0]
        for factor in (1.0, scale)
    ]
    torch.testing.assert_close(stacks[1], stacks[0], rtol=0, atol=1e-7)


@pytest.mark.parametrize("kind", Normalisation)
def test_normalising_and_restoring_is_the_identity(kind: Normalisation) -> None:
    stack = build_inputs(view_of(plane_pair()), NetworkConfig())
    scaling = tile_scaling(stack, kind)
    back = scaling.restore(scaling.normalise(stack.inverse_depth))
    torch.testing.assert_close(back, stack.inverse_depth, rtol=1e-12, atol=0)


def test_the_papers_normalisation_is_the_baseline_times_the_centred_inverse_depth() -> (
    None
):
    pair = plane_pair()
    stack = build_inputs(view_of(pair), NetworkConfig.paper())
    normalised = tile_scaling(stack, Normalisation.BASELINE).normalise(
        stack.inverse_depth
    )
    baseline = pair.source_from_reference[0, :, 3].norm()
    expected = baseline * (stack.inverse_depth - stack.inverse_depth.mean())
    torch.testing.assert_close(normalised, expected)


@pytest.mark.parametrize("kind", Normalisation)
def test_filled_pixels_do_not_move_the_statistics(kind: Normalisation) -> None:
    view = view_of(plane_pair())
    valid = view.valid.clone()
    valid[..., :20] = False
    wild = view.inverse_depth.clone()
    wild[..., :20] = 1e3
    clean = build_inputs(view._replace(valid=valid), NetworkConfig())
    dirty = build_inputs(
        view._replace(valid=valid, inverse_depth=wild), NetworkConfig()
    )
    torch.testing.assert_close(tile_scaling(dirty, kind), tile_scaling(clean, kind))


@pytest.mark.parametrize("kind", Normalisation)
def test_a_tile_of_filled_pixels_only_still_has_statistics(kind: Normalisation) -> None:
    view = view_of(plane_pair())
    view = view._replace(valid=torch.zeros_like(view.valid))
    scaling = tile_scaling(build_inputs(view, NetworkConfig()), kind)
    assert torch.isfinite(scaling.offset).all()
    assert (scaling.scale > 0).all()


def test_a_wall_without_spread_is_scaled_by_a_share_of_its_depth() -> None:
    constant = torch.full((1, 1, 8, 8), 0.25)
    valid = torch.ones_like(constant, dtype=torch.bool)
    stack = InputStack(constant, valid, constant[:, :0], torch.ones(1, 1, 1, 1))
    scaling = tile_scaling(stack, Normalisation.ROBUST)
    assert scaling.scale.item() == pytest.approx(0.25 * 0.02)


def test_a_batch_is_normalised_view_by_view() -> None:
    pairs = [plane_pair(), sphere_pair()]
    config = NetworkConfig()
    views = [view_of(pair) for pair in pairs]
    views = [
        view._replace(inverse_depth=view.inverse_depth.clamp(min=0.1)) for view in views
    ]
    singles = [network_input(build_inputs(view, config), config)[0] for view in views]
    source = SourceTensors(
        *(
            torch.cat([getattr(view.sources[0], name) for view in views])
            for name in ("gray", "K", "source_from_reference")
        )
    )
    both = ViewTensors(
        inverse_depth=torch.cat([view.inverse_depth for view in views]),
        valid=torch.cat([view.valid for view in views]),
        gray=torch.cat([view.gray for view in views]),
        K=torch.cat([view.K for view in views]),
        sources=(source,),
    )
    stack, _ = network_input(build_inputs(both, config), config)
    torch.testing.assert_close(stack, torch.cat(singles))


def test_photo_consistency_is_near_zero_at_the_true_depth_and_larger_off_it() -> None:
    view = view_of(plane_pair())
    right = photometric_error(view.gray, warp_sources(view, 1))
    off = view._replace(inverse_depth=view.inverse_depth * 1.4)
    wrong = photometric_error(view.gray, warp_sources(off, 1))
    inside = warp_sources(view, 1)[0][1] & warp_sources(off, 1)[0][1]
    assert right[inside].median() < 0.01
    assert wrong[inside].median() > 10 * right[inside].median()


def test_photo_consistency_does_not_see_the_exposure() -> None:
    view = view_of(plane_pair())
    warped = warp_sources(view, 1)
    darker = [(0.4 * image + 0.2, inside) for image, inside in warped]
    change = photometric_error(view.gray, darker) - photometric_error(view.gray, warped)
    # Windows of hardly any texture are damped, and more so when darker.
    assert change.abs().median() < 5e-3
    assert change.abs().max() < 0.05


def test_without_texture_or_source_there_is_no_evidence() -> None:
    flat = torch.full((1, 1, 12, 12), 0.3)
    everywhere = torch.ones_like(flat, dtype=torch.bool)
    plain = photometric_error(flat, [(flat, everywhere)])
    assert (plain - 0.5).abs().max() < 0.02  # single precision's rounding
    nowhere = photometric_error(flat, [(flat, ~everywhere)])
    assert (nowhere == 0.5).all()


def test_a_crop_of_the_stack_is_the_stack_of_a_crop() -> None:
    stack = build_inputs(view_of(plane_pair()), NetworkConfig())
    crop = stack.crop(3, 5, 20, 30)
    assert torch.equal(crop.inverse_depth, stack.inverse_depth[..., 3:23, 5:35])
    assert torch.equal(crop.guidance, stack.guidance[..., 3:23, 5:35])
    assert torch.equal(crop.valid, stack.valid[..., 3:23, 5:35])


def test_a_depth_map_becomes_filled_inverse_depth_and_a_mask() -> None:
    depth = np.array([[2.0, 0.0], [4.0, 4.0]], dtype=np.float32)
    inverse, valid = initial_maps(depth)
    assert valid.tolist() == [[True, False], [True, True]]
    assert inverse[0, 0] == 0.5
    assert 0.25 <= inverse[0, 1] <= 0.5
    with pytest.raises(ValueError, match="no pixel"):
        initial_maps(np.zeros_like(depth))


def test_gradients_flow_from_the_stack_to_the_depth() -> None:
    view = view_of(plane_pair())
    inverse = view.inverse_depth.clone().requires_grad_()
    config = dataclasses.replace(NetworkConfig(), normalisation=Normalisation.BASELINE)
    stack = build_inputs(view._replace(inverse_depth=inverse), config)
    stack.guidance.sum().backward()  # type: ignore[no-untyped-call]
    assert inverse.grad is not None
    assert torch.isfinite(inverse.grad).all()
    assert inverse.grad.any()


@pytest.mark.parametrize("variant", [InputVariant.MONO, InputVariant.DEPTH_ONLY])
def test_a_network_that_sees_no_sources_is_the_same_with_and_without_them(
    variant: InputVariant,
) -> None:
    config = NetworkConfig.paper(variant)
    view = view_of(plane_pair())
    with_sources = build_inputs(view, config)
    without = build_inputs(view._replace(sources=()), config)
    assert torch.equal(with_sources.baseline, without.baseline)
    assert torch.equal(with_sources.guidance, without.guidance)


def test_the_sources_map_is_shown_as_a_difference_in_the_tiles_own_scale() -> None:
    pair = plane_pair()
    view = view_of(pair)
    said_by_maps = view.inverse_depth.clone()
    said_by_maps[..., :20] = 0
    config = NetworkConfig()
    change, reprojected = (
        config.channels.index(n) for n in (REPROJECTED_CHANGE, REPROJECTED)
    )
    blind, _ = network_input(build_inputs(view, config), config)
    assert not blind[:, [change, reprojected]].any()
    for factor in (1.0, 1.25):
        moved = view._replace(
            inverse_depth=view.inverse_depth * factor, reprojected=said_by_maps
        )
        stack, scaling = network_input(build_inputs(moved, config), config)
        arrived = stack[:, reprojected] > 0
        assert torch.equal(arrived, said_by_maps[:, 0] > 0)
        assert not stack[:, change][~arrived].any()
        # What the map says is the input depth plus the difference.
        said = scaling.restore(stack[:, :1] + stack[:, [change]])
        error = (said * pair.depth - 1).abs()[arrived[:, None]]
        assert float(error.max()) < 1e-9


def test_in_colour_the_network_sees_red_and_blue_besides_grey() -> None:
    config = NetworkConfig(color=True)
    gray = view_of(plane_pair())
    colors = torch.rand(1, 3, 48, 64)
    for view, red, blue in (
        (gray, gray.gray, gray.gray),
        (gray._replace(colors=colors), colors[:, :1], colors[:, 2:]),
    ):
        stack = build_inputs(view, config)
        for name, expected in ((RED, red), (BLUE, blue), ("reference", gray.gray)):
            place = config.channels.index(name) - 1
            assert torch.equal(stack.guidance[:, place : place + 1], expected)
