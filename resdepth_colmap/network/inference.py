"""Faster networks for inference."""

import torch
from torch import nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from resdepth_colmap.network.unet import ResDepthNet


def for_inference(network: ResDepthNet) -> ResDepthNet:
    """Make a network faster that is no longer trained.

    Each batch norm is folded into the convolution before it, and the kernels lie in
    memory as the convolutions of CPUs prefer.

    Args:
        network: In evaluation mode; it is changed.

    Returns:
        The same network; its outputs differ by rounding alone.
    """
    for module in network.modules():
        if isinstance(module, nn.Sequential):
            _fold_norm(module)
    return network.to(memory_format=torch.channels_last)  # type: ignore[call-overload, no-any-return] # torch's stubs lack the keyword


def _fold_norm(block: nn.Sequential) -> None:
    for index in range(len(block) - 1):
        convolution, norm = block[index], block[index + 1]
        if isinstance(convolution, nn.Conv2d) and isinstance(norm, nn.BatchNorm2d):
            block[index] = fuse_conv_bn_eval(convolution, norm)
            block[index + 1] = nn.Identity()
