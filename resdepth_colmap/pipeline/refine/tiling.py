"""Large maps, tile by tile: windows that overlap, blended smoothly."""

import math
from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import pad


class Window(NamedTuple):
    """A rectangle of a map, in pixels."""

    top_px: int
    left_px: int
    height_px: int
    width_px: int

    @property
    def rows(self) -> slice:
        """Its rows in the map."""
        return slice(self.top_px, self.top_px + self.height_px)

    @property
    def columns(self) -> slice:
        """Its columns in the map."""
        return slice(self.left_px, self.left_px + self.width_px)


def tile_windows(
    height_px: int, width_px: int, tile_px: int, overlap_px: int
) -> list[Window]:
    """Windows that cover a map, evenly spread, none reaching beyond it.

    Args:
        height_px: Height of the map.
        width_px: Width of the map.
        tile_px: Side of a tile; a side of the map that is shorter is one tile.
        overlap_px: Least overlap of neighbours, less than a tile.

    Returns:
        The windows, row by row; all of one size.
    """
    return [
        Window(top, left, min(tile_px, height_px), min(tile_px, width_px))
        for top in _starts(height_px, tile_px, overlap_px)
        for left in _starts(width_px, tile_px, overlap_px)
    ]


def blend_weights(height_px: int, width_px: int, ramp_px: int) -> Tensor:
    """How much a tile counts at each of its pixels, before normalisation.

    Args:
        height_px: Height of the tile.
        width_px: Width of the tile.
        ramp_px: Pixels over which the weight rises from nearly 0 at each side.

    Returns:
        Shape (H, W), float32, in (0, 1]; a raised cosine along each axis.
    """
    return _ramp(height_px, ramp_px)[:, None] * _ramp(width_px, ramp_px)


def apply_tiled(
    function: Callable[[Window], Tensor],
    size_px: tuple[int, int],
    tile_px: int,
    overlap_px: int,
) -> Tensor:
    """Compute a map tile by tile and blend the tiles.

    At each pixel the weights of its tiles sum to 1. One tile is held at a time, besides
    the map and its weights.

    Args:
        function: Values of a window, shape (C, height, width), on any device.
        size_px: Height and width of the map.
        tile_px: Side of a tile.
        overlap_px: Least overlap of neighbouring tiles.

    Returns:
        The map, shape (C, H, W), float32, on the CPU.
    """
    windows = tile_windows(*size_px, tile_px, overlap_px)
    weights = blend_weights(windows[0].height_px, windows[0].width_px, overlap_px)
    sum_weights = torch.zeros(size_px)
    blended = torch.zeros(0)
    for window in windows:
        values = function(window).to("cpu", torch.float32)
        if len(windows) == 1:
            return values
        if not len(blended):
            blended = torch.zeros(len(values), *size_px)
        blended[:, window.rows, window.columns] += weights * values
        sum_weights[window.rows, window.columns] += weights
    return blended.div_(sum_weights)


def pad_to_multiple(values: Tensor, multiple_px: int) -> Tensor:
    """Repeat the last row and column until both sides are multiples.

    Args:
        values: Shape (B, C, H, W); H and W of any size.
        multiple_px: What both sides shall be multiples of.

    Returns:
        The values, with rows below and columns to the right added.
    """
    height_px, width_px = values.shape[-2:]
    extra = (0, -width_px % multiple_px, 0, -height_px % multiple_px)
    return pad(values, extra, mode="replicate")


def _starts(length_px: int, tile_px: int, overlap_px: int) -> list[int]:
    last = length_px - tile_px
    if last <= 0:
        return [0]
    num_steps = math.ceil(last / (tile_px - overlap_px))
    return [round(last * step / num_steps) for step in range(num_steps + 1)]


def _ramp(length_px: int, ramp_px: int) -> Tensor:
    centers = torch.arange(length_px, dtype=torch.float32) + 0.5
    from_side = torch.minimum(centers, length_px - centers)
    return torch.sin((from_side / max(ramp_px, 1)).clamp(max=1.0) * (math.pi / 2)) ** 2
