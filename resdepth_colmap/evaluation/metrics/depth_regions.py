"""Edges and flat areas of a ground-truth depth map."""

import numpy as np
import numpy.typing as npt
from scipy.ndimage import maximum_filter, minimum_filter

from resdepth_colmap.scene import DepthMap

EDGE_RADIUS_PX = 4
EDGE_RATIO = 1.1
"""Least ratio of true depths across an edge."""


def edge_region(truth: DepthMap) -> npt.NDArray[np.bool_]:
    """Pixels near a depth discontinuity: a ratio of 1.1 within 9 x 9 pixels.

    A floor at a grazing angle changes by 1 % per pixel, so it is no edge. Laser scans
    have holes along edges; the window reaches across them.

    Args:
        truth: True depth, shape (H, W), in units; 0 = unknown.

    Returns:
        Shape (H, W), bool; False where the truth is unknown.
    """
    known = truth > 0
    size = 2 * EDGE_RADIUS_PX + 1
    nearest = minimum_filter(np.where(known, truth, np.inf), size, mode="nearest")
    farthest = maximum_filter(np.where(known, truth, 0), size, mode="nearest")
    edge: npt.NDArray[np.bool_] = known & (farthest > EDGE_RATIO * nearest)
    return edge
