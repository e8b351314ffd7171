"""Depth maps in formats of other programs: NPY, PFM, 16-bit PNG."""

import io
from pathlib import Path

import numpy as np
from PIL import Image

from resdepth_colmap.io.files import whole_file, write_whole
from resdepth_colmap.scene import DepthMap

MAX_PNG_VALUE = 65535


def write_npy(path: Path, depth: DepthMap) -> None:
    """Write a depth map as float32, shape (H, W), for `numpy.load`.

    Raises:
        WorkspaceError: If the file cannot be written.
    """
    buffer = io.BytesIO()
    np.save(buffer, depth.astype("<f4"))
    write_whole(path, buffer.getvalue())


def write_pfm(path: Path, depth: DepthMap) -> None:
    """Write a depth map as PFM: grey, little-endian float32, bottom row first.

    Raises:
        WorkspaceError: If the file cannot be written.
    """
    height, width = depth.shape
    header = f"Pf\n{width} {height}\n-1.0\n".encode("ascii")  # -: little-endian
    write_whole(path, header + np.flipud(depth).astype("<f4").tobytes())


def write_png16(path: Path, depth: DepthMap, unit: float) -> None:
    """Write a depth map as 16-bit grey PNG: value = depth / unit, rounded.

    A depth beyond the range becomes the largest value; one that would round to 0, which
    means "no depth", becomes 1.

    Args:
        path: The file to write.
        depth: Shape (H, W), in workspace units; 0 = no depth.
        unit: Depth of one step of the value, in workspace units.

    Raises:
        WorkspaceError: If the file cannot be written.
    """
    scaled = np.clip(np.rint(depth.astype(np.float64) / unit), 1, MAX_PNG_VALUE)
    values = np.where(depth > 0, scaled, 0).astype(np.uint16)
    with whole_file(path) as partial:
        Image.fromarray(values).save(partial, format="PNG")
