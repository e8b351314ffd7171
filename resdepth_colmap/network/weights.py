"""Weights files: safetensors that carry their network configuration in the header.

Never a pickle: reading a weights file runs no code. Convolutions are stored in half
precision, which halves the file and changes depths by far less than a thousandth;
vectors (biases, batch norm and its statistics) are stored in single precision, because
a running variance easily leaves the range of half precision.
"""

import hashlib
import importlib.metadata
import importlib.resources
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save as to_bytes
from torch import Tensor

from resdepth_colmap.errors import ConfigError, WeightsError
from resdepth_colmap.io.files import write_whole
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.network.unet import ResDepthNet

FORMAT = "resdepth-colmap"
FORMAT_VERSION = 1
_OLDER = {
    "source_depth": False,
    "color": False,
    "propagation_channels": 0,
    "source_resampling": False,
    "shared_features": False,
}
"""Values of the options that the headers of older files lack."""

_RENAMED = {"second_look": "source_resampling"}
"""New names of options, by their names in the headers of older files."""

WAY_OUT = "use a file that `resdepth-colmap train` wrote, or leave out --weights"


def default_weights_path() -> Path:
    """Path of the weights that come with the package."""
    package = importlib.resources.files("resdepth_colmap")
    return Path(str(package / "weights" / "resdepth.safetensors"))


def save_weights(
    path: Path, network: ResDepthNet, facts: Mapping[str, Any] | None = None
) -> None:
    """Write a network's weights, whole or not at all.

    Args:
        path: File to write; replaced if it is there.
        network: The network, on any device.
        facts: How it was trained (data, steps, scores), fit for JSON.

    Raises:
        WeightsError: If a weight is not a finite number in the file's precision.
        WorkspaceError: If the file cannot be written.
    """
    tensors = {name: _stored(value) for name, value in network.state_dict().items()}
    for name, value in tensors.items():
        if not torch.isfinite(value).all():
            raise WeightsError(
                f"{path}: not written, as {name} is not finite: the training diverged; "
                "lower the learning rate."
            )
    header = {
        "format_version": FORMAT_VERSION,
        "package_version": importlib.metadata.version("resdepth-colmap"),
        "network": network.config.to_mapping(),
        "facts": dict(facts or {}),
    }
    # One entry: safetensors writes several in random order, and the hash would differ.
    metadata = {FORMAT: json.dumps(header, sort_keys=True)}
    write_whole(path, to_bytes(tensors, metadata))


def load_weights(
    path: Path | None = None, device: torch.device | str = "cpu"
) -> ResDepthNet:
    """Read a network, ready for use: in evaluation mode, single precision.

    Args:
        path: Weights file; None = the weights that come with the package.
        device: Where to put it.

    Returns:
        The network that the file's header describes, with the file's weights.

    Raises:
        WeightsError: If the file is missing, broken, not ours, of a later format, or
            does not fit the network of its header.
    """
    path = default_weights_path() if path is None else path
    config, tensors = _read(path)
    # Without memory until the shapes are known to fit: a header may claim any size.
    with torch.device("meta"):
        network = ResDepthNet(config)
    _check_shapes(path, network, tensors)
    network.load_state_dict(tensors, assign=True)
    return network.to(device).eval()


def read_config(path: Path | None = None) -> NetworkConfig:
    """The configuration of the network of a weights file, from its header alone.

    Raises:
        WeightsError: If the file is missing, broken, not ours or of an unknown network.
    """
    path = default_weights_path() if path is None else path
    return _config(path, _header(path))


def read_facts(path: Path | None = None) -> dict[str, Any]:
    """The facts about the training that `save_weights` was given.

    Raises:
        WeightsError: If the file is missing, broken or not ours.
    """
    path = default_weights_path() if path is None else path
    return dict(_header(path)["facts"])


def weights_hash(path: Path | None = None) -> str:
    """SHA-256 of a weights file, hexadecimal.

    Raises:
        WeightsError: If the file cannot be read.
    """
    path = default_weights_path() if path is None else path
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise _unreadable(path, error) from error


def _stored(value: Tensor) -> Tensor:
    value = value.detach().cpu().contiguous()
    is_kernel = value.is_floating_point() and value.ndim > 1
    return value.half() if is_kernel else value


def _read(path: Path) -> tuple[NetworkConfig, dict[str, Tensor]]:
    config = _config(path, _header(path))
    try:
        with safe_open(path, framework="pt") as file:
            tensors = {name: _loaded(file.get_tensor(name)) for name in file.keys()}  # noqa: SIM118 (no mapping)
    except (OSError, SafetensorError) as error:
        raise _unreadable(path, error) from error
    for name, value in tensors.items():
        if not torch.isfinite(value).all():
            raise WeightsError(f"{path}: {name} is not finite; {WAY_OUT}.")
    return config, tensors


def _config(path: Path, header: Mapping[str, Any]) -> NetworkConfig:
    options = header["network"].items()
    named = {_RENAMED.get(name, name): value for name, value in options}
    try:
        return NetworkConfig.from_mapping({**_OLDER, **named})
    except (ConfigError, TypeError) as error:
        raise WeightsError(f"{path}: unknown kind of network ({error})") from error


def _loaded(value: Tensor) -> Tensor:
    return value.float() if value.is_floating_point() else value


def _header(path: Path) -> dict[str, Any]:
    try:
        with safe_open(path, framework="pt") as file:
            text = (file.metadata() or {}).get(FORMAT)
    except (OSError, SafetensorError) as error:
        raise _unreadable(path, error) from error
    if text is None:
        raise WeightsError(f"{path}: not weights of {FORMAT}; {WAY_OUT}.")
    header = _parsed(path, text)
    if header.get("format_version") != FORMAT_VERSION:
        raise WeightsError(
            f"{path}: weights of format {header.get('format_version')!r}, but this "
            f"version reads format {FORMAT_VERSION}; install the version that wrote it "
            f"({header.get('package_version', 'unknown')})."
        )
    for key in ("network", "facts"):
        if not isinstance(header.get(key), dict):
            raise WeightsError(f"{path}: no {key!r} in its header; {WAY_OUT}.")
    return header


def _parsed(path: Path, text: str) -> dict[str, Any]:
    try:
        header = json.loads(text)
    except ValueError as error:
        raise WeightsError(f"{path}: broken header ({error}); {WAY_OUT}.") from error
    return header if isinstance(header, dict) else {}


def _check_shapes(path: Path, network: ResDepthNet, tensors: dict[str, Tensor]) -> None:
    expected = {name: value.shape for name, value in network.state_dict().items()}
    actual = {name: value.shape for name, value in tensors.items()}
    for name in sorted(expected.keys() | actual.keys()):
        if expected.get(name) != actual.get(name):
            raise WeightsError(
                f"{path}: {name} is {_shown(actual.get(name))}, but its network needs "
                f"{_shown(expected.get(name))}; {WAY_OUT}."
            )


def _shown(shape: torch.Size | None) -> str:
    return "missing" if shape is None else "x".join(map(str, shape)) or "a number"


def _unreadable(path: Path, error: Exception) -> WeightsError:
    if isinstance(error, FileNotFoundError):
        return WeightsError(f"{path}: no such weights file; {WAY_OUT}.")
    return WeightsError(f"{path}: not a readable weights file ({error}); {WAY_OUT}.")
