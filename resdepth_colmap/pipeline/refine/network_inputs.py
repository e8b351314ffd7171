"""The network's inputs: one way to build them, for training and for use.

First the whole view is warped and stacked (a source image cannot be cut into tiles);
then each tile is cut out and normalised by itself, as the paper centres its patches.
"""

import math
from typing import NamedTuple, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from resdepth_colmap.geometry.holes import fill_holes
from resdepth_colmap.geometry.inverse_depth import invert_map
from resdepth_colmap.geometry.warp import warp_to_reference
from resdepth_colmap.network.network_config import (
    BLUE,
    RED,
    REPROJECTED,
    REPROJECTED_CHANGE,
    NetworkConfig,
    Normalisation,
)
from resdepth_colmap.network.unet import INPUT_LIMIT, SampleSource
from resdepth_colmap.pipeline.refine.photometric_error import photometric_error
from resdepth_colmap.pipeline.refine.source_sampler import (
    Sight,
    SourceSampler,
    SourceTensors,
)
from resdepth_colmap.scene import DepthMap, FloatMap

LEAST_VALID_SHARE = 0.05  # below it, filled pixels count in the statistics too
LEAST_RELATIVE_SPREAD = 0.02  # of the median: a fronto-parallel wall has no spread
STATISTICS_SIDE_PX = 256  # quantiles of more pixels than that squared cost only time
LARGEST_CHANGE = 4.0  # relative, of what another map says; more is an outlier
LEAST_WEIGHT = 1e-3  # of a pixel in an interpolated value
DEFAULT_BASELINE_RATIO = 0.1  # baseline over depth where there is no second view


class ViewTensors(NamedTuple):
    """A reference view with its initial depth, and the views to compare it with.

    Attributes:
        inverse_depth: Initial inverse depth, holes filled, shape (B, 1, H, W), 1/unit.
        valid: Where the depth was real, not filled, shape (B, 1, H, W), bool.
        gray: Grey values of the reference in 0..1, shape (B, 1, H, W).
        K: K of the reference for index coordinates, shape (B, 3, 3), in pixels.
        sources: Second views, best first; may be empty.
        reprojected: The depth maps of other views, reprojected, shape (B, 1, H, W), in
            1/unit; 0 = nothing. None = there are no such maps.
        num_consistent: How many of these say the same as the initial depth, shape (B,
            1, H, W), uint8; likewise.
        colors: RGB values of the reference in 0..1, shape (B, 3, H, W); None = it is
            grey.
        is_filtered: Whether a filter has left its holes, so that what is there is sure.
        wanted: Which pixels of the reference count, shape (B, 1, H, W), bool; None =
            all. The others are black, and have no valid depth.
    """

    inverse_depth: Tensor
    valid: Tensor
    gray: Tensor
    K: Tensor
    sources: tuple[SourceTensors, ...]
    reprojected: Tensor | None = None
    num_consistent: Tensor | None = None
    colors: Tensor | None = None
    is_filtered: bool = False
    wanted: Tensor | None = None


class InputStack(NamedTuple):
    """All that the network may see of a view, inverse depth not yet normalised.

    Attributes:
        inverse_depth: Shape (B, 1, H, W), in 1/unit, > 0.
        valid: Shape (B, 1, H, W), bool.
        guidance: The channels of the network that follow "inverse_depth", in the order
            of `NetworkConfig.channels`, shape (B, C, H, W); C may be 0.
        baseline: Distance to the first source, shape (B, 1, 1, 1), in units.
        source_sampler: Shows the first source at other depths than the initial one;
            None = there is no source, or the network takes none.
    """

    inverse_depth: Tensor
    valid: Tensor
    guidance: Tensor
    baseline: Tensor
    source_sampler: SourceSampler | None = None

    def crop(self, top_px: int, left_px: int, height_px: int, width_px: int) -> Self:
        """The same of a window of the view."""
        sample_source = self.source_sampler
        rows = slice(top_px, top_px + height_px)
        columns = slice(left_px, left_px + width_px)
        return self._replace(
            inverse_depth=self.inverse_depth[..., rows, columns],
            valid=self.valid[..., rows, columns],
            guidance=self.guidance[..., rows, columns],
            source_sampler=sample_source and sample_source.crop(top_px, left_px),
        )


