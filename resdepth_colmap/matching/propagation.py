"""Which planes a pixel tries from its surroundings. Compiled by numba.

Adaptive checkerboard sampling (Xu & Tao, ACMM, CVPR 2019, figure 1c; ACMM.cu,
CheckerboardPropagation): from each of eight regions the plane of the least cost.
"""

import numpy as np
from numba import njit

from resdepth_colmap.matching.plane import (
    Plane,
    faces_camera,
    inverse_depth_beside,
    load_plane,
    plane_normal,
    store_plane,
)

NUM_PROPAGATED = 9  # the pixel's own plane and those of eight regions

# Four near regions shaped like a V and four far strips. All offsets are odd, so that a
# sweep over one colour reads only the other one and its result does not depend on the
# order.
_NEAR = [(0, -1), (-1, -2), (1, -2), (-2, -3), (2, -3), (-3, -4), (3, -4)]
_FAR = [(0, -step) for step in range(3, 25, 2)]
REACH = 23
SAME_PX = np.float32(1e-3)


def _regions() -> tuple[np.ndarray, np.ndarray]:
    """Offsets of the pixels of each region, (8, most, 2), and how many there are."""
    offsets = np.zeros((8, len(_FAR), 2), np.int64)
    counts = np.zeros(8, np.int64)
    for turn in range(4):
        for far, base in enumerate((_NEAR, _FAR)):
            region = 2 * turn + far
            counts[region] = len(base)
            for index, (x, y) in enumerate(base):
                for _ in range(turn):
                    x, y = -y, x
                offsets[region, index] = (x, y)
    return offsets, counts


REGION_OFFSETS, REGION_COUNTS = _regions()


@njit(cache=True, fastmath=True)
def _best_of_region(costs, x, y, region):
    """Pixel of the least cost in a region; (-1, -1) if that is beyond the border."""
    height, width = costs.shape
    inner = REACH <= x < width - REACH and REACH <= y < height - REACH
    best, at = np.float32(1e9), -1
    for k in range(REGION_COUNTS[region]):
        xs = x + REGION_OFFSETS[region, k, 0]
        ys = y + REGION_OFFSETS[region, k, 1]
        if inner or (0 <= xs < width and 0 <= ys < height):
            cost = costs[ys, xs]
            if cost < best:
                best, at = cost, k
    if at < 0:
        return -1, -1
    return x + REGION_OFFSETS[region, at, 0], y + REGION_OFFSETS[region, at, 1]


@njit(cache=True, fastmath=True)
def propagate_planes(x, y, planes, costs, w_range, K, propagated):
    """The pixel's own plane, first, and the best of each region, as seen at the pixel.

    Args:
        x: The pixel.
        y: Likewise.
        planes: Shape (H, W, 3).
        costs: Shape (H, W).
        w_range: Least and greatest inverse depth.
        K: Intrinsics of the reference.
        propagated: Shape (NUM_PROPAGATED, 3), written.

    Returns:
        Number of planes.
    """
    fx, fy = np.float32(x), np.float32(y)
    store_plane(propagated[0], load_plane(planes[y, x]))
    count = 1
    for region in range(8):
        xs, ys = _best_of_region(costs, x, y, region)
        if xs < 0:
            continue
        there = load_plane(planes[ys, xs])
        w = inverse_depth_beside(there, x - xs, y - ys)
        if w_range[0] <= w <= w_range[1]:
            plane = Plane(w, there.gx, there.gy)
            if faces_camera(plane_normal(plane, fx, fy, K), fx, fy, K):
                store_plane(propagated[count], plane)
                count += 1
    return count


@njit(cache=True, fastmath=True)
def earlier_twin(planes, index, px_per_w):
    """An earlier one that is the same plane, to a thousandth of a pixel; or -1.

    Args:
        planes: Shape (N, 3).
        index: Of the plane.
        px_per_w: Pixels of disparity per unit of inverse depth.
    """
    for i in range(index):
        off = abs(planes[i, 0] - planes[index, 0])
        off += np.float32(4.0) * abs(planes[i, 1] - planes[index, 1])
        off += np.float32(4.0) * abs(planes[i, 2] - planes[index, 2])
        if off * px_per_w < SAME_PX:
            return i
    return -1
