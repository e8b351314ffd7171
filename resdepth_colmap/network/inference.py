"""Networks that will not learn any more, and so may be faster."""

import torch
from torch import nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from resdepth_colmap.network.unet import ResDepthNet


def for_inference(network: ResDepthNet) -> ResDepthNet:
    """Make a network faster that is only asked, not trained.

    Each batch norm becomes part of the convolution before it, and kernels lie in memory
    as the convolutions of processors want them.

    Args:
        network: In evaluation mode; it is changed.

    Returns:
        The same network: its answers differ by rounding alone.
    """
    for module in network.modules():
        if isinstance(module, nn.Sequential):
            _fold_norm(module)
    return network.to(memory_format=torch.channels_last)  # type: ignore[call-overload, no-any-return] # torch's stubs lack the keyword


def _fold_norm(block: nn.Sequential) -> None:
    for place in range(len(block) - 1):
        convolution, norm = block[place], block[place + 1]
        if isinstance(convolution, nn.Conv2d) and isinstance(norm, nn.BatchNorm2d):
            block[place] = fuse_conv_bn_eval(convolution, norm)
            block[place + 1] = nn.Identity()
