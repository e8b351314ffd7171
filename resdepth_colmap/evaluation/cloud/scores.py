"""Accuracy, completeness and F1 of a cloud against laser scans, by ETH3D's rules.

T. Schöps et al., A Multi-View Stereo Benchmark with High-Resolution Images and
Multi-Camera Videos, CVPR 2017; the rules are those of their evaluation program,
https://github.com/ETH3D/multi-view-evaluation.
"""

import dataclasses
import logging
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from resdepth_colmap.evaluation.cloud.config import CloudConfig
from resdepth_colmap.evaluation.cloud.laser_scan import judge, sort_scan
from resdepth_colmap.evaluation.cloud.point_shares import (
    VoxelGrids,
    completeness_levels,
)
from resdepth_colmap.progress import Progress, SilentProgress

logger = logging.getLogger(__name__)

_POINTS_AT_ONCE = 1 << 17
_FAR_M = 1e15  # its square is finite in float32

Points = npt.NDArray[np.float32]

_MAX_DISTANCE = 0.05  # median distance from the scans, relative to their extent
_MAX_RATIO = 10.0  # of the extents of cloud and scans, either way
_NUM_SAMPLES = 20_000
_NUM_QUERIES = 1_000


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class PlacedScan:
    """A laser scan and the pose of its scanner.

    Attributes:
        points: Coordinates in the frame of the scanner, in metres, shape (N, 3).
        world_from_scan: Pose, shape (4, 4).
    """

    points: Points
    world_from_scan: Points


@dataclasses.dataclass(frozen=True, kw_only=True)
class CloudScores:
    """Scores of a cloud, one value per tolerance, in 0..1.

    Attributes:
        tolerances: Largest distances of a correct point, increasing.
        accuracy: Share of the observed points of the cloud that are right.
        completeness: Share of the reference points that the cloud reaches.
        num_points: Number of points of the cloud that were compared.
        num_scan_points: Number of reference points.
    """

    tolerances: tuple[float, ...]
    accuracy: tuple[float, ...]
    completeness: tuple[float, ...]
    num_points: int
    num_scan_points: int

    @property
    def f1(self) -> tuple[float, ...]:
        """Harmonic means of accuracy and completeness."""
        return tuple(map(f1_score, self.accuracy, self.completeness))

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return {**dataclasses.asdict(self), "f1": self.f1}


def cloud_scores(
    points: Points,
    scans: Sequence[PlacedScan],
    config: CloudConfig,
    progress: Progress | None = None,
) -> CloudScores:
    """Score a cloud against laser scans; ValueError if these have no point.

    Args:
        points: Coordinates of the cloud in the world of the scans, in metres, shape
            (N, 3). Points that are not finite are left out, as in the scans. The
            scores of a cloud without points are 0.
        scans: At least one scan with a point.
        config: Tolerances, voxels and beam.
        progress: Reports the progress.
    """
    progress = progress or SilentProgress()
    points = _finite(points, "the cloud")
    local = [_finite(s.points, f"scan {i}") for i, s in enumerate(scans, start=1)]
    poses = [scan.world_from_scan.astype(np.float32) for scan in scans]
    world = np.concatenate([_moved(p, T) for p, T in zip(local, poses, strict=True)])
    if len(world) == 0:
        raise ValueError("the scans have no point.")
    _warn_of_misfit(points, world)
    with progress.stage("Completeness", len(world)) as advance:
        levels = completeness_levels(world, points, config.tolerances, advance)
    grids, counted = VoxelGrids(world, config.voxel_size), np.ones(len(world), bool)
    indices = range(len(config.tolerances))
    completeness = tuple(grids.mean_share(levels <= it, counted) for it in indices)
    num_scan_points = len(world)
    del world, grids
    accuracy = _accuracy(points, list(zip(local, poses, strict=True)), config, progress)
    return CloudScores(
        tolerances=config.tolerances,
        accuracy=accuracy,
        completeness=completeness,
        num_points=len(points),
        num_scan_points=num_scan_points,
    )


def _accuracy(
    points: Points,
    scans: Sequence[tuple[Points, Points]],
    config: CloudConfig,
    progress: Progress,
) -> tuple[float, ...]:
    squared_distance = np.full(len(points), np.inf, np.float32)
    is_in_front = np.zeros(len(points), bool)
    with progress.stage("Accuracy", len(points) * len(scans)) as advance:
        for scan_points, world_from_scan in scans:
            scan = sort_scan(scan_points)
            for start in range(0, len(points), _POINTS_AT_ONCE):
                part = slice(start, start + _POINTS_AT_ONCE)
                local = _moved(points[part], _inverse(world_from_scan))
                squared, in_front = judge(local, scan, config)
                squared_distance[part] = np.minimum(squared_distance[part], squared)
                is_in_front[part] |= in_front
                advance(len(local))
    grids = VoxelGrids(points, config.voxel_size)
    squared_tolerances = np.array(config.tolerances, np.float32) ** 2
    accurate = [squared_distance <= squared for squared in squared_tolerances]
    return tuple(grids.mean_share(good, good | is_in_front) for good in accurate)


def _moved(points: Points, motion: Points) -> Points:
    """Points after a rigid motion.

    In float32, summed in the order of PCL, as in the official program: walls often lie
    on the border of a voxel, where the last bit decides.
    """
    x, y, z = points.T
    rows = [r[0] * x + (r[1] * y + (r[2] * z + r[3])) for r in motion[:3]]
    return np.stack(rows, axis=1)


def _inverse(motion: Points) -> Points:
    inverse = np.eye(4, dtype=np.float32)
    inverse[:3, :3] = motion[:3, :3].T
    inverse[:3, 3] = motion[:3, :3].T @ -motion[:3, 3]
    return inverse


def f1_score(accuracy: float, completeness: float) -> float:
    """Harmonic mean, in 0..1; 0 if both are 0."""
    total = accuracy + completeness
    return 2 * accuracy * completeness / total if total > 0 else 0.0


def _finite(points: Points, name: str) -> Points:
    is_finite = (np.abs(points) < _FAR_M).all(axis=1)
    if is_finite.all():
        return points
    num_others = len(points) - int(is_finite.sum())
    logger.warning("%s: %d points are not finite and left out.", name, num_others)
    return points[is_finite]


def _warn_of_misfit(points: Points, scan_points: Points) -> None:
    """Log a warning if a cloud is in other units than the scans, or elsewhere."""
    if len(points) == 0:
        logger.warning("the cloud has no point; all scores are 0.")
        return
    queries = _sampled(points, _NUM_QUERIES)
    samples = _sampled(scan_points, _NUM_SAMPLES)
    distances, _ = cKDTree(samples).query(queries, eps=0.1)
    median_m = float(np.median(distances))
    cloud_m, scans_m = _extent(queries), _extent(samples)
    is_near = median_m <= _MAX_DISTANCE * scans_m
    is_alike = scans_m <= _MAX_RATIO * cloud_m and cloud_m <= _MAX_RATIO * scans_m
    if not (is_near and is_alike):
        logger.warning(
            "half of the cloud is more than %.2g m from the scans; it extends over "
            "%.2g m, they over %.2g m: it is in other units or not aligned; "
            "reconstruct with the benchmark's poses (dslr_calibration_undistorted).",
            median_m,
            cloud_m,
            scans_m,
        )


def _sampled(points: Points, num: int) -> Points:
    return points[:: max(1, len(points) // num)]


def _extent(points: Points) -> float:
    """Diagonal of the box without the outermost 2 % on each side of each axis."""
    low, high = np.percentile(points, [2, 98], axis=0)
    return float(np.linalg.norm(high - low))
