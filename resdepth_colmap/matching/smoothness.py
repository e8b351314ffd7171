"""How well a plane goes on in its neighbours. Compiled by numba.

The neighbours are eight near ones, four a knight's move further and four at five
pixels: all are of the other colour of the checkerboard, so that they stand still while
a pixel is updated.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from resdepth_colmap.matching.plane import inverse_depth_beside
from resdepth_colmap.matching.views import ONE, ZERO, FloatArray

_OFFSETS = (
    *((1, 0), (-1, 0), (0, 1), (0, -1)),
    *((2, 1), (-1, 2), (-2, -1), (1, -2)),
    *((2, -1), (1, 2), (-2, 1), (-1, -2)),
    *((5, 0), (-5, 0), (0, 5), (0, -5)),
)
NUM_NEIGHBORS = len(_OFFSETS)
DX = np.array([dx for dx, _ in _OFFSETS], np.float32)
DY = np.array([dy for _, dy in _OFFSETS], np.float32)
# exp(-a) as (1 - a / 8)^8, see `cost.py`, for a spread of 0.05.
LIKENESS = np.float32(-0.0625 / 0.05**2)
FLOOR = np.float32(0.05)  # an edge of the photo is not always one of the surface


class Neighbors(NamedTuple):
    """The neighbours of a pixel.

    Attributes:
        inverse_depths: Shape (NUM_NEIGHBORS,), in 1/unit.
        weights: By likeness of grey value, likewise; they sum to 1. Beyond the border
            0, and all 0 where there is no smoothness term.
    """

    inverse_depths: FloatArray
    weights: FloatArray


@njit(cache=True, fastmath=True)
def gather_neighbors(gray, planes, x, y, neighbors):
    """Fill the neighbours of a pixel.

    Args:
        gray: Grey values of the reference, shape (H, W).
        planes: Shape (H, W, 3).
        x: The pixel.
        y: Likewise.
        neighbors: Written.
    """
    height, width = gray.shape
    total = ZERO
    for k in range(NUM_NEIGHBORS):
        xs, ys = x + np.int64(DX[k]), y + np.int64(DY[k])
        inside = 0 <= xs < width and 0 <= ys < height
        xs, ys = (xs, ys) if inside else (x, y)
        delta = gray[ys, xs] - gray[y, x]
        weight = max(ONE + delta * delta * LIKENESS, ZERO)
        weight *= weight
        weight *= weight
        weight = weight * weight + FLOOR if inside else ZERO
        neighbors.inverse_depths[k] = planes[ys, xs, 0]
        neighbors.weights[k] = weight
        total += weight
    for k in range(NUM_NEIGHBORS):
        neighbors.weights[k] /= total


@njit(cache=True, fastmath=True)
def roughness(plane, px_per_w, neighbors):
    """Weighted share of the neighbours in which a plane does not go on, in 0..1.

    A neighbour off by d pixels of disparity counts min(d^2, 1): next to nothing within
    the accuracy of matching, and no more at a step in depth than just beyond one pixel
    (the truncated second-order prior of slanted-plane stereo, Olsson et al., CVPR
    2013; weak texture is decided by it, edges are not smoothed away).

    Args:
        plane: Of the pixel.
        px_per_w: Pixels of disparity per unit of inverse depth.
        neighbors: Of the pixel.
    """
    total = ZERO
    for k in range(NUM_NEIGHBORS):
        w = inverse_depth_beside(plane, DX[k], DY[k])
        off = (w - neighbors.inverse_depths[k]) * px_per_w
        square = off * off
        total += neighbors.weights[k] * (square if square < ONE else ONE)
    return total
