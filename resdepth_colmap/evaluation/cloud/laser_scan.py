"""A laser scan, sorted by direction from the scanner.

Azimuth and inclination are cut into 2048 x 1024 cells; the points of a cell are
contiguous in memory. The grid only speeds up the search. It is the one of ETH3D's
evaluation program (https://github.com/ETH3D/multi-view-evaluation, accuracy.cc), with
its rounding to float32, which is coarse at the poles.
"""

import dataclasses

import numpy as np
import numpy.typing as npt

NUM_ROWS = 1024
"""Number of cells from zenith to nadir."""

NUM_COLUMNS = 2 * NUM_ROWS
"""Number of cells of a full turn."""

_ROW_RAD = np.float32(np.pi / NUM_ROWS)
_COLUMN_RAD = np.float32(2 * np.pi / NUM_COLUMNS)

Floats = npt.NDArray[np.float32]
Indices = npt.NDArray[np.int64]


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class LaserScan:
    """Points of one scan in the frame of its scanner, sorted by cell.

    Attributes:
        points: Coordinates, shape (N, 3).
        directions: Unit vectors from the scanner to the points, shape (N, 3).
        radii: Distances from the scanner, shape (N,).
        cell_starts: Index of the first point of each cell, and N, shape
            (NUM_ROWS * NUM_COLUMNS + 1,). Cells are numbered row by row.
    """

    points: Floats
    directions: Floats
    radii: Floats
    cell_starts: Indices


def sort_scan(points: Floats) -> LaserScan:
    """Sort the points of a scan by direction.

    Args:
        points: Finite coordinates in the frame of the scanner (origin, z up), shape
            (N, 3).
    """
    azimuth, inclination, radius = spherical(points)
    cells = rows_of(inclination) * NUM_COLUMNS
    cells += columns_of(azimuth) % NUM_COLUMNS
    order = np.argsort(cells, kind="stable")
    num_points = np.bincount(cells, minlength=NUM_ROWS * NUM_COLUMNS)
    radii = radius[order]
    sorted_points = points[order]
    scale = np.where(radii > 0, radii, np.float32(1))[:, np.newaxis]
    return LaserScan(
        points=sorted_points,
        directions=(sorted_points / scale).astype(np.float32, copy=False),
        radii=radii,
        cell_starts=np.concatenate([[0], np.cumsum(num_points)]),
    )


def spherical(points: Floats) -> tuple[Floats, Floats, Floats]:
    """Azimuth (-pi to pi), inclination (0 to pi from the zenith) and radius.

    At the origin the inclination is NaN.
    """
    x, y, z = points.T
    radius = np.sqrt((x * x + y * y) + z * z)
    is_origin = radius == 0
    cosine = np.where(is_origin, np.float32(np.nan), z)
    cosine = (cosine / np.where(is_origin, np.float32(1), radius)).clip(-1, 1)
    return np.arctan2(y, x), np.arccos(cosine), radius


def rows_of(inclination: Floats) -> Indices:
    """Row of the cell, clamped to the poles; NaN is the last row, as in ETH3D's."""
    cells = np.nan_to_num(np.floor(inclination / _ROW_RAD), nan=NUM_ROWS)
    rows: Indices = cells.clip(0, NUM_ROWS - 1).astype(np.int64)
    return rows


def columns_of(azimuth: Floats) -> Indices:
    """Column of the cell, not wrapped to 0..NUM_COLUMNS."""
    cells = azimuth / _COLUMN_RAD
    columns: Indices = np.trunc(cells).astype(np.int64) - (cells < 0)
    return columns
