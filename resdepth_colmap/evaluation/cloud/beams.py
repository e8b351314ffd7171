"""Points against the beams of a laser scanner: right, in free space, or unobserved.

A beam is a cone that widens with the distance. A point in a beam is right if it is near
the scan point, wrong if it lies in front of the scan point, where the light has passed,
and unobserved behind it. Rule and rounding (float32) are those of
ETH3D's program (https://github.com/ETH3D/multi-view-evaluation, accuracy.cc).
"""

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from resdepth_colmap.evaluation.cloud.config import CloudConfig
from resdepth_colmap.evaluation.cloud.laser_scan import (
    NUM_COLUMNS,
    Floats,
    Indices,
    LaserScan,
    columns_of,
    rows_of,
    spherical,
)

_SPANS_AT_ONCE = 1 << 18
_PAIRS_AT_ONCE = 1 << 18
_HALF_TURN = np.float32(np.pi)


def judge(
    points: Floats, scan: LaserScan, config: CloudConfig
) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Compare points with the scan points whose beams they lie in.

    Args:
        points: Finite coordinates in the frame of the scanner, shape (N, 3).
        scan: The scan.
        config: The beam.

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
        """Spans of scan points in the cells whose beams may meet some of the points.

        Returns:
            Index of the point; index of the first scan point; one past the last.
        """
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
    """Pairs of a point and a scan point whose beam meets the point.

    Returns:
        Indices of the pairs; their squared distance; whether the point is nearer to
        the scanner than the scan point.
    """
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
