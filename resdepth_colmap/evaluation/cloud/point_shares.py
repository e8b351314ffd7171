"""Shares of points: near another cloud, and averaged over voxels.

Rules and rounding (float32) are those of ETH3D's evaluation program
(https://github.com/ETH3D/multi-view-evaluation, completeness.cc, CalcCellCoordinates).
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
        reference_points: Shape (N, 3), finite.
        cloud_points: Shape (M, 3), finite.
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


_SHIFTS = (0.0, 0.5)  # in voxels, along all three axes
_MAX_INDEX = 2**31 - 1.0


class VoxelGrids:
    """The two voxel grids of a cloud, the second shifted by half a voxel.

    Over voxels, dense and sparse regions weigh alike; over both grids, the position of
    the borders matters less.
    """

    def __init__(self, points: npt.NDArray[np.float32], voxel_size: float) -> None:
        """Assign each of the finite points, shape (N, 3), to its voxels."""
        self._grids = [_voxel_ids(points, voxel_size, shift) for shift in _SHIFTS]

    def mean_share(
        self, good: npt.NDArray[np.bool_], counted: npt.NDArray[np.bool_]
    ) -> float:
        """Mean share of good points, in 0..1, of the voxels with a counted point.

        Args:
            good: Shape (N,), bool; each good point is counted, too.
            counted: Shape (N,), bool; the share is 0 if none is.
        """
        total, num_voxels = 0.0, 0
        for ids in self._grids:
            num_counted = np.bincount(ids[counted])
            num_good = np.bincount(ids[good], minlength=len(num_counted))
            occupied = num_counted > 0
            total += float(np.sum(num_good[occupied] / num_counted[occupied]))
            num_voxels += int(occupied.sum())
        return total / num_voxels if num_voxels else 0.0


def _voxel_ids(
    points: npt.NDArray[np.float32], voxel_size: float, shift: float
) -> npt.NDArray[np.int32]:
    """Index of the voxel of each point, among the occupied ones."""
    per_voxel = np.float32(1 / np.float64(np.float32(voxel_size)))
    with np.errstate(over="ignore"):
        cells = np.floor(points * per_voxel + np.float32(shift))
    x, y, z = np.clip(cells, -_MAX_INDEX, _MAX_INDEX).T
    order = np.lexsort((z, y, x))
    is_first = np.zeros(len(points), bool)
    for axis in (x, y, z):
        is_first[1:] |= np.diff(axis[order]) != 0
    ids = np.empty(len(points), np.int32)
    ids[order] = np.cumsum(is_first)
    return ids