class Scaling(NamedTuple):
    """How a tile's inverse depth is normalised: (inverse depth - offset) / scale.

    Attributes:
        offset: Shape (B, 1, 1, 1), in 1/unit.
        scale: Shape (B, 1, 1, 1), in 1/unit, > 0.
    """

    offset: Tensor
    scale: Tensor

    def normalise(self, inverse_depth: Tensor) -> Tensor:
        """Inverse depth, shape (B, 1, H, W), in 1/unit, to the network's numbers."""
        return (inverse_depth - self.offset) / self.scale

    def restore(self, normalised: Tensor) -> Tensor:
        """The network's numbers to inverse depth, shape (B, 1, H, W), in 1/unit."""
        return normalised * self.scale + self.offset


def initial_maps(depth: DepthMap) -> tuple[FloatMap, NDArray[np.bool_]]:
    """What a depth map becomes.

    Args:
        depth: Initial depth, shape (H, W), in units; 0 = hole.

    Returns:
        Inverse depth with its holes filled, shape (H, W), float32, in 1/unit; and where
        the depth was real, shape (H, W).

    Raises:
        ValueError: If no pixel is valid.
    """
    return invert_map(fill_holes(depth)), invert_map(depth) > 0


class Seen(NamedTuple):
    """The sources, warped into the reference by a view's depth.

    Attributes:
        warped: Of each source the image and where it is inside, in the reference
            camera, shapes (B, 1, H, W).
        error: Photometric error of the best of them, likewise; 0 = the same pattern
            (`photometric_error`).
    """

    warped: tuple[tuple[Tensor, Tensor], ...]
    error: Tensor


def seen_by_sources(view: ViewTensors, num_sources: int) -> Seen:
    """Look through so many sources, or as many as there are."""
    warped = warp_sources(view, num_sources)
    return Seen(tuple(warped), photometric_error(view.gray, warped))


def build_inputs(
    view: ViewTensors, config: NetworkConfig, seen: Seen | None = None
) -> InputStack:
    """Warp the second views and stack what the network of that configuration sees.

    Args:
        view: The view; sources beyond `config.num_sources` are not looked at, missing
            ones become channels of zeros.
        config: Says which channels. The baseline too is that of a view without
            sources if the network sees none: it must not depend on who calls.
        seen: By the sources of that network, if it is known.

    Returns:
        The stack, on the device and in the type of the view's inverse depth.
    """
    channels = {"reference": view.gray, "valid": view.valid.to(view.gray.dtype)}
    channels |= _color_channels(view)
    if config.uses_sources:
        seen = seen or seen_by_sources(view, config.num_sources)
        channels["photo_consistency"] = seen.error
        for index in range(config.num_sources):
            is_there = index < len(seen.warped)
            image = seen.warped[index][0] if is_there else torch.zeros_like(view.gray)
            channels[f"source_{index}"] = image
    channels |= _reprojected_channels(view)
    names = [name for name in config.channels if name != "inverse_depth"]
    if not config.uses_sources:
        view = view._replace(sources=())
    nothing = view.inverse_depth[:, :0]
    guidance = torch.cat([nothing, *(channels[name] for name in names)], dim=1)
    return InputStack(
        inverse_depth=view.inverse_depth,
        valid=view.valid,
        guidance=guidance,
        baseline=_baseline(view),
        source_sampler=_source_sampler(view),
    )


def warp_sources(view: ViewTensors, num_sources: int) -> list[tuple[Tensor, Tensor]]:
    """The first sources in the reference camera: (image, inside) of each.

    Pixels that do not count, of either view, are as outside.
    """
    return [_warped(view, source) for source in view.sources[:num_sources]]


def _warped(view: ViewTensors, source: SourceTensors) -> tuple[Tensor, Tensor]:
    planes = source.gray
    if source.wanted is not None:
        planes = torch.cat([planes, source.wanted.to(planes.dtype)], dim=1)
    warped, inside = warp_to_reference(
        planes, view.inverse_depth, view.K, source.K, source.source_from_reference
    )
    image, wanted = warped[:, :1], warped[:, 1:]
    if source.wanted is not None:  # all of the four pixels that are interpolated
        inside = inside & (wanted > 1.0 - LEAST_WEIGHT)
    if view.wanted is not None:
        inside = inside & view.wanted
    if source.wanted is not None or view.wanted is not None:
        image = torch.where(inside, image, 0.0)
    return image, inside


