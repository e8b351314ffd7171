"""Surface normals of a depth map.

On a plane the inverse depth is linear in the pixel: 1 / z = g . (x, y, 1). Its normal
is K^T g up to a factor, so that a linear fit of the inverse depth gives it exactly.
"""

from typing import NamedTuple

import cv2
import numpy as np

from resdepth_colmap.geometry.inverse_depth import invert_map
from resdepth_colmap.scene import DepthMap, FloatMap, Matrix, NormalMap

RADIUS_PX = 3
"""Half width of the fitted windows. Noise of 0.3 % of the depth turns normals of single
pixels by tens of degrees, and COLMAP's fusion refuses more than 10."""

LEAST_PIXELS = 5
"""A window with fewer valid pixels has no slope."""

CENTRE_BONUS = 16.0
"""A shifted window has to fit better by this factor (squared): on a curved surface the
centred window is unbiased, at a depth edge it is worse by far more."""

LEAST_DETERMINANT = 1e-3
"""Of the window's moments: below, its pixels lie on a line."""

FLATTEST_NZ = np.float32(-1e-3)


def normals_from_depth(depth: DepthMap, K: Matrix) -> NormalMap:
    """Normals of planes fitted to windows of the inverse depth.

    Of nine windows that contain the pixel (centred, and shifted to the sides and
    corners) the one is used whose plane fits best to its pixels and to this one, as in
    the Kuwahara filter, so that a normal next to a depth edge is that of its surface.

    Args:
        depth: Shape (H, W), float32, in units; 0 = no depth.
        K: K for index coordinates, shape (3, 3), in pixels.

    Returns:
        Unit normals in the camera frame, towards the camera (nz < 0), shape (H, W, 3),
        float32; (0, 0, 0) where there is no depth. A pixel with too few
        neighbours faces the camera's image plane.
    """
    inverse = invert_map(depth)
    valid = inverse > 0
    slope_x, slope_y = _slopes(inverse)
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


class _Planes(NamedTuple):
    """The plane fitted to the window round each pixel; all of shape (H, W), float64."""

    value: Matrix
    slope_x: Matrix
    slope_y: Matrix
    variance: Matrix


def _slopes(inverse: FloatMap) -> tuple[FloatMap, FloatMap]:
    """Change of the inverse depth to the next column and row, shape (H, W) each."""
    height_px, width_px = inverse.shape
    planes = _Planes(*(np.pad(it, RADIUS_PX) for it in _fit(inverse)))
    least = np.full(inverse.shape, np.inf)
    slope_x, slope_y = np.zeros_like(inverse), np.zeros_like(inverse)
    shifts = (0, -RADIUS_PX, RADIUS_PX)
    for dy, dx in ((dy, dx) for dy in shifts for dx in shifts):
        rows = slice(RADIUS_PX + dy, RADIUS_PX + dy + height_px)
        columns = slice(RADIUS_PX + dx, RADIUS_PX + dx + width_px)
        value, gx, gy, variance = (it[rows, columns] for it in planes)
        has_plane = value > 0
        error = (value - gx * dx - gy * dy - inverse) ** 2 + variance
        if dx == dy == 0:
            error = error / CENTRE_BONUS
        better = has_plane & (error < least)
        least[better] = error[better]
        slope_x[better], slope_y[better] = gx[better], gy[better]
    return slope_x, slope_y


def _fit(inverse: FloatMap) -> _Planes:
    """Least squares over the valid pixels of each window; value 0 where too few."""
    weight = (inverse > 0).astype(np.float64)
    w = inverse.astype(np.float64)
    ones = np.ones(2 * RADIUS_PX + 1)
    ramp = np.arange(-RADIUS_PX, RADIUS_PX + 1, dtype=np.float64)

    def total(values: Matrix, along_x: Matrix, along_y: Matrix) -> Matrix:
        # Outside the map nothing counts.
        sums = cv2.sepFilter2D(
            values, cv2.CV_64F, along_x, along_y, borderType=cv2.BORDER_CONSTANT
        )
        return np.asarray(sums, np.float64)

    number = total(weight, ones, ones)
    n = np.maximum(number, 1.0)
    x, y = total(weight, ramp, ones) / n, total(weight, ones, ramp) / n
    xx = total(weight, ramp**2, ones) / n - x**2
    yy = total(weight, ones, ramp**2) / n - y**2
    xy = total(weight, ramp, ramp) / n - x * y
    mean = total(w, ones, ones) / n
    xw = total(w, ramp, ones) / n - x * mean
    yw = total(w, ones, ramp) / n - y * mean
    ww = total(w * w, ones, ones) / n - mean**2
    determinant = xx * yy - xy**2
    enough = (number >= LEAST_PIXELS) & (determinant > LEAST_DETERMINANT)
    safe = np.where(enough, determinant, 1.0)
    slope_x = np.where(enough, (yy * xw - xy * yw) / safe, 0.0)
    slope_y = np.where(enough, (xx * yw - xy * xw) / safe, 0.0)
    value = np.where(enough, mean - slope_x * x - slope_y * y, 0.0)
    variance = np.maximum(ww - slope_x * xw - slope_y * yw, 0.0)
    return _Planes(value, slope_x, slope_y, variance)


def _normalise(normals: NormalMap) -> None:
    """Scale to unit length, in place; the scale of the input does not matter."""
    normals /= np.abs(normals).max(axis=-1, keepdims=True)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
