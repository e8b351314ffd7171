"""Measure `evaluate cloud`: parity with ETH3D's program, seconds and memory.

    python -m scripts.benchmarks.cloud [--data FOLDER]

Parity: the samples of eth3d_cloud_cases/ in the real data, each with the output of the
official program. Speed: a furnished room, scanned from its middle at equal angles; the
cloud is what is seen from a corner, with noise of 1 cm and 2 % of floaters. Each size
runs in a separate process. Writes docs/measurements/cloud.json.
"""

import json
import multiprocessing
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from resdepth_colmap.evaluation.cloud.config import CloudConfig
from resdepth_colmap.evaluation.cloud.laser_truth import score_cloud_file
from resdepth_colmap.io.point_cloud import PointCloud, write_cloud
from resdepth_colmap.versions import peak_memory_mb
from scripts.benchmarks.record import parser, rounded, stamp, write
from scripts.benchmarks.tables.costs import SCORES

SIZES = (250_000, 1_000_000, 4_000_000)
NOISE_M = 0.01
SHARE_OF_FLOATERS = 0.02

ROOM_M = np.array([[0, 0, 0], [8, 6, 3.0]])
FURNITURE_M = np.array([[[2, 2, 0], [3, 3.5, 0.8]], [[5, 1, 0], [6, 2, 1.5]]])

Array = npt.NDArray[np.float64]


def scanned(position: Array, num_points: int) -> Array:
    """What a scanner at a position in the room measures, in its own frame."""
    num_rows = round((num_points / 2) ** 0.5)
    inclination, azimuth = np.meshgrid(
        (np.arange(num_rows) + 0.5) / num_rows * np.pi,
        (np.arange(2 * num_rows) + 0.5) / num_rows * np.pi,
    )
    flat, up = np.sin(inclination), np.cos(inclination)
    rays = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), up], axis=-1)
    rays = rays.reshape(-1, 3)
    distance = ((ROOM_M[:, np.newaxis] - position) / rays).max(axis=0).min(axis=1)
    for box in FURNITURE_M:
        sides = (box[:, np.newaxis] - position) / rays
        near, far = sides.min(axis=0).max(axis=1), sides.max(axis=0).min(axis=1)
        is_hit = (near < far) & (near > 0)
        distance = np.where(is_hit, np.minimum(near, distance), distance)
    points: Array = rays * distance[:, np.newaxis]
    return points


def write_points(path: Path, points: Array) -> None:
    """Write coordinates as a PLY file."""
    nothing = np.zeros((len(points), 3))
    cloud = PointCloud(
        points=points.astype(np.float32),
        colors=nothing.astype(np.uint8),
        normals=nothing.astype(np.float32),
    )
    write_cloud(path, cloud)


def write_scene(folder: Path, num_points: int) -> None:
    """Write a scan, its alignment, and a cloud of as many points."""
    middle, corner = np.array([4.0, 3.0, 1.4]), np.array([1.0, 1.0, 1.7])
    write_points(folder / "scan.ply", scanned(middle, num_points))
    matrix = np.eye(4)
    matrix[:3, 3] = middle
    values = " ".join(map(str, matrix.ravel().tolist()))
    (folder / "scan_alignment.mlp").write_text(
        '<MeshLabProject><MeshGroup><MLMesh filename="scan.ply">'
        f"<MLMatrix44>{values}</MLMatrix44></MLMesh></MeshGroup></MeshLabProject>",
        "utf-8",
    )
    rng = np.random.default_rng(0)
    cloud = scanned(corner, num_points) + corner
    cloud += rng.normal(0, NOISE_M, cloud.shape)
    is_floating = rng.random(len(cloud)) < SHARE_OF_FLOATERS
    shape = (int(is_floating.sum()), 3)
    cloud[is_floating] = rng.uniform(ROOM_M[0], ROOM_M[1], shape)
    write_points(folder / "reconstruction.ply", rng.permutation(cloud))


def measure(folder: Path) -> dict[str, Any]:
    """Score the cloud of a folder: from its files to its scores."""
    start, start_cpu = time.perf_counter(), time.process_time()
    scores = score_cloud_file(
        folder / "reconstruction.ply", folder / "scan_alignment.mlp", CloudConfig()
    )
    return {
        "num_points": scores.num_points,
        "num_scan_points": scores.num_scan_points,
        "seconds": round(time.perf_counter() - start, 2),
        "cpu_seconds": round(time.process_time() - start_cpu, 2),
        "peak_memory_mb": round(peak_memory_mb() or 0),
        "scores": scores.to_mapping(),
    }


def measured_alone(folder: Path) -> dict[str, Any]:
    """The same in a new process, whose peak memory counts nothing else."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(measure, (folder,))


def compared(folder: Path) -> dict[str, Any]:
    """Our scores of a sample beside the official ones."""
    official = json.loads((folder / "official.json").read_text("utf-8"))
    ours = measure(folder)["scores"]
    return {
        "tolerances": official["tolerances"],
        "official": {name: official[name] for name in SCORES},
        "ours": {name: rounded(list(ours[name])) for name in SCORES},
    }


def timed(num_points: int) -> dict[str, Any]:
    """Seconds and memory for a room of so many points."""
    with tempfile.TemporaryDirectory() as name:
        write_scene(Path(name), num_points)
        result = measured_alone(Path(name))
    del result["scores"]
    return result


def main() -> None:
    """Read the command line, compare, measure and write."""
    arguments = parser(__doc__, "cloud").parse_args()
    samples = sorted((arguments.data / "eth3d_cloud_cases").iterdir())
    measured = {
        **stamp("cloud"),
        "samples": {folder.name: compared(folder) for folder in samples},
        "sizes": [timed(num_points) for num_points in SIZES],
    }
    write(arguments.output, measured)


if __name__ == "__main__":
    main()
