"""Maps in formats of other programs: NPY, PFM, 16-bit PNG.

WorkspaceError if a file cannot be written.
"""

import io
import re
from pathlib import Path

import numpy as np
from PIL import Image

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.files import reading, whole_file, write_whole
from resdepth_colmap.scene import DepthMap, FloatMap

MAX_PNG_VALUE = 65535


def write_npy(path: Path, depth: DepthMap) -> None:
    """Write a depth map as float32, shape (H, W), for `numpy.load`."""
    buffer = io.BytesIO()
    np.save(buffer, depth.astype("<f4"))
    write_whole(path, buffer.getvalue())


def write_pfm(path: Path, depth: DepthMap) -> None:
    """Write a depth map as PFM: grey, little-endian float32, bottom row first."""
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
    """
    scaled = np.clip(np.rint(depth.astype(np.float64) / unit), 1, MAX_PNG_VALUE)
    values = np.where(depth > 0, scaled, 0).astype(np.uint16)
    with whole_file(path) as partial:
        Image.fromarray(values).save(partial, format="PNG")


_HEADER = re.compile(rb"(P[fF])\s+(\d{1,9})\s+(\d{1,9})\s+(-?[0-9.eE+-]+)\s")
_LONGEST_HEADER = 100


def read_pfm(path: Path) -> FloatMap:
    """Read a grey PFM file, shape (H, W), float32, the top row first.

    Raises:
        WorkspaceError: If the file is not there, no grey PFM, or truncated.
    """
    with reading(path):
        data = path.read_bytes()
    match = _HEADER.match(data[:_LONGEST_HEADER])
    if match is None or match[1] != b"Pf":
        raise WorkspaceError(
            f"{path}: no grey PFM file; it begins with {data[:16]!r} but expected "
            "'Pf', width, height and scale."
        )
    width, height = int(match[2]), int(match[3])
    num_expected = match.end() + 4 * width * height
    if len(data) != num_expected:
        raise WorkspaceError(
            f"{path}: the header says {width} x {height}, that is {num_expected} "
            f"bytes, but the file has {len(data)}; it is truncated, copy it again."
        )
    order = "<f4" if float(match[4]) < 0 else ">f4"
    values = np.frombuffer(data, dtype=order, offset=match.end())
    return np.flipud(values.reshape(height, width)).astype(np.float32)