def tile_scaling(stack: InputStack, kind: Normalisation) -> Scaling:
    """The normalisation of a tile.

    The statistics use real pixels only, unless these are too few.

    Args:
        stack: The tile, or a batch of tiles.
        kind: Which statistics.

    Returns:
        Offset and scale of each tile of the batch.
    """
    step = max(1, max(stack.inverse_depth.shape[-2:]) // STATISTICS_SIDE_PX)
    values = stack.inverse_depth[..., ::step, ::step].flatten(1)
    counts = stack.valid[..., ::step, ::step].flatten(1)
    enough = counts.float().mean(dim=1, keepdim=True) >= LEAST_VALID_SHARE
    values = torch.where(counts | ~enough, values, math.nan)
    if kind is Normalisation.BASELINE:
        return Scaling(_per_tile(values.nanmean(dim=1)), 1.0 / stack.baseline)
    values, device = values.cpu(), values.device  # Apple's GPUs know no quantiles
    levels = values.new_tensor([0.1, 0.5, 0.9])
    low, median, high = torch.nanquantile(values, levels, dim=1)
    spread = torch.maximum(0.5 * (high - low), LEAST_RELATIVE_SPREAD * median)
    return Scaling(_per_tile(median).to(device), _per_tile(spread).to(device))


def network_input(stack: InputStack, config: NetworkConfig) -> tuple[Tensor, Scaling]:
    """What the network is fed for a tile (or a batch of tiles).

    Args:
        stack: The tile, cut from what `build_inputs` made.
        config: The configuration that the stack was built for.

    Returns:
        The channels of `config.channels`, shape (B, C, H, W); and the scaling that
        turns the network's output back into inverse depth, or true inverse depth into
        the network's target.
    """
    scaling = tile_scaling(stack, config.normalisation)
    if not config.residual:
        return stack.guidance, scaling
    normalised = scaling.normalise(stack.inverse_depth)
    guidance = stack.guidance
    if REPROJECTED_CHANGE in config.channels:
        place = config.channels.index(REPROJECTED_CHANGE) - 1
        change = guidance[:, place : place + 1] * stack.inverse_depth / scaling.scale
        change = change.clamp(-INPUT_LIMIT, INPUT_LIMIT)
        after = guidance[:, place + 1 :]
        guidance = torch.cat([guidance[:, :place], change, after], dim=1)
    return torch.cat([normalised, guidance], dim=1), scaling


def scaled_sampler(stack: InputStack, scaling: Scaling) -> SampleSource | None:
    """What a network that looks again is given, besides `network_input`.

    Args:
        stack: The tile, or a batch of tiles.
        scaling: Of the same.
    """
    if stack.source_sampler is None:
        return None
    gray_at = stack.source_sampler.gray_at
    return lambda normalised: gray_at(scaling.restore(normalised))


def _source_sampler(view: ViewTensors) -> SourceSampler | None:
    if not view.sources:
        return None
    source = view.sources[0]
    return SourceSampler(
        tuple(Sight(K, source.item(place)) for place, K in enumerate(view.K))
    )


def _color_channels(view: ViewTensors) -> dict[str, Tensor]:
    """What grey does not tell: red and blue. Those of a grey photo are its grey."""
    if view.colors is None:
        return {RED: view.gray, BLUE: view.gray}
    return {RED: view.colors[:, 0:1], BLUE: view.colors[:, 2:3]}


def _reprojected_channels(view: ViewTensors) -> dict[str, Tensor]:
    """Relative difference of what the maps say, and where they say anything."""
    if view.reprojected is None:
        nothing = torch.zeros_like(view.gray)
        return {REPROJECTED_CHANGE: nothing, REPROJECTED: nothing}
    is_there = view.reprojected > 0
    change = view.reprojected / view.inverse_depth - 1.0
    change = torch.where(is_there, change, 0.0).clamp(max=LARGEST_CHANGE)
    return {REPROJECTED_CHANGE: change, REPROJECTED: is_there.to(view.gray.dtype)}


def _baseline(view: ViewTensors) -> Tensor:
    if view.sources:
        translation = view.sources[0].source_from_reference[..., 3]
        return _per_tile(translation.norm(dim=-1)).to(view.inverse_depth)
    mean = view.inverse_depth.mean(dim=(1, 2, 3))
    return _per_tile(DEFAULT_BASELINE_RATIO / mean)


def _per_tile(values: Tensor) -> Tensor:
    return values[:, None, None, None]
