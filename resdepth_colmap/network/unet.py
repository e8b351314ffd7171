"""ResDepth's U-Net (paper, section "Network Architecture")."""

from collections.abc import Callable
from typing import NamedTuple, cast

import torch
from torch import Tensor, nn

from resdepth_colmap.network.conv_block import conv_block
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.network.propagation import Propagation, extremes

INPUT_LIMIT = 8.0
"""Limit of the normalised inverse depth that the convolutions see, both signs."""

LOG_SCALE_LIMITS = (-8.0, 4.0)
"""Limits of the logarithm of the expected error that the propagation sees."""

SampleSource = Callable[[Tensor], Tensor]
"""Grey values of the first source where normalised inverse depths, shape (B, C, H, W),
would project into it, of that shape."""


class Refinement(NamedTuple):
    """Outputs of the network for each pixel.

    Attributes:
        inverse_depth: Normalised inverse depth, shape (B, 1, H, W).
        log_scale: Logarithm of the expected absolute error of `inverse_depth`, shape
            (B, 1, H, W); None from a network without confidence.
    """

    inverse_depth: Tensor
    log_scale: Tensor | None


class ResDepthNet(nn.Module):
    """A U-Net that adds a residual to the inverse depth in its channel 0.

    The structure is that of the published code: each encoder level is a 3x3
    convolution, batch norm, ReLU and 2x2 max pooling; one such convolution at the
    bottleneck; each decoder level is a 2x2 up-convolution that keeps its channels, the
    addition of the encoder's map of that size, and a 3x3 convolution to the channels of
    the next level; a plain 3x3 convolution ends it, with `last_block` after one more
    block at full resolution (the published code has none). Channels double
    from `base_channels` up to `max_channels`. At 64 to 512 channels, 7 levels and three
    inputs it has 24.2 million parameters, and a tile of 512 x 512 reaches the
    bottleneck as 512 x 4 x 4.

    The last convolution starts at zero, so that a fresh network returns its input depth
    exactly. Outliers of PatchMatch are many times the spread of a tile: channel 0 is
    clamped to `INPUT_LIMIT` for the convolutions, while the residual is added to it
    unclamped. A `Propagation` follows unless `propagation_channels` is 0.
    """

    def __init__(self, config: NetworkConfig) -> None:
        """Build the network with fresh weights.

        Args:
            config: Sizes, inputs and outputs.
        """
        super().__init__()
        self.config = config
        widths = [
            min(config.base_channels * 2**level, config.max_channels)
            for level in range(config.levels)
        ]
        inputs = [len(config.channels), *widths[:-1]]
        outputs = [widths[0], *widths[:-1]]
        self.encoder = nn.ModuleList(
            conv_block(before, after)
            for before, after in zip(inputs, widths, strict=True)
        )
        self.pool = nn.MaxPool2d(kernel_size=2)
        self.bottleneck = conv_block(widths[-1], widths[-1])
        self.up = nn.ModuleList(
            nn.ConvTranspose2d(width, width, kernel_size=2, stride=2)
            for width in reversed(widths)
        )
        self.decoder = nn.ModuleList(
            conv_block(before, after)
            for before, after in zip(widths[:0:-1], outputs[:0:-1], strict=True)
        )
        self.last_block = (
            conv_block(widths[0], widths[0]) if config.last_block else nn.Identity()
        )
        num_outputs = 1 + config.gate + config.confidence
        self.head = nn.Conv2d(widths[0], num_outputs, kernel_size=3, padding=1)
        nn.init.zeros_(self.head.weight)
        nn.init.zeros_(cast(Tensor, self.head.bias))
        self.propagation = (
            Propagation(
                len(config.propagation_inputs),
                config.propagation_channels,
                config.levels,
                num_more=2 * config.resamples_source,
            )
            if config.propagates
            else None
        )

    def forward(
        self, stack: Tensor, sample_source: SampleSource | None = None
    ) -> Refinement:
        """Refine a batch of tiles.

        Args:
            stack: Inputs in the order of `config.channels`, shape (B, C, H, W), float;
                channel 0 is the normalised inverse depth unless the variant is
                images-only. H and W are multiples of 2**levels.
            sample_source: Samples the first source at given depths; without it a
                network with source resampling gets zeros.

        Returns:
            The refined inverse depth and its expected error, both normalised.

        Raises:
            ValueError: For another number of channels or another size.
        """
        self._check(stack)
        features = self._decode(self._encode(self._squash(stack)))
        outputs = self.head(features)
        residual = outputs[:, :1]
        if self.config.gate:
            residual = residual * torch.sigmoid(outputs[:, 1:2])
        refined = stack[:, :1] + residual if self.config.residual else residual
        log_scale = outputs[:, -1:] if self.config.confidence else None
        return self._propagate(
            stack, Refinement(refined, log_scale), features, sample_source
        )

    def _propagate(
        self,
        stack: Tensor,
        before: Refinement,
        features: Tensor,
        sample_source: SampleSource | None,
    ) -> Refinement:
        if self.propagation is None:
            return before
        inputs = [before.inverse_depth.clamp(-INPUT_LIMIT, INPUT_LIMIT)]
        if before.log_scale is not None:
            inputs.append(before.log_scale.clamp(*LOG_SCALE_LIMITS))
        inputs.append(self._squash(stack))
        more: tuple[Tensor, ...] = ()
        if self.config.resamples_source:
            more = extremes(before.inverse_depth)
            inputs.append(
                _resampled(torch.cat([before.inverse_depth, *more], 1), sample_source)
            )
            inputs += [depth.clamp(-INPUT_LIMIT, INPUT_LIMIT) for depth in more]
        if self.config.shared_features:
            inputs.append(features)
        propagated = self.propagation(
            torch.cat(inputs, dim=1), before.inverse_depth, stack[:, :1], more
        )
        log_scale = before.log_scale
        if log_scale is not None:
            log_scale = log_scale + propagated.log_scale_change
        return Refinement(propagated.inverse_depth, log_scale)

    def _encode(self, features: Tensor) -> list[Tensor]:
        """Maps of all sizes, finest first; the bottleneck last."""
        maps = []
        for block in self.encoder:
            maps.append(block(features))
            features = self.pool(maps[-1])
        return [*maps, self.bottleneck(features)]

    def _decode(self, maps: list[Tensor]) -> Tensor:
        features = maps.pop()
        for up, block in zip(self.up[:-1], self.decoder, strict=True):
            features = block(up(features) + maps.pop())
        finest: Tensor = self.last_block(self.up[-1](features) + maps.pop())
        return finest

    def _squash(self, stack: Tensor) -> Tensor:
        if not self.config.residual:
            return stack
        squashed = stack[:, :1].clamp(-INPUT_LIMIT, INPUT_LIMIT)
        return torch.cat([squashed, stack[:, 1:]], dim=1)

    def _check(self, stack: Tensor) -> None:
        names, multiple_px = self.config.channels, self.config.multiple_px
        if stack.ndim != 4 or stack.shape[1] != len(names):
            raise ValueError(
                f"{tuple(stack.shape)=} but expected (B, {len(names)}, H, W) with the "
                f"channels {', '.join(names)}."
            )
        height_px, width_px = stack.shape[-2:]
        if height_px % multiple_px or width_px % multiple_px:
            raise ValueError(
                f"input of {width_px} x {height_px} px but {self.config.levels} levels "
                f"need multiples of {multiple_px} px."
            )


def _resampled(depths: Tensor, sample_source: SampleSource | None) -> Tensor:
    """The first source at these depths; no gradient flows into the depths."""
    if sample_source is None:
        return torch.zeros_like(depths)
    return sample_source(depths.detach().float()).to(depths.dtype)
