"""Depth maps at other sizes."""

import numpy as np

from resdepth_colmap.scene import DepthMap


def nearest_depth(depth: DepthMap, shape: tuple[int, ...]) -> DepthMap:
    """A depth map at another size (height, width): never a mean of two depths."""
    if depth.shape == shape:
        return depth
    rows, columns = (
        ((np.arange(new) + 0.5) * old / new).astype(np.intp)
        for new, old in zip(shape, depth.shape, strict=True)
    )
    return depth[np.ix_(rows, columns)]
