"""The depth map of a source, reprojected into the reference camera.

Where no depth of the source arrives, the source does not see the surface (or has no
depth there), and its image says nothing about the depth of the reference.
"""

import itertools

import torch
from torch import Tensor

from resdepth_colmap.geometry.warp import LEAST_DEPTH_RATIO, project_homogeneous

REACH_PX = 0.25
"""How far a point extends beyond the pixel that it falls into."""


def reproject_inverse_depth(
    source_inverse_depth: Tensor,
    source_K: Tensor,
    reference_K: Tensor,
    source_from_reference: Tensor,
    size_px: tuple[int, int],
) -> Tensor:
    """Reproject a depth map into the reference, with a z-buffer.

    Each point covers a little more than a pixel, so that a surface stays closed where
    the reference sees it up to 1.5 times larger; the nearest of several points wins.
    Nothing is interpolated: no depth lies between two surfaces.

    Args:
        source_inverse_depth: Shape (B, 1, Hs, Ws), in 1/unit; 0 = no depth.
        source_K: K for index coordinates, shape (B, 3, 3), in pixels.
        reference_K: K of the reference, likewise.
        source_from_reference: Pose, shape (B, 3, 4), translation in units.
        size_px: Height and width of the reference.

    Returns:
        Inverse depth in the reference, shape (B, 1, H, W), in 1/unit; 0 where no depth
        of the source arrives.
    """
    height_px, width_px = size_px
    homogeneous = project_homogeneous(
        source_inverse_depth, source_K, reference_K, _inverse(source_from_reference)
    )
    depth_ratio = homogeneous[:, 2]
    usable = (source_inverse_depth[:, 0] > 0) & (depth_ratio > LEAST_DEPTH_RATIO)
    ratio = torch.where(usable, depth_ratio, 1.0)
    inverse_depth = (source_inverse_depth[:, 0] / ratio).flatten(1)
    # A border of one pixel takes the points that fall outside.
    columns, rows = (
        [
            torch.round(xy + shift).clamp(-1, size).int() + 1
            for shift in (-REACH_PX, REACH_PX)
        ]
        for size, xy in zip(
            (width_px, height_px),
            torch.where(usable, homogeneous[:, :2].movedim(1, 0) / ratio, -2.0),
            strict=True,
        )
    )
    shape = (len(inverse_depth), 1, height_px + 2, width_px + 2)
    reprojected = inverse_depth.new_zeros(shape).flatten(1)
    for column, row in itertools.product(columns, rows):
        pixels = (row * (width_px + 2) + column).flatten(1).long()
        reprojected.scatter_reduce_(1, pixels, inverse_depth, reduce="amax")
    return reprojected.reshape(shape)[..., 1:-1, 1:-1]


def _inverse(pose: Tensor) -> Tensor:
    """The inverse pose, shape (B, 3, 4)."""
    rotation = pose[..., :3].transpose(-1, -2)
    return torch.cat([rotation, -rotation @ pose[..., 3:]], dim=-1)
