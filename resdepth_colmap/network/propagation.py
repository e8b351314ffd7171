"""The propagation network: depths mixed from the surroundings (docs/adr/0015)."""

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn.functional import max_pool2d, pad, pixel_shuffle, pixel_unshuffle

from resdepth_colmap.network.conv_block import conv_block

STEPS_PX = (2, 5)
"""Offsets of the neighbouring pixels whose depth a pixel may take."""

NUM_POOLS = 3
NUM_MORE = 3  # a residual, its gate, and what to add to the logarithm of the error
PACKED_PX = 2  # the convolutions see squares of 2 x 2 pixels as channels
EXTREME_RADIUS_PX = 6  # a matcher's window of 11 x 11 makes things fatter by 5
LARGEST_STEP = 16.0  # from one input limit of the networks to the other
OWN_DEPTH_LOGIT = 4.0  # three quarters of the weight


class Propagated(NamedTuple):
    """Outputs of the propagation network for each pixel.

    Attributes:
        inverse_depth: Normalised inverse depth, shape (B, 1, H, W).
        log_scale_change: What to add to the logarithm of the expected error, shape (B,
            1, H, W).
    """

    inverse_depth: Tensor
    log_scale_change: Tensor


class Propagation(nn.Module):
    """A small U-Net that mixes the depth of each pixel from candidate depths.

    A network that regresses depth draws a slope across a depth edge; a weighted mean of
    candidates, whose weights may be nearly 0 and 1, draws a step (convolutional spatial
    propagation: Cheng et al., ECCV 2018; here in one step, from fixed offsets, with
    weights from a softmax). The candidates are the refined inverse depth of the pixel,
    that of the eight pixels around it at each of `STEPS_PX`, the initial one, and those
    of the caller. A small gated residual is added.

    It works at half the resolution, where each square of 2 x 2 pixels is one pixel of
    four times the channels: as exact, and cheaper. With fresh weights all pixels have
    the same weights, most of it on the pixel itself, and the residual is 0.
    """

    def __init__(
        self, num_inputs: int, channels: int, levels: int, num_more: int = 0
    ) -> None:
        """Build it with fresh weights.

        Args:
            num_inputs: Number of input channels.
            channels: Channels of the first level; 8/3 of them at the last.
            levels: Height and width will be multiples of 2**levels.
            num_more: Number of candidate depths that the caller adds.
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
        self.num_candidates = 2 + 8 * len(STEPS_PX) + num_more
        num_outputs = (self.num_candidates + NUM_MORE) * PACKED_PX**2
        self.head = nn.Conv2d(channels, num_outputs, kernel_size=3, padding=1)
        nn.init.zeros_(self.head.weight)
        nn.init.zeros_(self.head.bias)  # type: ignore[arg-type] # it has one
        with torch.no_grad():
            self.head.bias[: PACKED_PX**2] = OWN_DEPTH_LOGIT  # type: ignore[index]

    def forward(
        self,
        inputs: Tensor,
        refined: Tensor,
        initial: Tensor,
        more: Sequence[Tensor] = (),
    ) -> Propagated:
        """Mix the depths of a batch of tiles.

        Args:
            inputs: Input channels, shape (B, C, H, W), float.
            refined: Normalised inverse depth from the U-Net, shape (B, 1, H, W).
            initial: The same before the refinement.
            more: Further candidates, each of that shape.
        """
        packed = pixel_unshuffle(inputs, PACKED_PX)
        outputs = pixel_shuffle(self.head(self._features(packed)), PACKED_PX)
        # Channel by channel from here on: the cache of a CPU holds one of them.
        outputs = outputs.to(refined.dtype).contiguous()
        logits, last = torch.split(outputs, [self.num_candidates, NUM_MORE], dim=1)
        # Unbound at once: the gradient of a slice is as large as the whole tensor.
        _, *weights = torch.softmax(logits, dim=1)[:, :, None].unbind(dim=1)
        residual, gate, log_scale_change = last[:, :, None].unbind(dim=1)
        mixed = refined
        candidates = (*_around(refined), initial, *more)
        for weight, candidate in zip(weights, candidates, strict=True):
            step = (candidate - refined).clamp(-LARGEST_STEP, LARGEST_STEP)
            mixed = mixed + weight * step
        return Propagated(mixed + residual * torch.sigmoid(gate), log_scale_change)

    def _features(self, packed: Tensor) -> Tensor:
        maps = [self.stem(packed)]
        for down in self.down:
            maps.append(down(max_pool2d(maps[-1], kernel_size=2)))
        features: Tensor = maps.pop()
        for up, block in zip(reversed(self.up), reversed(self.decoder), strict=True):
            features = block(up(features) + maps.pop())
        return features


def extremes(inverse_depth: Tensor) -> tuple[Tensor, Tensor]:
    """The nearest and the farthest surface within `EXTREME_RADIUS_PX` of each pixel.

    Args:
        inverse_depth: Shape (B, 1, H, W), normalised or not.

    Returns:
        The greatest and the least value of the square around each pixel, each of that
        shape.
    """
    return _greatest(inverse_depth), -_greatest(-inverse_depth)


def _greatest(values: Tensor) -> Tensor:
    padded = pad(values, (EXTREME_RADIUS_PX,) * 4, value=-math.inf)
    return _running_greatest(_running_greatest(padded, dim=-2), dim=-1)


def _running_greatest(values: Tensor, dim: int) -> Tensor:
    """Of windows along one axis; by doubling, several times faster than max pooling."""
    length, wanted = 1, 2 * EXTREME_RADIUS_PX + 1
    while length < wanted:
        step = min(length, wanted - length)
        size = values.shape[dim] - step
        values = torch.maximum(
            values.narrow(dim, 0, size), values.narrow(dim, step, size)
        )
        length += step
    return values


def _around(refined: Tensor) -> Iterator[Tensor]:
    """The depths of the pixels around each pixel, in order, each of its shape."""
    border = max(STEPS_PX)
    padded = pad(refined, (border, border, border, border), mode="replicate")
    height_px, width_px = refined.shape[-2:]
    for step in STEPS_PX:
        for y, x in itertools.product((-step, 0, step), repeat=2):
            if (y, x) != (0, 0):
                rows = padded[..., border + y :, :][..., :height_px, :]
                yield rows[..., border + x :][..., :width_px]
