"""Shares of points, averaged over voxels.

Dense and sparse regions weigh alike. The voxels of two grids are pooled, the second
shifted by half a voxel, so that the position of the borders matters less.
Rule and rounding (float32) are those of ETH3D's evaluation program (CalcCellCoordinates
in its util.h).
"""

import numpy as np
import numpy.typing as npt

_SHIFTS = (0.0, 0.5)  # in voxels, along all three axes
_MAX_INDEX = 2**31 - 1.0


class VoxelGrids:
    """Both voxel grids of a cloud."""

    def __init__(self, points: npt.NDArray[np.float32], voxel_size: float) -> None:
        """Assign each point to its voxels.

        Args:
            points: Finite coordinates in the world, shape (N, 3).
            voxel_size: Side of a voxel, in the units of the points.
        """
        self._grids = [_voxel_ids(points, voxel_size, shift) for shift in _SHIFTS]

    def mean_share(
        self, good: npt.NDArray[np.bool_], counted: npt.NDArray[np.bool_]
    ) -> float:
        """Mean share of good points of the voxels with a counted point.

        Args:
            good: Which points are good, shape (N,); each is counted too.
            counted: Which points count, shape (N,).

        Returns:
            A share in 0..1; 0 without a counted point.
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
