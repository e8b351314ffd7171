"""Depth and inverse depth: the only module that divides one into the other.

The network works in inverse depth, where an error of one pixel of disparity is the
same near and far (paper, section "ETH3D"). 0 means "no depth" on both sides.
"""

import numpy as np

from resdepth_colmap.scene import FloatMap


def invert_map(values: FloatMap) -> FloatMap:
    """Depth to inverse depth or back, same shape, float32.

    0, negative and non-finite values become 0, and so does a value so small that its
    inverse is not finite.
    """
    valid = np.isfinite(values) & (values > np.finfo(np.float32).tiny)
    safe = np.where(valid, values, 1.0).astype(np.float32)
    return np.where(valid, np.float32(1.0) / safe, np.float32(0.0))
