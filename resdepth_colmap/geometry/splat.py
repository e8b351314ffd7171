"""Measured points as a depth map: each falls into one pixel, the front ones count."""

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from resdepth_colmap.geometry.projection import project
from resdepth_colmap.scene import DepthMap, FloatMap, Matrix

Indices = npt.NDArray[np.int64]

FRONT_LAYER = 1.02
"""Points up to that factor behind the nearest one of their pixel are its surface."""


def splat_depth(
    xyz_chunks: Iterable[Matrix], K: Matrix, height_px: int, width_px: int
) -> DepthMap:
    """The depth that points give to the pixels they fall into (a z-buffer).

    A pixel may hold many points: those of the front surface count, and of these the one
    nearest to the pixel's centre. Nothing is interpolated, so that no depth lies
    between two surfaces.

    Args:
        xyz_chunks: Points in the camera frame, each of shape (N, 3), in units; what is
            not finite or behind the camera is passed over.
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
    usable = np.isfinite(xyz).all(axis=-1) & (xyz[:, 2] > 0)
    xy, z = project(xyz[usable], K)
    in_reach = (np.abs(xy) < 1e9).all(axis=-1)  # an integer has to hold it
    xy, z = xy[in_reach], z[in_reach]
    rounded = np.rint(xy).astype(np.int64)
    column, row = rounded[:, 0], rounded[:, 1]
    inside = (column >= 0) & (column < width_px) & (row >= 0) & (row < height_px)
    pixels = row[inside] * width_px + column[inside]
    offset = ((xy[inside] - rounded[inside]) ** 2).sum(axis=-1)
    return pixels, z[inside].astype(np.float32), offset.astype(np.float32)
