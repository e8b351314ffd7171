"""Parts of a true depth map that are hard and easy: edges and flat areas."""

import numpy as np
import numpy.typing as npt
from scipy.ndimage import maximum_filter, minimum_filter

from resdepth_colmap.scene import DepthMap

EDGE_RADIUS_PX = 4
EDGE_RATIO = 1.1
"""Near an edge the true depths differ by more than that factor."""


def edge_region(truth: DepthMap) -> npt.NDArray[np.bool_]:
    """Where the true depth jumps: 10 % within a square of 9 x 9 pixels.

    A floor seen at a grazing angle changes by 1 % a pixel, so it is no edge. Laser
    scans have holes along the edges; the square reaches across them.

    Args:
        truth: True depth, shape (H, W), in units; 0 = not known.

    Returns:
        Shape (H, W), bool; False where the truth is not known.
    """
    known = truth > 0
    size = 2 * EDGE_RADIUS_PX + 1
    nearest = minimum_filter(np.where(known, truth, np.inf), size, mode="nearest")
    farthest = maximum_filter(np.where(known, truth, 0), size, mode="nearest")
    edge: npt.NDArray[np.bool_] = known & (farthest > EDGE_RATIO * nearest)
    return edge
