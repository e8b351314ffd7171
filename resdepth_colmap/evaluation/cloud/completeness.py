"""How much of the laser scans a cloud reaches: ETH3D's completeness.

Rule and rounding (float32) are those of ETH3D's evaluation program
(https://github.com/ETH3D/multi-view-evaluation, completeness.cc).
"""

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from resdepth_colmap.progress import Advance

_POINTS_AT_ONCE = 1 << 18


def completeness_levels(
    scan_points: npt.NDArray[np.float32],
    cloud_points: npt.NDArray[np.float32],
    tolerances: tuple[float, ...],
    advance: Advance,
) -> npt.NDArray[np.uint8]:
    """Find the least tolerance at which each point of the scans has been reached.

    Args:
        scan_points: Points of all scans in the world, shape (N, 3), finite.
        cloud_points: Points of the cloud, shape (M, 3), finite.
        tolerances: Distances, increasing.
        advance: Is told of the points that are done.

    Returns:
        Index of the least tolerance within which the nearest point of the cloud lies,
        shape (N,); the number of tolerances where none is near enough.
    """
    levels = np.full(len(scan_points), len(tolerances), np.uint8)
    if len(cloud_points) == 0:
        return levels
    tree = cKDTree(cloud_points)
    squared_tolerances = np.array(tolerances, np.float32) ** 2
    reach = 1.001 * max(tolerances)  # a little more, for the rounding is decided below
    for start in range(0, len(scan_points), _POINTS_AT_ONCE):
        part = scan_points[start : start + _POINTS_AT_ONCE]
        _, nearest = tree.query(part, distance_upper_bound=reach, workers=-1)
        found = np.flatnonzero(nearest < len(cloud_points))
        x, y, z = (part[found] - cloud_points[nearest[found]]).T
        levels[start + found] = np.searchsorted(
            squared_tolerances, (x * x + y * y) + z * z
        )
        advance(len(part))
    return levels
