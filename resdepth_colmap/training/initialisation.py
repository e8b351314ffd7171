"""The initial network of a training: random, or that of a weights file."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from resdepth_colmap.errors import ConfigError
from resdepth_colmap.network.network_config import InputVariant, NetworkConfig
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.network.weights import default_weights_path, load_weights
from resdepth_colmap.training.config import Preset, TrainConfig
from resdepth_colmap.training.widening import widened

SHIPPED = Path("shipped")
"""As the file to start from: the weights of the package."""

_MORE = (
    "valid",
    "photo_consistency",
    "source_depth",
    "color",
    "propagation_channels",
    "source_resampling",
    "shared_features",
)
"""Options in which a network may exceed the weights that it starts from."""


def chosen_network(
    config: TrainConfig,
    options: Mapping[str, Any],
    preset: Preset = Preset.DEFAULT,
) -> NetworkConfig:
    """The configuration of the network to train.

    Args:
        config: If its `init` names weights, the network is theirs.
        options: Attributes of `NetworkConfig` that were given.
        preset: Source of the others.

    Raises:
        WeightsError: If the weights to start from cannot be read.
        ConfigError: If they are of another network than the options say.
    """
    if config.init is None:
        base = NetworkConfig()
        if preset is Preset.PAPER:
            variant = options.get("variant", base.variant)
            base = NetworkConfig.paper(InputVariant(variant))
        return NetworkConfig.from_mapping({**base.to_mapping(), **options})
    path = init_path(config.init)
    theirs = load_weights(path).config
    ours = NetworkConfig.from_mapping({**theirs.to_mapping(), **options})
    _check_fits(path, theirs, ours)
    return ours


def fresh_network(network_config: NetworkConfig, config: TrainConfig) -> ResDepthNet:
    """The network before the first step.

    Args:
        network_config: The network.
        config: Its seed draws random weights; its `init` names others.

    Returns:
        The network, on the CPU.

    Raises:
        WeightsError: If the weights to start from cannot be read.
        ConfigError: If they are of another network, there is no propagation that could
            be trained alone, or later outer iterations lack initial weights. Weights of
            a network with fewer inputs or a narrower propagation, or none, are widened.
    """
    torch.manual_seed(config.seed)
    network = ResDepthNet(network_config)
    if config.outer_iterations > 1 and (
        config.init is None or not network_config.source_depth
    ):
        raise ConfigError(
            f"rounds={config.outer_iterations}: later outer iterations need weights "
            "for the first one and a network that sees its maps; add init and "
            "source_depth, or leave rounds out."
        )
    if config.freeze_unet and network.propagation is None:
        raise ConfigError(
            "freeze_unet: the network has no propagation, so nothing would be trained; "
            "add propagation_channels, or leave freeze_unet out."
        )
    if config.init is not None:
        path = init_path(config.init)
        loaded = load_weights(path)
        _check_fits(path, loaded.config, network_config)
        weights = widened(
            loaded.state_dict(), loaded.config, network_config, network.state_dict()
        )
        network.load_state_dict(weights)
    return network


def init_path(init: Path) -> Path:
    """The weights file that an `init` names."""
    return default_weights_path() if init == SHIPPED else init


def _check_fits(path: Path, theirs: NetworkConfig, ours: NetworkConfig) -> None:
    other, wanted = theirs.to_mapping(), ours.to_mapping()
    differences = [
        f"{name} {other[name]}, not {wanted[name]}"
        for name in wanted
        if other[name] != wanted[name]
        and not (name in _MORE and wanted[name] > other[name])
    ]
    if differences:
        raise ConfigError(
            f"{path}: weights of another network ({', '.join(differences)}); leave "
            "these options out, or train without --init."
        )
