"""The score of a cloud in a file against the scans of a scene."""

from pathlib import Path

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


def score_cloud_file(
    cloud_path: Path,
    alignment_path: Path,
    config: CloudConfig,
    progress: Progress | None = None,
) -> CloudScores:
    """Compare a cloud with the laser scans of a scene, by ETH3D's rules.

    Args:
        cloud_path: PLY file of the cloud, in the world of the scans, in metres; without
            a point all its scores are 0.
        alignment_path: `scan_alignment.mlp`; names the scans and where they stand.
        config: Tolerances, voxels and beam.
        progress: Is told how far the comparison is.

    Raises:
        WorkspaceError: If a file is not there, broken or of another kind, or if the
            scans have no point.
    """
    aligned = read_scan_alignment(alignment_path)
    points = read_ply_points(cloud_path)
    scans = [
        PlacedScan(
            points=read_ply_points(scan.path), world_from_scan=scan.world_from_scan
        )
        for scan in aligned
    ]
    if not any(len(scan.points) for scan in scans):
        raise WorkspaceError(
            f"{alignment_path}: its scans have no point; unpack ETH3D's scan_clean."
        )
    return cloud_scores(points, scans, config, progress)
