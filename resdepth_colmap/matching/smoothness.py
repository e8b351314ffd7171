"""How well a plane goes on in its neighbours. Compiled by numba.

The neighbours are eight near ones, four a knight's move further and four at five
pixels: all are of the other colour of the checkerboard, so that they stand still while
a pixel is updated.
"""

import numpy as np
from numba import njit

from resdepth_colmap.matching.cost import ONE, ZERO

_OFFSETS = (
    *((1, 0), (-1, 0), (0, 1), (0, -1)),
    *((2, 1), (-1, 2), (-2, -1), (1, -2)),
    *((2, -1), (1, 2), (-2, 1), (-1, -2)),
    *((5, 0), (-5, 0), (0, 5), (0, -5)),
)
NUM_NEIGHBORS = len(_OFFSETS)
DX = np.array([dx for dx, _ in _OFFSETS], np.float32)
DY = np.array([dy for _, dy in _OFFSETS], np.float32)
# exp(-a) as (1 - a / 8)^8, see `reference_window`, for a spread of 0.05.
LIKENESS = np.float32(-0.0625 / 0.05**2)
FLOOR = np.float32(0.05)  # an edge of the photo is not always one of the surface


@njit(cache=True, fastmath=True)
def gather_neighbors(reference, planes, x, y, inverse_depths, weights):
    """Inverse depths of the neighbours and their weights by likeness of grey value.

    Args:
        reference: Shape (H, W).
        planes: Shape (H, W, 3).
        x: The pixel.
        y: Likewise.
        inverse_depths: Shape (NUM_NEIGHBORS,), written.
        weights: Likewise; they sum to 1.
    """
    height, width = reference.shape
    total = ZERO
    for k in range(NUM_NEIGHBORS):
        # Beyond the border a neighbour has no weight.
        xs, ys = x + np.int64(DX[k]), y + np.int64(DY[k])
        inside = 0 <= xs < width and 0 <= ys < height
        xs, ys = (xs, ys) if inside else (x, y)
        delta = reference[ys, xs] - reference[y, x]
        weight = max(ONE + delta * delta * LIKENESS, ZERO)
        weight *= weight
        weight *= weight
        weight = weight * weight + FLOOR if inside else ZERO
        inverse_depths[k] = planes[ys, xs, 0]
        weights[k] = weight
        total += weight
    for k in range(NUM_NEIGHBORS):
        weights[k] /= total


@njit(cache=True, fastmath=True)
def roughness(plane, px_per_inverse_depth, inverse_depths, weights):
    """Weighted share of the neighbours in which a plane does not go on, in 0..1.

    A neighbour off by d pixels of disparity counts min(d^2, 1): next to nothing within
    the accuracy of matching, and no more at a step in depth than just beyond one pixel
    (the truncated second-order prior of slanted-plane stereo, Olsson et al., CVPR
    2013; weak texture is decided by it, edges are not smoothed away).
    """
    w, gx, gy = plane[0], plane[1], plane[2]
    total = ZERO
    for k in range(NUM_NEIGHBORS):
        off = (w + gx * DX[k] + gy * DY[k] - inverse_depths[k]) * px_per_inverse_depth
        square = off * off
        total += weights[k] * (square if square < ONE else ONE)
    return total
