import pytest
import torch

from resdepth_colmap.network.network_config import InputVariant, NetworkConfig
from resdepth_colmap.network.unet import INPUT_LIMIT, ResDepthNet


def small(**options: object) -> NetworkConfig:
    sizes = {"levels": 2, "base_channels": 4, "max_channels": 8}
    return NetworkConfig.from_mapping(sizes | options)


def stack_for(config: NetworkConfig, seed: int = 0) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    shape = (2, len(config.channels), 16, 24)
    return torch.randn(shape, generator=generator) * 5


def shaken(net: ResDepthNet) -> ResDepthNet:
    torch.manual_seed(0)
    torch.nn.init.normal_(net.head.weight, std=0.1)
    if net.propagation is not None:
        torch.nn.init.normal_(net.propagation.head.weight, std=0.1)
    return net


RESIDUAL_VARIANTS = [v for v in InputVariant if v is not InputVariant.IMAGES_ONLY]


@pytest.mark.parametrize("variant", RESIDUAL_VARIANTS)
@pytest.mark.parametrize("gate", [False, True])
@pytest.mark.parametrize("training", [False, True])
def test_a_fresh_network_returns_its_input_depth_exactly(
    variant: InputVariant, gate: bool, training: bool
) -> None:
    config = small(variant=variant, gate=gate, propagation_channels=0)
    stack = stack_for(config)
    net = ResDepthNet(config).train(training)
    assert stack.abs().max() > INPUT_LIMIT
    assert torch.equal(net(stack).inverse_depth, stack[:, :1])


def test_a_fresh_network_of_images_only_returns_zero() -> None:
    config = small(variant="images-only")
    assert not ResDepthNet(config)(stack_for(config)).inverse_depth.any()


def test_the_papers_network_has_24_2_million_parameters() -> None:
    net = ResDepthNet(NetworkConfig.paper())
    count = sum(parameter.numel() for parameter in net.parameters())
    assert len(net.config.channels) == 3
    assert count / 1e6 == pytest.approx(24.2, abs=0.05)


def test_a_tile_of_the_paper_reaches_the_bottleneck_as_512_by_4_by_4() -> None:
    with torch.device("meta"):
        net = ResDepthNet(NetworkConfig.paper())
        shapes = []
        net.bottleneck.register_forward_hook(
            lambda _m, _i, out: shapes.append(out.shape)
        )
        net(torch.zeros(1, 3, 512, 512))
    assert shapes == [(1, 512, 4, 4)]


@pytest.mark.parametrize("confidence", [False, True])
def test_the_error_scale_starts_at_one_and_is_there_only_if_asked(
    confidence: bool,
) -> None:
    config = small(confidence=confidence)
    log_scale = ResDepthNet(config)(stack_for(config)).log_scale
    assert (log_scale is not None) == confidence
    if log_scale is not None:
        assert log_scale.shape == (2, 1, 16, 24)
        assert not log_scale.any()


def test_every_parameter_learns_once_the_head_is_not_zero() -> None:
    config = small()
    net = shaken(ResDepthNet(config))
    out = net(stack_for(config))
    assert out.log_scale is not None
    (out.inverse_depth.square().mean() + out.log_scale.square().mean()).backward()
    for name, parameter in net.named_parameters():
        assert parameter.grad is not None, name
        assert torch.isfinite(parameter.grad).all(), name
        assert parameter.grad.any(), name


def test_an_outlier_of_the_input_changes_others_no_more_than_the_limit_does() -> None:
    config = small(variant="depth-only", valid=False, propagation_channels=0)
    net = shaken(ResDepthNet(config)).eval()
    stack = torch.zeros(1, 1, 16, 16)
    stack[..., 8, 8] = INPUT_LIMIT
    at_limit = net(stack).inverse_depth
    stack[..., 8, 8] = 1e6
    beyond = net(stack).inverse_depth
    other = torch.ones_like(stack, dtype=torch.bool)
    other[..., 8, 8] = False
    assert torch.equal(beyond[other], at_limit[other])


def test_memory_layout_does_not_matter() -> None:
    config = small()
    net = shaken(ResDepthNet(config)).eval()
    stack = stack_for(config)
    expected = net(stack).inverse_depth
    net = net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    actual = net(stack.to(memory_format=torch.channels_last)).inverse_depth
    torch.testing.assert_close(actual, expected, rtol=1e-4, atol=1e-4)


def test_the_second_network_looks_at_the_refined_depth_and_the_extremes() -> None:
    config = small()
    net = shaken(ResDepthNet(config)).eval()
    stack, asked = stack_for(config), []

    def sample_source(depths: torch.Tensor) -> torch.Tensor:
        asked.append(depths)
        return depths.sin()

    sighted = net(stack, sample_source).inverse_depth
    (depths,) = asked
    assert depths.shape == (2, 3, 16, 24)
    assert not depths.requires_grad
    assert (depths[:, 1] >= depths[:, 0]).all()
    assert (depths[:, 2] <= depths[:, 0]).all()
    net_without = ResDepthNet(small(propagation_channels=0)).eval()
    net_without.load_state_dict(net.state_dict(), strict=False)
    refined = net_without(stack).inverse_depth
    torch.testing.assert_close(depths[:, :1], refined)
    blind = net(stack).inverse_depth
    black = net(stack, torch.zeros_like).inverse_depth
    assert torch.equal(blind, black)
    assert not torch.allclose(blind, sighted)


@pytest.mark.parametrize(
    "options",
    [{"variant": "mono"}, {"source_resampling": False}, {"variant": "depth-only"}],
)
def test_without_a_source_or_a_wish_nothing_looks(options: dict[str, object]) -> None:
    config = small(**options)
    net = shaken(ResDepthNet(config)).eval()

    def sample_source(depths: torch.Tensor) -> torch.Tensor:
        raise AssertionError(depths.shape)

    assert torch.isfinite(net(stack_for(config), sample_source).inverse_depth).all()


def test_another_number_of_channels_is_refused_by_name() -> None:
    config = small()
    with pytest.raises(ValueError, match="photo_consistency"):
        ResDepthNet(config)(torch.zeros(1, 2, 16, 16))


def test_a_size_that_the_levels_do_not_divide_is_refused() -> None:
    config = small()
    with pytest.raises(ValueError, match=r"18 x 16 px .* multiples of 4 px"):
        ResDepthNet(config)(torch.zeros(1, len(config.channels), 16, 18))
