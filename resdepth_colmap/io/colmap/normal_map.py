"""Normal maps, in COLMAP's files (`<image name>.<kind>.bin` in `stereo/normal_maps`).

The file is planar: all nx, then all ny, then all nz. (pycolmap 4.2.1's
`NormalMap.from_array` and `to_array` take it for interleaved.)
"""

from pathlib import Path

import numpy as np

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap import map_file
from resdepth_colmap.scene import NormalMap


def read_normal_map(path: Path) -> NormalMap:
    """Read one normal map.

    Args:
        path: File in COLMAP's map format, three channels, planar.

    Returns:
        Normals in the camera frame, shape (H, W, 3), float32; (0, 0, 0) = none, also
        where a component in the file is not finite.

    Raises:
        WorkspaceError: If the file is not there, truncated, has a lying header or
            one channel, or if no normal is finite.
    """
    normals = np.moveaxis(map_file.read_planes(path, num_channels=3), 0, 2)
    finite = np.isfinite(normals).all(axis=2, keepdims=True)
    if not finite.any():
        raise WorkspaceError(
            f"{path}: all {finite.size} normals are NaN or infinite; "
            "delete the file or compute it again."
        )
    return np.ascontiguousarray(np.where(finite, normals, np.float32(0)))


def write_normal_map(path: Path, normals: NormalMap) -> None:
    """Write one normal map, whole or not at all; its folder is made.

    Args:
        path: The file to write.
        normals: Unit normals in the camera frame, shape (H, W, 3), float32, towards
            the camera (nz < 0); (0, 0, 0) = none, which is also written for a normal
            that is not finite.

    Raises:
        WorkspaceError: If the file cannot be written.
    """
    if normals.ndim != 3 or normals.shape[2] != 3:
        raise ValueError(f"{normals.shape=} but expected (H, W, 3).")
    finite = np.isfinite(normals).all(axis=2, keepdims=True)
    clean = np.where(finite, normals, np.float32(0)).astype(np.float32)
    map_file.write_planes(path, np.moveaxis(clean, 2, 0))
