"""One view's depth map, refined: arrays in, arrays out."""

import contextlib
import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.geometry.inverse_depth import invert_map
from resdepth_colmap.geometry.normals import normals_from_depth
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.pipeline.refine.acceptance import UpdateGate
from resdepth_colmap.pipeline.refine.cross_view import SourceMap, start_from
from resdepth_colmap.pipeline.refine.network_inputs import (
    InputStack,
    ViewTensors,
    build_inputs,
    network_input,
    scaled_sampler,
    seen_by_sources,
)
from resdepth_colmap.pipeline.refine.source_sampler import SourceTensors
from resdepth_colmap.pipeline.refine.tiling import Window, apply_tiled, pad_to_multiple
from resdepth_colmap.scene import (
    DepthMap,
    FloatMap,
    GrayImage,
    Matrix,
    NormalMap,
    UnitColors,
    Wanted,
)

LEAST_INVERSE_RATIO = 0.25
LARGEST_INVERSE_RATIO = 4.0
"""The refined inverse depth stays between a quarter of the least and four times the
largest that was measured."""

CONFIDENT_ERROR = 0.01
"""Relative error of the depth that the confidence is about."""

LOG_SCALE_LIMIT = 12.0


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class SourceView:
    """A second view.

    Attributes:
        gray: Its image, of any size, shape (Hs, Ws), in 0..1.
        K: K for index coordinates of that size, shape (3, 3), in pixels.
        source_from_reference: Pose, shape (3, 4), translation in units.
        wanted: Which of its pixels are looked at, shape (Hs, Ws); None = all.
    """

    gray: GrayImage
    K: Matrix
    source_from_reference: Matrix
    wanted: Wanted | None = None


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class ViewInputs:
    """A reference view with its initial depth.

    Attributes:
        depth: Initial depth, shape (H, W), in units; 0 = hole.
        gray: The image at the size of the depth map, shape (H, W), in 0..1.
        colors: The same in colour, RGB, shape (H, W, 3), in 0..1; None = it has none.
        K: K for index coordinates at that size, shape (3, 3), in pixels.
        sources: Second views, best first; may be empty.
        source_maps: Depth maps of other views, the first that of the best; may be
            empty.
        wanted: Which pixels are refined, shape (H, W); None = all. The others are
            neither looked at nor given a depth.
    """

    depth: DepthMap
    gray: GrayImage
    K: Matrix
    sources: tuple[SourceView, ...] = ()
    source_maps: tuple[SourceMap, ...] = ()
    colors: UnitColors | None = None
    wanted: Wanted | None = None

    def __post_init__(self) -> None:
        """Check that image, mask and depth map have one size."""
        if self.gray.shape != self.depth.shape:
            raise ValueError(
                f"{self.gray.shape=} but expected that of the depth map, "
                f"{self.depth.shape}."
            )
        if self.colors is not None and self.colors.shape != (*self.depth.shape, 3):
            raise ValueError(
                f"{self.colors.shape=} but expected RGB values of the size of the "
                f"depth map, {self.depth.shape}."
            )
        if self.wanted is not None and self.wanted.shape != self.depth.shape:
            raise ValueError(
                f"{self.wanted.shape=} but expected that of the depth map, "
                f"{self.depth.shape}."
            )

    @property
    def wanted_depth(self) -> DepthMap:
        """The initial depth of the pixels that are refined; 0 elsewhere."""
        if self.wanted is None:
            return self.depth
        return np.where(self.wanted, self.depth, np.float32(0))


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class RefinedView:
    """A refined depth map.

    Attributes:
        depth: Shape (H, W), float32, in units, > 0 at each wanted pixel, else 0.
        normals: Camera frame, towards the camera, shape (H, W, 3), float32; (0, 0, 0)
            where there is no depth.
        confidence: Probability in 0..1 that the depth is within 1 % of the truth, by
            the network's own estimate of its error, shape (H, W), float32. From a
            network that makes none: the correlation with the best source, at least 0.
            0 where there is no depth.
    """

    depth: DepthMap
    normals: NormalMap
    confidence: FloatMap


