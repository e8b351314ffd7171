"""Depth and inverse depth: the only module that divides one into the other.

The network works in inverse depth, where an error of one pixel of disparity is the
same near and far (paper, section "ETH3D"). 0 means "no depth" on both sides.
"""

import numpy as np
import torch
from torch import Tensor

from resdepth_colmap.scene import FloatMap


def inverse_depth(depth: Tensor) -> Tensor:
    """Inverse depth, same shape, in 1/unit; 0 or less becomes 0, with gradient 0."""
    return _reciprocal(depth)


def depth_from_inverse(inverse: Tensor) -> Tensor:
    """Depth, same shape, in units; 0 or less becomes 0, with gradient 0."""
    return _reciprocal(inverse)


def invert_map(values: FloatMap) -> FloatMap:
    """The same for numpy: depth to inverse depth or back, float32.

    0, negative and non-finite values become 0, and so does a value so small that its
    inverse is not finite.
    """
    valid = np.isfinite(values) & (values > np.finfo(np.float32).tiny)
    safe = np.where(valid, values, 1.0).astype(np.float32)
    return np.where(valid, np.float32(1.0) / safe, np.float32(0.0))


def _reciprocal(values: Tensor) -> Tensor:
    valid = values > 0
    safe = torch.where(valid, values, 1.0)  # before the division: its gradient is NaN
    return torch.where(valid, 1.0 / safe, 0.0)
