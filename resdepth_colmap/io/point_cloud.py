"""Point clouds in files that other programs read: PLY, PCD, XYZ.

All through open3d's tensor interface, which writes the coordinates as they are: float32
near the origin (PCL, and so ETH3D's program, reads doubles as zeros), doubles far from
it, where single precision would collapse them.
"""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from resdepth_colmap.errors import ConfigError, FusionError, WorkspaceError
from resdepth_colmap.io.files import whole_file
from resdepth_colmap.io.open3d_library import load_open3d
from resdepth_colmap.scene import Matrix

CLOUD_SUFFIXES = (".ply", ".pcd", ".xyz")
"""Extensions that `write_cloud` knows; .xyz holds coordinates alone."""


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class PointCloud:
    """Points with colours and normals.

    Attributes:
        points: Coordinates in the world frame, in workspace units, shape (N, 3),
            float32, or float64 far from the origin.
        colors: RGB values, shape (N, 3), uint8.
        normals: Unit normals in the world frame, shape (N, 3), float32; (0, 0, 0) =
            none.
    """

    points: npt.NDArray[np.floating[Any]]
    colors: npt.NDArray[np.uint8]
    normals: npt.NDArray[np.float32]

    def __post_init__(self) -> None:
        """Check the shapes once, so that no later code has to."""
        expected = (len(self.points), 3)
        for field in dataclasses.fields(self):
            shape = getattr(self, field.name).shape
            if shape != expected:
                raise ValueError(f"{field.name}: {shape=} but expected {expected}.")

    def __len__(self) -> int:
        """The number of points."""
        return len(self.points)

    def moved(self, offset: Matrix) -> "PointCloud":
        """The same cloud, moved; in double precision where that is needed."""
        if not offset.any():
            return self
        points = _compact(self.points.astype(np.float64) + offset)
        return dataclasses.replace(self, points=points)

    def sampled(self, most: int, seed: int = 0) -> "PointCloud":
        """At most so many of the points, drawn at random, in their old order."""
        if len(self) <= most:
            return self
        rng = np.random.default_rng(seed)
        kept = np.sort(rng.choice(len(self), most, replace=False))
        return PointCloud(
            points=self.points[kept],
            colors=self.colors[kept],
            normals=self.normals[kept],
        )


def check_cloud_path(path: Path) -> None:
    """ConfigError if a path's extension is none of CLOUD_SUFFIXES."""
    if path.suffix.lower() not in CLOUD_SUFFIXES:
        known = ", ".join(CLOUD_SUFFIXES)
        raise ConfigError(
            f"{path}: clouds cannot be written as {path.suffix!r}; known are: {known}."
        )


def write_cloud(path: Path, cloud: PointCloud) -> None:
    """Write a cloud, whole or not at all, in the format of the path's extension.

    .ply and .pcd are binary and hold coordinates, colours and normals.

    Raises:
        ConfigError: If the extension is none of these.
        FusionError: If the cloud is empty.
        WorkspaceError: If the file cannot be written.
    """
    check_cloud_path(path)
    if len(cloud) == 0:
        raise FusionError(
            f"{path}: no point to write; ask fewer views to agree (--min-num-views), "
            "allow larger errors (--max-depth-error, --max-reproj-error), or refine "
            "more images."
        )
    is_far = cloud.points.dtype == np.float64
    if is_far and path.suffix.lower() == ".pcd":
        raise ConfigError(
            f"{path}: the cloud is too far from its origin for a .pcd, which readers "
            "take in single precision alone; use .ply or .xyz."
        )
    open3d = load_open3d()

    points, colors, normals = (
        open3d.core.Tensor.from_numpy(np.ascontiguousarray(values, dtype))
        for values, dtype in (
            (cloud.points, cloud.points.dtype),
            (cloud.colors, np.uint8),
            (cloud.normals, np.float32),
        )
    )
    tensor_cloud = open3d.t.geometry.PointCloud(points)
    tensor_cloud.point.colors, tensor_cloud.point.normals = colors, normals
    with whole_file(path) as partial:
        if is_far and path.suffix.lower() == ".xyz":  # open3d writes no doubles there
            np.savetxt(partial, cloud.points, fmt="%.6f")
            return
        with _quiet(open3d):
            is_written = open3d.t.io.write_point_cloud(partial, tensor_cloud)
        if not is_written:
            raise WorkspaceError(
                f"{path}: cannot write the cloud; check the permissions of its folder "
                "and the free space of the disk."
            )


def read_cloud(path: Path) -> PointCloud:
    """Read a PLY file; colours and normals are 0 where it has none.

    Raises:
        ConfigError: If it is no .ply.
        WorkspaceError: If the file is not there, broken or without a point.
    """
    if path.suffix.lower() != ".ply":
        raise ConfigError(f"{path}: clouds are read from .ply, not {path.suffix!r}.")
    if not path.is_file():
        raise WorkspaceError(f"{path}: no such file.")
    open3d = load_open3d()

    with _quiet(open3d):
        tensor_cloud = open3d.t.io.read_point_cloud(path)
    values = {key: value.numpy() for key, value in tensor_cloud.point.items()}
    if len(values.get("positions", ())) == 0:
        raise WorkspaceError(f"{path}: no PLY file, broken, or without a point.")
    none = np.zeros_like(values["positions"])
    return PointCloud(
        points=_compact(values["positions"]),
        colors=values.get("colors", none).astype(np.uint8),
        normals=values.get("normals", none).astype(np.float32),
    )


def _compact(points: npt.NDArray[np.floating[Any]]) -> npt.NDArray[np.floating[Any]]:
    """Coordinates in single precision, unless that loses 1e-5 of the cloud's size."""
    size = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
    step = float(np.finfo(np.float32).eps) * float(np.abs(points).max(initial=0.0))
    return points.astype(np.float64 if step > 1e-5 * size > 0 else np.float32)


def _quiet(open3d: Any) -> Any:
    """Warnings off the terminal: what matters is raised."""
    return open3d.utility.VerbosityContextManager(open3d.utility.VerbosityLevel.Error)