def refine_view(
    view: ViewInputs, network: ResDepthNet, config: RefineConfig
) -> RefinedView:
    """Refine a depth map: fill, warp, run the network tile by tile, and again.

    Each pass warps the sources anew with the depth of the pass before. The mask of real
    pixels stays that of the first: it tells the network what was measured. A measured
    depth that a map of another view confirms is kept, and one that the photographs
    confirm, where the network would change it only a little and the photographs speak
    against it. Nor is a change taken that is small beside the error that the network
    itself expects (docs/adr/0006, 0016 and 0018).

    Args:
        view: Initial depth, images and poses; sources that the network does not take
            are not used, missing ones are shown to it as black.
        network: On the device to run on.
        config: Passes and tiles.

    Returns:
        Depth, normals and confidence; none of a view of which no pixel is wanted that
        has an initial depth.

    Raises:
        ValueError: If the initial depth map has no valid pixel.
    """
    if view.wanted is not None and not view.wanted_depth.any():
        return _nothing(view.depth.shape)
    device = next(network.parameters()).device
    with _inference(network):
        tensors = view_tensors(view, device, network.config.source_depth)
        measured = tensors.inverse_depth[tensors.valid]
        low = float(measured.min()) * LEAST_INVERSE_RATIO
        high = float(measured.max()) * LARGEST_INVERSE_RATIO
        initial = tensors.inverse_depth
        num_sources = network.config.num_sources
        seen = seen_by_sources(tensors, num_sources)
        gate = UpdateGate(tensors, num_sources, seen.error)
        for number in range(config.inner_iterations):
            if number > 0:
                seen = seen_by_sources(tensors, num_sources)
            stack = build_inputs(tensors, network.config, seen)
            outputs = _run_tiled(stack, network, config).to(device)[None]
            refined = (tensors.inverse_depth + outputs[:, :1]).clamp(low, high)
            error = outputs[:, 1:2] if network.config.confidence else None
            if config.update_gating:
                is_rejected = gate.rejects(refined, error)
                refined = torch.where(is_rejected, initial, refined)
            tensors = tensors._replace(inverse_depth=refined)
        if error is not None:
            confidence = 1.0 - torch.exp(-CONFIDENT_ERROR * refined / error)
        else:
            confidence = _correlation(tensors, network.config.num_sources)
    depth, confidence_map = invert_map(_array(refined)), _array(confidence)
    if (kept := _kept(view, config)) is not None:
        depth = np.where(kept, depth, np.float32(0))
        confidence_map = np.where(kept, confidence_map, np.float32(0))
    return RefinedView(
        depth=depth,
        normals=normals_from_depth(depth, view.K),
        confidence=confidence_map,
    )


def _nothing(shape: tuple[int, ...]) -> RefinedView:
    blank = np.zeros(shape, np.float32)
    normals = np.zeros((*shape, 3), np.float32)
    return RefinedView(depth=blank, normals=normals, confidence=blank)


def _kept(view: ViewInputs, config: RefineConfig) -> Wanted | None:
    """Which pixels of the result are kept; None = all."""
    if config.keep_empty:
        return invert_map(view.wanted_depth) > 0
    return view.wanted


@contextlib.contextmanager
def _inference(network: ResDepthNet) -> Iterator[None]:
    """No gradients, and batch norm with its learned statistics; then as before."""
    was_training = network.training
    network.eval()
    try:
        with torch.inference_mode():
            yield
    finally:
        network.train(was_training)


