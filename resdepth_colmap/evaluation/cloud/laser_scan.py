"""A laser scan, sorted by direction, and what its beams say of the points of a cloud.

Azimuth and inclination are cut into 2048 x 1024 cells; the points of a cell are
contiguous in memory. The grid only speeds up the search. A beam is a cone that widens
with the distance. A point in a beam is right if it is near the scan point, wrong if it
lies in front of it, where the light has passed, and unobserved behind it. Rules, grid
and rounding (float32, coarse at the poles) are those of ETH3D's evaluation program
(https://github.com/ETH3D/multi-view-evaluation, accuracy.cc).
"""

import dataclasses
import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from resdepth_colmap.evaluation.cloud.config import CloudConfig

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
    """Sort finite points, shape (N, 3), in the frame of the scanner (z up)."""
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


_SPANS_AT_ONCE = 1 << 18
_PAIRS_AT_ONCE = 1 << 18
_HALF_TURN = np.float32(np.pi)


def judge(
    points: Floats, scan: LaserScan, config: CloudConfig
) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Compare finite points, shape (N, 3), with the scan points that may see them.

    Returns:
        Squared distance to the nearest of these scan points, shape (N,), infinite where
        there is none; and whether the point lies in front of one of them.
    """
    squared_distance = np.full(len(points), np.inf, np.float32)
    is_in_front = np.zeros(len(points), bool)
    beam = _Beam(points, config)
    for part in _chunks(beam.num_rows, _SPANS_AT_ONCE):
        owners, starts, ends = beam.spans(part, scan.cell_starts)
        for spans in _chunks(ends - starts, _PAIRS_AT_ONCE):
            owner, target = _pairs(owners[spans], starts[spans], ends[spans])
            inside, squared, in_front = _meet(
                points[owner], beam.radius[owner], scan, target
            )
            np.minimum.at(squared_distance, owner[inside], squared)
            is_in_front[owner[inside][in_front]] = True
    return squared_distance, is_in_front


class _Beam:
    """Which cells of a scan the beams through points come from."""

    def __init__(self, points: Floats, config: CloudConfig) -> None:
        widening = math.tan(math.radians(config.beam_divergence_halfangle_deg))
        azimuth, inclination, distance = spherical(points)
        start = np.float32(config.beam_start_radius_meters)
        self.radius: Floats = start + distance * np.float32(widening)
        height = _angle(self.radius, distance)
        x, y, _ = points.T
        width = _angle(self.radius, np.sqrt(x * x + y * y))
        self.first_row = rows_of(inclination - height)
        self.num_rows: Indices = rows_of(inclination + height) - self.first_row + 1
        first, last = columns_of(azimuth - width), columns_of(azimuth + width)
        self.first_column = first % NUM_COLUMNS
        self.num_columns = np.minimum(last - first + 1, NUM_COLUMNS)

    def spans(
        self, part: slice, cell_starts: Indices
    ) -> tuple[Indices, Indices, Indices]:
        """Index of the point, first scan point that may meet it, one past the last."""
        num_rows = self.num_rows[part]
        owner = np.repeat(np.arange(len(self.num_rows))[part], num_rows)
        row = self.first_row[owner] + _counted_up(num_rows)
        left = self.first_column[owner]
        right = left + self.num_columns[owner]
        begin = row * NUM_COLUMNS
        starts = [cell_starts[begin + left], cell_starts[begin]]
        ends = [
            cell_starts[begin + np.minimum(right, NUM_COLUMNS)],
            cell_starts[begin + np.maximum(right - NUM_COLUMNS, 0)],  # wrapped round
        ]
        all_starts, all_ends = np.concatenate(starts), np.concatenate(ends)
        filled = all_ends > all_starts
        return np.tile(owner, 2)[filled], all_starts[filled], all_ends[filled]


def _angle(radius: Floats, distance: Floats) -> Floats:
    """Half the angle that a ball subtends; half a turn from inside it."""
    is_outside = distance > radius
    sine = radius / np.where(is_outside, distance, np.float32(1))
    return np.where(is_outside, np.arcsin(np.minimum(sine, 1)), _HALF_TURN)


def _meet(
    points: Floats, beam_radius: Floats, scan: LaserScan, target: Indices
) -> tuple[Indices, Floats, npt.NDArray[np.bool_]]:
    """Pairs that meet: index, squared distance, whether the point is in front."""
    directions = scan.directions[target]
    along = _dot(directions, points)
    aside = points - along[:, np.newaxis] * directions
    is_inside = (along >= 0) & (_dot(aside, aside) <= beam_radius * beam_radius)
    inside = np.flatnonzero(is_inside)
    target = target[inside]
    apart = scan.points[target] - points[inside]
    return inside, _dot(apart, apart), along[inside] < scan.radii[target]


def _dot(left: Floats, right: Floats) -> Floats:
    products = left * right
    total: Floats = (products[:, 0] + products[:, 1]) + products[:, 2]
    return total


def _pairs(owners: Indices, starts: Indices, ends: Indices) -> tuple[Indices, Indices]:
    """Expand spans into one pair of indices per element."""
    sizes = ends - starts
    return np.repeat(owners, sizes), np.repeat(starts, sizes) + _counted_up(sizes)


def _counted_up(sizes: Indices) -> Indices:
    """0, 1, ... for each size: [2, 3] gives [0, 1, 0, 1, 2]."""
    before = np.cumsum(sizes) - sizes
    return np.arange(int(sizes.sum())) - np.repeat(before, sizes)


def _chunks(sizes: Indices, limit: int) -> Iterator[slice]:
    """Slices whose sizes add up to at most the limit, or that have one element."""
    sums = np.cumsum(sizes)
    start, done = 0, 0
    while start < len(sizes):
        end = max(int(np.searchsorted(sums, done + limit, side="right")), start + 1)
        yield slice(start, end)
        start, done = end, int(sums[end - 1])
