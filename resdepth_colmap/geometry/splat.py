"""Measured points as a depth map, by a z-buffer."""

from collections.abc import Iterable

import numpy as np

from resdepth_colmap.geometry.projection import Indices, look_up, pixel_xy, project
from resdepth_colmap.scene import DepthMap, FloatMap, Matrix

FRONT_LAYER = 1.02
"""Points up to this factor behind the nearest one of a pixel are of its surface."""


def splat_depth(
    xyz_chunks: Iterable[Matrix], K: Matrix, height_px: int, width_px: int
) -> DepthMap:
    """The depth of each pixel from the points that fall into it.

    Of the points of the front surface of a pixel the one nearest to its centre is
    taken. Nothing is interpolated: no depth lies between two surfaces.

    Args:
        xyz_chunks: Points in the camera frame, each of shape (N, 3), in units; points
            that are not finite or behind the camera are skipped.
        K: K for index coordinates, shape (3, 3), in pixels.
        height_px: Height of the map.
        width_px: Width of the map.

    Returns:
        Depth, shape (H, W), float32, in units; 0 where no point fell.
    """
    hits = [_hits(xyz, K, height_px, width_px) for xyz in xyz_chunks]
    if not hits:
        return np.zeros((height_px, width_px), np.float32)
    pixels, z, offset = (np.concatenate(part) for part in zip(*hits, strict=True))
    nearest = np.full(height_px * width_px, np.inf, np.float32)
    np.minimum.at(nearest, pixels, z)
    is_front = z <= np.float32(FRONT_LAYER) * nearest[pixels]
    pixels, z, offset = pixels[is_front], z[is_front], offset[is_front]
    least = np.full(height_px * width_px, np.inf, np.float32)
    np.minimum.at(least, pixels, offset)
    is_central = offset == least[pixels]
    depth = np.zeros(height_px * width_px, np.float32)
    depth[pixels[is_central]] = z[is_central]
    return depth.reshape(height_px, width_px)


def _hits(
    xyz: Matrix, K: Matrix, height_px: int, width_px: int
) -> tuple[Indices, FloatMap, FloatMap]:
    """Of each point in the map: flat pixel index, depth, squared offset."""
    xyz = xyz[np.isfinite(xyz).all(axis=-1)]
    seen, pixels = look_up(xyz, K, (height_px, width_px))
    xy, z = project(xyz[seen], K)
    offset = ((xy - pixel_xy(pixels, width_px)) ** 2).sum(axis=-1)
    return pixels, z.astype(np.float32), offset.astype(np.float32)
