"""Whether a source agrees with each pixel. Compiled by numba.

The tests of COLMAP's filter (patch_match_cuda.cu, end of SweepFromTopToBottom):
triangulation angle and incident angle (ComputeViewingAngles), photo-consistency, and
forward-backward reprojection error (ComputeGeomConsistencyCost).
"""

import math

import numpy as np
from numba import njit, prange

from resdepth_colmap.matching.compilation import choose_threading_layer

choose_threading_layer()


@njit(cache=True, parallel=True)
def mark_agreeing(depth, normals, K, cost, source_K, source_from_reference,
                  source_depth, limits, agrees):  # fmt: skip
    """Mark the pixels that a source agrees with.

    Args:
        depth: Of the reference, shape (H, W); 0 = none, which nobody agrees with.
        normals: Shape (H, W, 3).
        K: Of the reference, shape (3, 3), float64.
        cost: 1 - NCC in the source, shape (H, W).
        source_K: Shape (3, 3), float64.
        source_from_reference: Shape (3, 4), float64.
        source_depth: Of the source; empty = there is none to agree with.
        limits: Largest cost, largest cosine of the triangulation angle, largest
            forward-backward reprojection error in pixels; float64.
        agrees: The result, shape (H, W), bool.
    """
    height, width = depth.shape
    pose = source_from_reference
    center_x, center_y, center_z = _rotated_back(
        pose, -pose[0, 3], -pose[1, 3], -pose[2, 3]
    )
    for index in prange(height):
        row = np.int64(index)  # signed in all kernels: they are compiled once
        for column in range(width):
            agrees[row, column] = False
            z = depth[row, column]
            if z <= 0 or cost[row, column] > limits[0]:
                continue
            x = z * (column - K[0, 2]) / K[0, 0]
            y = z * (row - K[1, 2]) / K[1, 1]
            to_x, to_y, to_z = center_x - x, center_y - y, center_z - z
            squares = (x * x + y * y + z * z) * (to_x**2 + to_y**2 + to_z**2)
            nx, ny, nz = normals[row, column]
            facing = to_x * nx + to_y * ny + to_z * nz
            cosine = -(to_x * x + to_y * y + to_z * z)
            if facing <= 0 or cosine > limits[1] * math.sqrt(squares):
                continue
            agrees[row, column] = source_depth.size == 0 or _error_px(
                x, y, z, row, column, K, source_K, pose, source_depth
            ) <= limits[2]  # fmt: skip


@njit(cache=True)
def _error_px(x, y, z, row, column, K, source_K, pose, source_depth):
    """Forward-backward reprojection error of a point, in pixels; inf = not seen.

    As in COLMAP, the depth in the source is that of the nearest pixel, and the ray is
    that of the point.
    """
    xs = pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3]
    ys = pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3]
    zs = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3]
    if zs <= 0:
        return math.inf
    column_there, row_there = _pixel(xs, ys, zs, source_K)
    nearest_column = math.floor(column_there + 0.5)
    nearest_row = math.floor(row_there + 0.5)
    height, width = source_depth.shape
    if not (0 <= nearest_column < width and 0 <= nearest_row < height):
        return math.inf
    lifted = source_depth[int(nearest_row), int(nearest_column)]
    if lifted <= 0:
        return math.inf
    dx = xs * lifted / zs - pose[0, 3]
    dy = ys * lifted / zs - pose[1, 3]
    dz = lifted - pose[2, 3]
    back_x, back_y, back_z = _rotated_back(pose, dx, dy, dz)
    if back_z <= 0:
        return math.inf
    column_back, row_back = _pixel(back_x, back_y, back_z, K)
    return math.hypot(column_back - column, row_back - row)


@njit(cache=True, inline="always")
def _pixel(x, y, z, K):
    """Column and row of a point in the camera frame."""
    return x / z * K[0, 0] + K[0, 2], y / z * K[1, 1] + K[1, 2]


@njit(cache=True, inline="always")
def _rotated_back(pose, x, y, z):
    """A vector in the frame that the pose (3, 4) maps from."""
    return (
        pose[0, 0] * x + pose[1, 0] * y + pose[2, 0] * z,
        pose[0, 1] * x + pose[1, 1] * y + pose[2, 1] * z,
        pose[0, 2] * x + pose[1, 2] * y + pose[2, 2] * z,
    )
