"""The half pixel: the only module that knows where the centre of a pixel lies.

COLMAP's K counts the centre of the upper left pixel as (0.5, 0.5). Arrays, and
`grid_sample(align_corners=True)`, count it as (0, 0): "index" coordinates. All our
mathematics runs in index coordinates, with the K of `index_K`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from resdepth_colmap.scene import Camera, Matrix

if TYPE_CHECKING:
    from torch import Tensor

CENTER_PX = 0.5
"""COLMAP's coordinate of the centre of pixel 0."""


def index_K(camera: Camera) -> Matrix:  # noqa: N802 (K is mathematics)
    """K for index coordinates, shape (3, 3), float64, in pixels."""
    return np.array(
        [
            [camera.fx, 0.0, camera.cx - CENTER_PX],  # COLMAP to index origin
            [0.0, camera.fy, camera.cy - CENTER_PX],
            [0.0, 0.0, 1.0],
        ]
    )


def cropped_K(K: Matrix, left_px: int, top_px: int) -> Matrix:  # noqa: N802
    """K of the crop whose pixel (0, 0) is pixel (left_px, top_px) of the image."""
    cropped = np.array(K, dtype=np.float64)
    cropped[0, 2] -= left_px
    cropped[1, 2] -= top_px
    return cropped


def mirrored_K(K: Matrix, width_px: int) -> Matrix:  # noqa: N802
    """K of an image so wide after its columns have been put in reverse order."""
    mirrored = np.array(K, dtype=np.float64)
    mirrored[0] *= -1.0
    mirrored[0, 2] += width_px - 1
    return mirrored


def to_grid(xy_index: Tensor, width_px: int, height_px: int) -> Tensor:
    """Coordinates for `grid_sample(align_corners=True)`.

    Args:
        xy_index: Index coordinates (x, y), shape (..., 2), in pixels.
        width_px: Width of the sampled image.
        height_px: Height of the sampled image.

    Returns:
        Same shape; the centres of the first and last pixel are -1 and 1. Along an
        axis of one pixel, every coordinate samples that pixel.
    """
    last = xy_index.new_tensor([max(width_px - 1, 1), max(height_px - 1, 1)])
    return xy_index * (2.0 / last) - 1.0


def inside_image(xy_index: Tensor, width_px: int, height_px: int) -> Tensor:
    """Whether a point lies on the area of some pixel, shape (...), bool.

    A pixel reaches half a pixel round its centre, so that rounding does not push the
    outermost centres outside.
    """
    x, y = xy_index[..., 0], xy_index[..., 1]
    in_x = (x >= -CENTER_PX) & (x <= width_px - CENTER_PX)
    in_y = (y >= -CENTER_PX) & (y <= height_px - CENTER_PX)
    return in_x & in_y
