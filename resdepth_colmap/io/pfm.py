"""PFM files: a grey or colour map of float32, as Middlebury distributes disparities."""

import re
from pathlib import Path

import numpy as np

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.files import reading
from resdepth_colmap.scene import FloatMap

_HEADER = re.compile(rb"(P[fF])\s+(\d{1,9})\s+(\d{1,9})\s+(-?[0-9.eE+-]+)\s")
_LONGEST_HEADER = 100


def read_pfm(path: Path) -> FloatMap:
    """Read a grey PFM file.

    Returns:
        Shape (H, W), float32, the top row first; infinite values are left as they are.

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
