"""The block that both networks are made of."""

from torch import nn


def conv_block(before: int, after: int) -> nn.Sequential:
    """A 3x3 convolution between these numbers of channels, batch norm and ReLU."""
    # No bias: the batch norm has one.
    return nn.Sequential(
        nn.Conv2d(before, after, kernel_size=3, padding=1, bias=False),
        nn.BatchNorm2d(after),
        nn.ReLU(inplace=True),
    )
