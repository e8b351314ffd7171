"""Small exact workspaces and a network that changes nothing, for the whole road."""

from pathlib import Path

import torch
from planes import write_plane_workspace

from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.network.weights import save_weights

WEIGHTS_NAME = "identity.safetensors"


def plane_folder(path: Path, **options: object) -> Path:
    """A workspace of a plane in `path/scene`, as `write_plane_workspace` takes it."""
    folder = path / "scene"
    write_plane_workspace(folder, **options)  # type: ignore[arg-type] # passed on
    return folder


def identity_weights(path: Path, seed: int = 0) -> Path:
    """Weights of a small fresh network, which returns its input depth."""
    torch.manual_seed(seed)
    network = ResDepthNet(NetworkConfig(levels=2, base_channels=4))
    file = path / f"{seed}-{WEIGHTS_NAME}"
    save_weights(file, network)
    return file
