"""Depth maps, in COLMAP's files (`<image name>.<kind>.bin` in `stereo/depth_maps`)."""

from pathlib import Path

import numpy as np

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap import map_file
from resdepth_colmap.scene import DepthMap


def read_depth_map(path: Path) -> DepthMap:
    """Read one depth map.

    Args:
        path: File in COLMAP's map format, one channel.

    Returns:
        Depth, shape (H, W), float32, in workspace units; 0 = no depth. What is not
        finite or negative in the file has become 0.

    Raises:
        WorkspaceError: If the file is not there, truncated, has a lying header or
            three channels, or if every value is NaN, infinite or negative.
    """
    depth: DepthMap = map_file.read_planes(path, num_channels=1)[0]
    usable = _is_usable(depth)
    if not usable.any():
        raise WorkspaceError(
            f"{path}: all {depth.size} depths are NaN, infinite or negative; "
            "delete the file or compute it again."
        )
    return np.where(usable, depth, np.float32(0))


def write_depth_map(path: Path, depth: DepthMap) -> None:
    """Write one depth map, whole or not at all; its folder is made.

    Args:
        path: The file to write.
        depth: Depth, shape (H, W), float32; 0 = no depth. NaN, infinite and negative
            depths are written as 0: COLMAP's fusion would let them through.

    Raises:
        WorkspaceError: If the file cannot be written.
    """
    if depth.ndim != 2:
        raise ValueError(f"{depth.shape=} but expected (H, W).")
    clean = np.where(_is_usable(depth), depth, np.float32(0)).astype(np.float32)
    map_file.write_planes(path, clean[np.newaxis])


def read_map_size(path: Path) -> tuple[int, int]:
    """Width and height of a depth or normal map, in pixels, from its header alone.

    Raises:
        WorkspaceError: If the file is not there or has no header.
    """
    return map_file.read_size(path)


def _is_usable(depth: DepthMap) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    return np.isfinite(depth) & (depth >= 0)
