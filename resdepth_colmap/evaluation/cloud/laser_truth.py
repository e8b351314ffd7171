"""Laser scans as ground truth: clouds are scored by ETH3D's rules."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.evaluation.cloud.config import CloudConfig
from resdepth_colmap.evaluation.cloud.scores import (
    CloudScores,
    PlacedScan,
    cloud_scores,
)
from resdepth_colmap.io.ply_points import read_ply_points
from resdepth_colmap.io.scan_alignment import read_scan_alignment
from resdepth_colmap.progress import Progress


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class LaserTruth:
    """The laser scans of a scene.

    Attributes:
        scans: At least one has a point.
        config: Tolerances, voxels and beam.
    """

    scans: tuple[PlacedScan, ...]
    config: CloudConfig

    def to_mapping(self) -> dict[str, Any]:
        """Kind and size of the ground truth, ready for JSON."""
        return {
            "kind": "laser scans",
            "num_scans": len(self.scans),
            "num_points": sum(len(scan.points) for scan in self.scans),
            "voxel_size": self.config.voxel_size,
        }

    def score(
        self, points: npt.NDArray[np.float32], progress: Progress | None = None
    ) -> CloudScores:
        """Score a cloud in the world of the scans; see `cloud_scores`."""
        return cloud_scores(points, self.scans, self.config, progress)


def read_laser_truth(path: Path, config: CloudConfig) -> LaserTruth:
    """Read the scans that a `scan_alignment.mlp` lists.

    Raises:
        WorkspaceError: If a file is missing or broken, or the scans have no point.
    """
    scans = tuple(
        PlacedScan(
            points=read_ply_points(scan.path), world_from_scan=scan.world_from_scan
        )
        for scan in read_scan_alignment(path)
    )
    if not any(len(scan.points) for scan in scans):
        raise WorkspaceError(
            f"{path}: its scans have no point; unpack ETH3D's scan_clean."
        )
    return LaserTruth(scans=scans, config=config)


def score_cloud_file(
    cloud_path: Path,
    alignment_path: Path,
    config: CloudConfig,
    progress: Progress | None = None,
) -> CloudScores:
    """Score a cloud in a file against the laser scans of a scene, by ETH3D's rules.

    Args:
        cloud_path: PLY file of the cloud, in the world of the scans, in metres. The
            scores of a cloud without points are 0.
        alignment_path: `scan_alignment.mlp`, which lists the scans and their poses.
        config: Tolerances, voxels and beam.
        progress: Reports the progress.

    Raises:
        WorkspaceError: If a file is missing, broken or of another kind, or if the scans
            have no point.
    """
    points = read_ply_points(cloud_path)
    return read_laser_truth(alignment_path, config).score(points, progress)
