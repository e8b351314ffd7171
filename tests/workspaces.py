"""Small exact workspaces and a network that changes nothing, for the whole road."""

from pathlib import Path

import torch
from planes import write_plane_workspace

from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.workspace import Workspace, open_workspace
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.network.weights import save_weights
from resdepth_colmap.scene import Scene

WEIGHTS_NAME = "identity.safetensors"


def plane_folder(path: Path, **options: object) -> Path:
    """A workspace of a plane in `path/scene`, as `write_plane_workspace` takes it."""
    folder = path / "scene"
    write_plane_workspace(folder, **options)  # type: ignore[arg-type] # passed on
    return folder


def opened(folder: Path) -> tuple[Workspace, Scene]:
    """A workspace and its scene."""
    workspace = open_workspace(folder)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    return workspace, scene


def identity_weights(path: Path, seed: int = 0, source_depth: bool = False) -> Path:
    """Weights of a small fresh network, which returns its input depth.

    What a network is given that looks at the maps of other views is no longer what was
    in the file: its input is completed.
    """
    torch.manual_seed(seed)
    config = NetworkConfig(
        levels=2, base_channels=4, source_depth=source_depth, propagation_channels=0
    )
    network = ResDepthNet(config)
    file = path / f"{seed}-{source_depth}-{WEIGHTS_NAME}"
    save_weights(file, network)
    return file
