"""Depth that each pixel takes over from its surroundings (docs/adr/0015)."""

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn.functional import max_pool2d, pad, pixel_shuffle, pixel_unshuffle

from resdepth_colmap.network.conv_block import conv_block

STEPS_PX = (2, 5)
"""How far away, along and across, the pixels are that one may take over from."""

NUM_POOLS = 3
NUM_MORE = 3  # a residual, its gate, and what to add to the logarithm of the error
PACKED_PX = 2  # the first convolutions see squares of so many pixels as channels
LARGEST_STEP = 16.0  # from one limit of what the networks see to the other
OWN_DEPTH_LOGIT = 4.0  # three quarters of the weight


class Propagated(NamedTuple):
    """What the propagation says of each pixel.

    Attributes:
        inverse_depth: Normalised inverse depth, shape (B, 1, H, W).
        log_scale_change: What to add to the logarithm of the expected error, shape (B,
            1, H, W).
    """

    inverse_depth: Tensor
    log_scale_change: Tensor


class Propagation(nn.Module):
    """A small U-Net that mixes each pixel's depth from depths that are there.

    A network that regresses a depth draws a slope where one surface ends before
    another; a mean of given depths, with weights for each pixel that may be nearly 0
    and 1, draws a step (convolutional spatial propagation: Cheng et al., ECCV 2018;
    here in one step, from fixed offsets, with weights from a softmax). The candidates
    are the refined inverse depth of the pixel, that of the eight pixels around it at
    each of `STEPS_PX`, and the initial one. A small gated residual is added.

    It works at half the resolution, where each 2 x 2 square is one pixel of four times
    the channels: as exact, and cheaper. A fresh one gives all pixels the same weights,
    most of it to the pixel itself, and adds nothing.
    """

    def __init__(self, num_inputs: int, channels: int, levels: int) -> None:
        """Build it with fresh weights.

        Args:
            num_inputs: Channels that it sees.
            channels: Channels of the first level; 8/3 of them at the last.
            levels: Height and width will be multiples of 2**levels.
        """
        super().__init__()
        widths = [channels * factor // 3 for factor in (3, 4, 6, 8)]
        widths = widths[: min(NUM_POOLS, levels - 1) + 1]
        pairs = list(itertools.pairwise(widths))
        self.stem = nn.Sequential(
            conv_block(num_inputs * PACKED_PX**2, channels),
            conv_block(channels, channels),
        )
        self.down = nn.ModuleList(
            nn.Sequential(conv_block(before, after), conv_block(after, after))
            for before, after in pairs
        )
        self.up = nn.ModuleList(
            nn.ConvTranspose2d(after, before, kernel_size=2, stride=2)
            for before, after in pairs
        )
        self.decoder = nn.ModuleList(conv_block(width, width) for width in widths[:-1])
        self.num_candidates = 2 + 8 * len(STEPS_PX)
        num_outputs = (self.num_candidates + NUM_MORE) * PACKED_PX**2
        self.head = nn.Conv2d(channels, num_outputs, kernel_size=3, padding=1)
        nn.init.zeros_(self.head.weight)
        nn.init.zeros_(self.head.bias)  # type: ignore[arg-type] # it has one
        with torch.no_grad():
            self.head.bias[: PACKED_PX**2] = OWN_DEPTH_LOGIT  # type: ignore[index]

    def forward(self, seen: Tensor, refined: Tensor, initial: Tensor) -> Propagated:
        """Mix the depths of a batch of tiles.

        Args:
            seen: What decides, shape (B, C, H, W), float.
            refined: Normalised inverse depth so far, shape (B, 1, H, W).
            initial: The same before any refinement.
        """
        packed = pixel_unshuffle(seen, PACKED_PX)
        outputs = pixel_shuffle(self.head(self._features(packed)), PACKED_PX)
        # Channel by channel from here on, as a processor's cache holds one of them.
        outputs = outputs.to(refined.dtype).contiguous()
        weights = torch.softmax(outputs[:, : self.num_candidates], dim=1)
        last = outputs[:, self.num_candidates :]
        mixed = refined
        for place, candidate in enumerate(_others(refined, initial), start=1):
            step = (candidate - refined).clamp(-LARGEST_STEP, LARGEST_STEP)
            mixed = mixed + weights[:, place : place + 1] * step
        residual = last[:, :1] * torch.sigmoid(last[:, 1:2])
        return Propagated(mixed + residual, last[:, 2:])

    def _features(self, packed: Tensor) -> Tensor:
        maps = [self.stem(packed)]
        for down in self.down:
            maps.append(down(max_pool2d(maps[-1], kernel_size=2)))
        features: Tensor = maps.pop()
        for up, block in zip(reversed(self.up), reversed(self.decoder), strict=True):
            features = block(up(features) + maps.pop())
        return features


def _others(refined: Tensor, initial: Tensor) -> Iterator[Tensor]:
    """The depths to mix the pixel's own with, in order, each of its shape."""
    border = max(STEPS_PX)
    padded = pad(refined, (border, border, border, border), mode="replicate")
    height_px, width_px = refined.shape[-2:]
    for step in STEPS_PX:
        for y, x in itertools.product((-step, 0, step), repeat=2):
            if (y, x) != (0, 0):
                rows = padded[..., border + y :, :][..., :height_px, :]
                yield rows[..., border + x :][..., :width_px]
    yield initial
