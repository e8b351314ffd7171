"""Whether a source agrees with each pixel. Compiled by numba."""

import math

from numba import njit, prange

from resdepth_colmap.matching import sweeps  # noqa: F401 (chooses the threading layer)


@njit(cache=True, parallel=True)
def mark_agreeing(depth, normals, K, cost, source_K, source_from_reference,
                  source_depth, limits, agrees):  # fmt: skip
    """Mark the pixels that a source agrees with (COLMAP, patch_match_cuda.cu).

    Args:
        depth: Of the reference, shape (H, W); 0 = none, which nobody agrees with.
        normals: Shape (H, W, 3).
        K: Of the reference, shape (3, 3), float64.
        cost: 1 - NCC in the source, shape (H, W).
        source_K: Shape (3, 3), float64.
        source_from_reference: Shape (3, 4), float64.
        source_depth: Of the source; empty = there is none to agree with.
        limits: Largest cost, largest cosine of the angle between the rays, largest
            error there and back in pixels; float64.
        agrees: The result, shape (H, W), bool.
    """
    height, width = depth.shape
    pose = source_from_reference
    center_x = -(pose[0, 0] * pose[0, 3] + pose[1, 0] * pose[1, 3]
                 + pose[2, 0] * pose[2, 3])  # fmt: skip
    center_y = -(pose[0, 1] * pose[0, 3] + pose[1, 1] * pose[1, 3]
                 + pose[2, 1] * pose[2, 3])  # fmt: skip
    center_z = -(pose[0, 2] * pose[0, 3] + pose[1, 2] * pose[1, 3]
                 + pose[2, 2] * pose[2, 3])  # fmt: skip
    for row in prange(height):
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
    """Error of a point, seen there and lifted by the source's depth, back here.

    As in COLMAP, the depth is that of the nearest pixel, the ray that of the point.
    """
    xs = pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3]
    ys = pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3]
    zs = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3]
    if zs <= 0:
        return math.inf
    nearest_column = math.floor(xs / zs * source_K[0, 0] + source_K[0, 2] + 0.5)
    nearest_row = math.floor(ys / zs * source_K[1, 1] + source_K[1, 2] + 0.5)
    height, width = source_depth.shape
    if not (0 <= nearest_column < width and 0 <= nearest_row < height):
        return math.inf
    lifted = source_depth[int(nearest_row), int(nearest_column)]
    if lifted <= 0:
        return math.inf
    dx = xs * lifted / zs - pose[0, 3]
    dy = ys * lifted / zs - pose[1, 3]
    dz = lifted - pose[2, 3]
    back_x = pose[0, 0] * dx + pose[1, 0] * dy + pose[2, 0] * dz
    back_y = pose[0, 1] * dx + pose[1, 1] * dy + pose[2, 1] * dz
    back_z = pose[0, 2] * dx + pose[1, 2] * dy + pose[2, 2] * dz
    if back_z <= 0:
        return math.inf
    return math.hypot(
        back_x / back_z * K[0, 0] + K[0, 2] - column,
        back_y / back_z * K[1, 1] + K[1, 2] - row,
    )