def _run_tiled(stack: InputStack, network: ResDepthNet, config: RefineConfig) -> Tensor:
    """Change of the inverse depth, and its expected error if the network tells it.

    Shape (1 or 2, H, W), in 1/unit. The change, not the result: a network that changes
    nothing then returns its input exactly, however the tiles are scaled and blended.
    """

    def run_tile(window: Window) -> Tensor:
        return _refine_tile(stack.crop(*window), network)[0]

    multiple_px = network.config.multiple_px
    tile_px = -(-config.tile_px // multiple_px) * multiple_px
    height_px, width_px = stack.inverse_depth.shape[-2:]
    return apply_tiled(run_tile, (height_px, width_px), tile_px, config.overlap_px)


def _refine_tile(tile: InputStack, network: ResDepthNet) -> Tensor:
    """What `_run_tiled` returns, of one tile of any size, shape (1, 1 or 2, h, w)."""
    channels, scaling = network_input(tile, network.config)
    padded = pad_to_multiple(channels, network.config.multiple_px)
    padded = padded.contiguous(memory_format=torch.channels_last)
    output = network(padded, scaled_sampler(tile, scaling))
    height_px, width_px = channels.shape[-2:]
    refined = output.inverse_depth[..., :height_px, :width_px]
    if network.config.residual:
        change = (refined - channels[:, :1]) * scaling.scale
    else:
        change = scaling.restore(refined) - tile.inverse_depth
    change = torch.nan_to_num(change, nan=0.0, posinf=0.0, neginf=0.0)
    if output.log_scale is None:
        return change
    log_scale = output.log_scale[..., :height_px, :width_px]
    log_scale = torch.nan_to_num(log_scale, nan=LOG_SCALE_LIMIT)
    log_scale = log_scale.clamp(-LOG_SCALE_LIMIT, LOG_SCALE_LIMIT)
    return torch.cat([change, torch.exp(log_scale) * scaling.scale], dim=1)


def view_tensors(view: ViewInputs, device: torch.device, use_maps: bool) -> ViewTensors:
    """A view as tensors on a device, a batch of one.

    Args:
        view: The view.
        device: Where to.
        use_maps: Look at the maps of other views.

    Raises:
        ValueError: If the initial depth map has no valid pixel.
    """
    maps = view.source_maps if use_maps else ()
    start = start_from(view.wanted_depth, view.K, maps, view.wanted)
    return ViewTensors(
        inverse_depth=_image(start.inverse_depth, device),
        valid=_mask(start.valid, device),
        gray=_image(_seen(view.gray, view.wanted), device),
        colors=None
        if view.colors is None
        else _colors(_seen(view.colors, view.wanted), device),
        K=torch.from_numpy(view.K)[None],
        sources=tuple(
            SourceTensors(
                _image(_seen(source.gray, source.wanted), device),
                torch.from_numpy(source.K)[None],
                torch.from_numpy(source.source_from_reference)[None],
                None if source.wanted is None else _mask(source.wanted, device),
            )
            for source in view.sources
        ),
        reprojected=_map(start.reprojected, device),
        num_consistent=_map(start.num_consistent, device),
        is_filtered=start.is_filtered,
        wanted=None if view.wanted is None else _mask(view.wanted, device),
    )


def _seen(image: FloatMap, wanted: Wanted | None) -> FloatMap:
    """An image, grey or in colour, black where it is not to be looked at."""
    if wanted is None:
        return image
    return np.where(wanted if image.ndim == 2 else wanted[..., None], image, 0.0)


def _image(gray: GrayImage, device: torch.device) -> Tensor:
    return torch.from_numpy(np.array(gray, dtype=np.float32))[None, None].to(device)


def _colors(colors: UnitColors, device: torch.device) -> Tensor:
    planes = np.ascontiguousarray(colors.transpose(2, 0, 1), dtype=np.float32)
    return torch.from_numpy(planes)[None].to(device)


def _mask(flags: NDArray[np.bool_], device: torch.device) -> Tensor:
    return torch.from_numpy(flags)[None, None].to(device)


def _map(values: NDArray[Any] | None, device: torch.device) -> Tensor | None:
    return None if values is None else torch.from_numpy(values)[None, None].to(device)


def _correlation(tensors: ViewTensors, num_sources: int) -> Tensor:
    badness = seen_by_sources(tensors, num_sources).error
    return (1.0 - 2.0 * badness).clamp(min=0.0)


def _array(values: Tensor) -> FloatMap:
    array: FloatMap = values[0, 0].cpu().numpy()
    return array
