"""Surface normals of a depth map.

On a plane the inverse depth is linear in the pixel: 1 / z = g . (x, y, 1). Its normal
is K^T g up to a factor, so that two differences of the inverse depth give it exactly.
"""

import numpy as np

from resdepth_colmap.geometry.inverse_depth import invert_map
from resdepth_colmap.scene import DepthMap, FloatMap, Matrix, NormalMap

LARGEST_BEND = 0.02
"""Difference of the slopes on both sides of a pixel, relative to its inverse depth,
above which one side is taken to belong to another surface."""

FLATTEST_NZ = np.float32(-1e-3)


def normals_from_depth(depth: DepthMap, K: Matrix) -> NormalMap:
    """Normals from differences between neighbouring pixels.

    Along each axis the slope is the mean of both sides; where they differ much, or one
    has no depth, the side with the smaller jump counts alone, so that normals next to a
    depth edge are those of the pixel's own surface.

    Args:
        depth: Shape (H, W), float32, in units; 0 = no depth.
        K: K for index coordinates, shape (3, 3), in pixels.

    Returns:
        Unit normals in the camera frame, towards the camera (nz < 0), shape (H, W, 3),
        float32; (0, 0, 0) where there is no depth. A pixel without neighbours faces the
        camera's image plane.
    """
    inverse = invert_map(depth)
    valid = inverse > 0
    slope_x = _slope_along_rows(inverse)
    slope_y = _slope_along_rows(inverse.T).T
    height_px, width_px = depth.shape
    x = np.arange(width_px, dtype=np.float32) - np.float32(K[0, 2])
    y = np.arange(height_px, dtype=np.float32)[:, None] - np.float32(K[1, 2])
    normals = np.empty((height_px, width_px, 3), dtype=np.float32)
    # Minus K^T g: K^T g itself points away from the camera.
    np.multiply(slope_x, np.float32(-K[0, 0]), out=normals[..., 0])
    np.multiply(slope_y, np.float32(-K[1, 1]), out=normals[..., 1])
    normals[..., 2] = slope_x * x + slope_y * y - inverse
    normals[~valid] = (0.0, 0.0, -1.0)
    _normalise(normals)
    # A surface seen at a grazing angle near the image border may turn its z away.
    turned = normals[..., 2] > FLATTEST_NZ
    if turned.any():
        normals[turned, 2] = FLATTEST_NZ
        _normalise(normals)
    normals[~valid] = 0.0
    return normals


def _slope_along_rows(inverse: FloatMap) -> FloatMap:
    """Change of the inverse depth to the next column, shape (H, W); 0 if unknown."""
    valid = inverse > 0
    step = np.diff(inverse, axis=1)
    known = valid[:, 1:] & valid[:, :-1]
    right = np.pad(step, ((0, 0), (0, 1)))
    left = np.pad(step, ((0, 0), (1, 0)))
    has_right = np.pad(known, ((0, 0), (0, 1)))
    has_left = np.pad(known, ((0, 0), (1, 0)))
    one_surface = np.abs(right - left) <= np.float32(LARGEST_BEND) * inverse
    smaller = np.where(np.abs(right) <= np.abs(left), right, left)
    both = np.where(one_surface, np.float32(0.5) * (right + left), smaller)
    one = np.where(has_right, right, np.where(has_left, left, np.float32(0.0)))
    return np.where(has_right & has_left, both, one)


def _normalise(normals: NormalMap) -> None:
    """To length 1, in place; the scale of the numbers does not matter."""
    normals /= np.abs(normals).max(axis=-1, keepdims=True)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
