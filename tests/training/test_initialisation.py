"""Laws of the network before the first step."""

import dataclasses
from pathlib import Path

import pytest
import torch

from resdepth_colmap.errors import ConfigError
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.network.weights import load_weights, save_weights
from resdepth_colmap.training.config import TrainConfig
from resdepth_colmap.training.initialisation import (
    SHIPPED,
    chosen_network,
    fresh_network,
)

NETWORK = NetworkConfig(levels=2, base_channels=4, max_channels=8)


@pytest.fixture
def weights(tmp_path: Path) -> Path:
    torch.manual_seed(7)
    path = tmp_path / "first.safetensors"
    save_weights(path, ResDepthNet(NETWORK))
    return path


def test_weights_to_start_from_are_the_first_weights(weights: Path) -> None:
    config = TrainConfig(init=weights)
    network = fresh_network(chosen_network(config, {}), config)
    expected = load_weights(weights).state_dict()
    actual = network.state_dict()
    assert network.config == NETWORK
    assert all(torch.equal(actual[name], expected[name]) for name in expected)
    assert all(value.requires_grad for value in network.parameters())


def test_the_word_shipped_means_the_weights_of_the_package() -> None:
    config = TrainConfig(init=SHIPPED)
    expected = load_weights()
    assert chosen_network(config, {}) == expected.config
    network = fresh_network(expected.config, config)
    assert torch.equal(network.head.weight, expected.head.weight)


def test_another_network_than_that_of_the_weights_is_refused(weights: Path) -> None:
    config = TrainConfig(init=weights)
    assert chosen_network(config, {"levels": 2}) == NETWORK
    with pytest.raises(ConfigError, match=r"first.safetensors.*levels 2, not 3"):
        chosen_network(config, {"levels": 3})
    with pytest.raises(ConfigError, match="gate True, not False"):
        fresh_network(dataclasses.replace(NETWORK, gate=False), config)


def test_the_same_seed_gives_the_same_random_weights() -> None:
    first, again, other = (
        fresh_network(NETWORK, TrainConfig(seed=seed))
        .encoder[0]
        .state_dict()["0.weight"]
        for seed in (1, 1, 2)
    )
    assert torch.equal(first, again)
    assert not torch.equal(first, other)


def test_new_inputs_change_nothing_at_first(tmp_path: Path) -> None:
    torch.manual_seed(3)
    blind = dataclasses.replace(NETWORK, source_depth=False, valid=False)
    old = ResDepthNet(blind)
    torch.nn.init.normal_(old.head.weight)
    assert old.propagation is not None
    torch.nn.init.normal_(old.propagation.head.weight)
    path = tmp_path / "blind.safetensors"
    save_weights(path, old)
    config = TrainConfig(init=path)
    chosen = chosen_network(config, {"source_depth": True, "valid": True})
    assert chosen == NETWORK
    wide = fresh_network(chosen, config).eval()
    stack = torch.randn(1, len(chosen.channels), 16, 16)
    indices = [chosen.channels.index(name) for name in blind.channels]
    expected = load_weights(path)(stack[:, indices])
    torch.testing.assert_close(wide(stack), expected)
    wide.train()(stack).inverse_depth.sum().backward()
    gradient = wide.encoder[0][0].weight.grad  # type: ignore[index]
    assert isinstance(gradient, torch.Tensor)
    assert all(gradient[:, index].any() for index in range(len(chosen.channels)))


def test_a_propagation_is_added_to_weights_that_have_none(tmp_path: Path) -> None:
    plain = dataclasses.replace(NETWORK, propagation_channels=0)
    path = tmp_path / "plain.safetensors"
    save_weights(path, ResDepthNet(plain))
    config = TrainConfig(init=path, freeze_unet=True)
    with pytest.raises(ConfigError, match="freeze_unet: the network has no propag"):
        fresh_network(chosen_network(config, {}), config)
    wanted = chosen_network(config, {"propagation_channels": 6})
    network = fresh_network(wanted, config)
    assert network.propagation is not None
    for name, value in load_weights(path).state_dict().items():
        assert torch.equal(network.state_dict()[name], value)
    kept = TrainConfig(init=tmp_path / "with.safetensors")
    save_weights(tmp_path / "with.safetensors", network)
    with pytest.raises(ConfigError, match="propagation_channels 6, not 3"):
        chosen_network(kept, {"propagation_channels": 3})


def test_a_wider_propagation_with_source_resampling_starts_as_the_narrow_one(
    tmp_path: Path,
) -> None:
    torch.manual_seed(5)
    narrow = dataclasses.replace(
        NETWORK, propagation_channels=6, source_resampling=False, shared_features=False
    )
    old = ResDepthNet(narrow)
    assert old.propagation is not None
    torch.nn.init.normal_(old.propagation.head.weight, std=0.3)
    for value in old.propagation.buffers():
        if value.ndim:
            value.uniform_(0.5, 2.0)
    path = tmp_path / "narrow.safetensors"
    save_weights(path, old)
    config = TrainConfig(init=path)
    options = {
        "propagation_channels": 9,
        "source_resampling": True,
        "shared_features": True,
    }
    wide = fresh_network(chosen_network(config, options), config).eval()
    assert wide.config.resamples_source
    stack = torch.randn(1, len(NETWORK.channels), 16, 16)
    expected, actual = load_weights(path)(stack), wide(stack, torch.sin)
    torch.testing.assert_close(actual.log_scale, expected.log_scale)
    # The new depths take a little of the weight.
    change = (actual.inverse_depth - expected.inverse_depth).abs()
    assert change.mean() < 0.1 * (expected.inverse_depth - stack[:, :1]).abs().mean()
    wide.train()(stack, torch.sin).inverse_depth.square().sum().backward()
    for name, parameter in wide.named_parameters():
        if name.startswith("propagation.stem") and parameter.ndim > 1:
            assert parameter.grad is not None, name
            assert parameter.grad.flatten(1).any(dim=1)[:6].all(), name


def test_an_input_that_the_weights_know_is_not_taken_away(weights: Path) -> None:
    config = TrainConfig(init=weights)
    with pytest.raises(ConfigError, match="source_depth True, not False"):
        chosen_network(config, {"source_depth": False})


def test_later_outer_iterations_need_weights_for_the_first(weights: Path) -> None:
    config = TrainConfig(outer_iterations=2)
    with pytest.raises(ConfigError, match="need weights for the first one"):
        fresh_network(NETWORK, config)
    config = TrainConfig(outer_iterations=2, init=weights)
    assert fresh_network(chosen_network(config, {}), config).config.source_depth
