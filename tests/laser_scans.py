"""Laser scans of an empty room, exact, as points and as files in ETH3D's formats."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from resdepth_colmap.evaluation.cloud.scores import PlacedScan

Points = npt.NDArray[np.float32]

ROOM_M = np.array([4.03, 3.02, 2.51])
"""Inner corner opposite the origin; no wall lies on a voxel's border but at 0."""


def pose(position: Sequence[float], turn_deg: Sequence[float] = (0, 0, 0)) -> Points:
    """Where a scanner stands: world_from_scan, shape (4, 4)."""
    matrix = np.eye(4, dtype=np.float32)
    matrix[:3, :3] = Rotation.from_euler("zyx", turn_deg, degrees=True).as_matrix()
    matrix[:3, 3] = position
    return matrix


def room_scan(
    position: Sequence[float] = (1.7, 1.3, 1.1),
    turn_deg: Sequence[float] = (20, 0, 0),
    num_rows: int = 90,
) -> PlacedScan:
    """Scan the room from a position in it, at equal steps of the angles."""
    inclination = (np.arange(num_rows) + 0.5) / num_rows * np.pi
    azimuth = (np.arange(2 * num_rows) + 0.5) / num_rows * np.pi
    inclinations, azimuths = np.meshgrid(inclination, azimuth)
    flat, up = np.sin(inclinations), np.cos(inclinations)
    rays = np.stack([flat * np.cos(azimuths), flat * np.sin(azimuths), up], axis=-1)
    directions = rays.reshape(-1, 3)
    world_from_scan = pose(position, turn_deg)
    rotation = world_from_scan[:3, :3].astype(np.float64)
    in_world = directions @ rotation.T
    walls = np.where(in_world > 0, ROOM_M, 0)
    distances = ((walls - np.asarray(position)) / in_world).min(axis=1)
    points = (directions * distances[:, np.newaxis]).astype(np.float32)
    return PlacedScan(points=points, world_from_scan=world_from_scan)


def in_world(scan: PlacedScan) -> Points:
    """The points of a scan in the world."""
    matrix = scan.world_from_scan
    return (scan.points @ matrix[:3, :3].T + matrix[:3, 3]).astype(np.float32)


def write_ply(path: Path, points: npt.ArrayLike) -> Path:
    """Write coordinates alone, binary, float32."""
    rows = np.asarray(points, "<f4").reshape(-1, 3)
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    path.write_bytes(header.encode() + rows.tobytes())
    return path


def write_scene(folder: Path, scans: Sequence[PlacedScan]) -> Path:
    """Write scans and the project that places them; returns the path of that."""
    meshes = ""
    for index, scan in enumerate(scans, start=1):
        write_ply(folder / f"scan{index}.ply", scan.points)
        rows = (" ".join(map(repr, row)) for row in scan.world_from_scan.tolist())
        matrix = " \n".join(rows)
        name = f"scan{index}.ply"
        meshes += f'<MLMesh label="{name}" filename="{name}">\n'
        meshes += f"<MLMatrix44>\n{matrix} \n</MLMatrix44>\n</MLMesh>\n"
    path = folder / "scan_alignment.mlp"
    path.write_text(project(meshes), encoding="utf-8")
    return path


def project(meshes: str) -> str:
    """The text of a project with these meshes."""
    return (
        "<!DOCTYPE MeshLabDocument>\n<MeshLabProject>\n"
        f"<MeshGroup>\n{meshes}</MeshGroup>\n</MeshLabProject>\n"
    )
