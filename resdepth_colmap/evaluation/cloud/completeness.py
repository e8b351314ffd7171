"""Distances of reference points to a cloud: ETH3D's completeness.

Rule and rounding (float32) are those of ETH3D's evaluation program
(https://github.com/ETH3D/multi-view-evaluation, completeness.cc).
"""

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from resdepth_colmap.progress import Advance

_POINTS_AT_ONCE = 1 << 18


def completeness_levels(
    reference_points: npt.NDArray[np.float32],
    cloud_points: npt.NDArray[np.float32],
    tolerances: tuple[float, ...],
    advance: Advance,
) -> npt.NDArray[np.uint8]:
    """The least tolerance within which each reference point has a neighbour.

    Args:
        reference_points: In the world, shape (N, 3), finite.
        cloud_points: Likewise, shape (M, 3).
        tolerances: Distances, increasing.
        advance: Called with the number of points that are done.

    Returns:
        Index of the least tolerance that the nearest cloud point lies within, shape
        (N,); the number of tolerances where none is near enough.
    """
    levels = np.full(len(reference_points), len(tolerances), np.uint8)
    if len(cloud_points) == 0:
        return levels
    tree = cKDTree(cloud_points)
    squared_tolerances = np.array(tolerances, np.float32) ** 2
    reach = 1.001 * max(tolerances)  # the exact comparison follows below
    for start in range(0, len(reference_points), _POINTS_AT_ONCE):
        part = reference_points[start : start + _POINTS_AT_ONCE]
        _, nearest = tree.query(part, distance_upper_bound=reach, workers=-1)
        found = np.flatnonzero(nearest < len(cloud_points))
        x, y, z = (part[found] - cloud_points[nearest[found]]).T
        levels[start + found] = np.searchsorted(
            squared_tolerances, (x * x + y * y) + z * z
        )
        advance(len(part))
    return levels
