"""A warning for clouds in other units or another frame than the laser scans."""

import logging

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

logger = logging.getLogger(__name__)

MAX_DISTANCE = 0.05
"""Largest median distance from the scans, relative to their extent."""

MAX_RATIO = 10.0
"""Largest ratio of the extents of cloud and scans, either way."""

_NUM_SAMPLES = 20_000
_NUM_QUERIES = 1_000

Points = npt.NDArray[np.float32]


def warn_of_misfit(points: Points, scan_points: Points) -> None:
    """Log a warning if a cloud is in other units than the scans, or elsewhere.

    Args:
        points: Coordinates of the cloud, shape (N, 3), finite.
        scan_points: Coordinates of the scans' points in the world, shape (M, 3), at
            least one, finite.
    """
    if len(points) == 0:
        logger.warning("the cloud has no point; all scores are 0.")
        return
    queries = _sampled(points, _NUM_QUERIES)
    samples = _sampled(scan_points, _NUM_SAMPLES)
    distances, _ = cKDTree(samples).query(queries, eps=0.1)
    median_m = float(np.median(distances))
    cloud_m, scans_m = _extent(queries), _extent(samples)
    is_near = median_m <= MAX_DISTANCE * scans_m
    is_alike = scans_m <= MAX_RATIO * cloud_m and cloud_m <= MAX_RATIO * scans_m
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
