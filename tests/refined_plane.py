"""A slanted plane to refine, and small networks that refine it."""

import numpy as np
import torch
from analytic_scene import (
    PLANE_NORMAL,
    PLANE_OFFSET,
    depth_of_plane,
    image_of,
    two_views,
)

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.pipeline.refine.view import SourceView, ViewInputs
from resdepth_colmap.scene import cam_from_cam

SMALL: dict[str, object] = {
    "levels": 2,
    "base_channels": 4,
    "max_channels": 8,
    "propagation_channels": 0,
}
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
