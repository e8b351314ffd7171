"""Hole filling of depth maps by pull-push.

The map is halved repeatedly, each pixel the mean of the known ones below it, until no
hole remains; on the way back the holes take the interpolated value of the coarser map.
Linear in the number of pixels, smooth inside large holes.
"""

import numpy as np

from resdepth_colmap.geometry.inverse_depth import invert_map
from resdepth_colmap.scene import DepthMap, FloatMap

ONE = np.float32(1.0)  # a Python float would make doubles under numpy 1


def fill_holes(depth: DepthMap) -> DepthMap:
    """Fill the holes of a depth map, in inverse depth.

    Args:
        depth: Depth, shape (H, W), float32, in units; 0 = hole, and so are negative
            and non-finite values.

    Returns:
        Depth > 0 everywhere, within the range of the valid depths; valid pixels are
        unchanged.

    Raises:
        ValueError: If no pixel is valid.
    """
    inverse = invert_map(depth)
    valid = inverse > 0
    if not valid.any():
        height, width = depth.shape
        raise ValueError(f"no pixel of the {width} x {height} depth map has a depth.")
    if valid.all():
        return np.asarray(depth, dtype=np.float32).copy()
    filled = _pull_push(inverse, valid.astype(np.float32))
    # Rounding must not leave the range of the measured depths.
    filled = np.clip(filled, inverse[valid].min(), inverse.max())
    return np.where(valid, depth, invert_map(filled)).astype(np.float32)


def _pull_push(values: FloatMap, weights: FloatMap) -> FloatMap:
    if weights.min() >= 1.0:
        return values
    coarse = _pull_push(*_halve(values, weights))
    spread = _double(coarse, values.shape[0], values.shape[1])
    return weights * values + (ONE - weights) * spread


def _halve(values: FloatMap, weights: FloatMap) -> tuple[FloatMap, FloatMap]:
    """Weighted mean of 2 x 2 pixels; a weight of 1 (four quarters) is fully known."""
    sum_weights = _sum_of_four(weights)
    mean = np.zeros_like(sum_weights)
    known = sum_weights > 0
    np.divide(_sum_of_four(values * weights), sum_weights, out=mean, where=known)
    return mean, np.minimum(sum_weights, ONE).astype(np.float32)


def _sum_of_four(values: FloatMap) -> FloatMap:
    height, width = values.shape
    even = np.pad(values, ((0, height % 2), (0, width % 2)))
    rows = even[0::2] + even[1::2]
    return rows[:, 0::2] + rows[:, 1::2]


def _double(values: FloatMap, height_px: int, width_px: int) -> FloatMap:
    """Twice the size, bilinear between pixel centres, cropped to the given size."""
    tall = _double_rows(values)[:height_px]
    return _double_rows(tall.T)[:width_px].T


def _double_rows(values: FloatMap) -> FloatMap:
    padded = np.pad(values, ((1, 1), (0, 0)), mode="edge")
    near = np.float32(0.75) * values
    doubled = np.empty((2 * values.shape[0], values.shape[1]), dtype=np.float32)
    doubled[0::2] = near + np.float32(0.25) * padded[:-2]
    doubled[1::2] = near + np.float32(0.25) * padded[2:]
    return doubled
