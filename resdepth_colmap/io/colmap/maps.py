"""COLMAP's map files: depth maps, normal maps and consistency graphs.

`W&H&C&`, then little-endian values. In `stereo/`, `<image name>.<kind>.bin` lies in
`depth_maps`, `normal_maps` and `consistency_graphs`. Maps are planar: all nx, all ny,
all nz (pycolmap 4.2.1's `NormalMap.from_array` and `to_array` take them for
interleaved). A consistency graph has int32 records, one for each pixel that any source
agrees with: column, row, number of sources, their indices. (COLMAP's documentation has
row and column the other way round; this is what its consistency_graph.cc reads.)
"""

import os
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.files import reading, write_whole
from resdepth_colmap.scene import DepthMap, NormalMap

_HEADER = re.compile(rb"(\d{1,9})&(\d{1,9})&(\d{1,9})&")
_LONGEST_HEADER = 30  # three numbers of nine digits and their "&"
_NUM_LEADING = 3  # column, row, number of sources


def read_depth_map(path: Path) -> DepthMap:
    """Read one depth map, shape (H, W), float32, in workspace units; 0 = no depth.

    What is not finite or negative in the file has become 0.

    Raises:
        WorkspaceError: If the file is not there, truncated, has a lying header or
            three channels, or if every value is NaN, infinite or negative.
    """
    depth: DepthMap = read_planes(path, num_channels=1)[0]
    usable = np.isfinite(depth) & (depth >= 0)
    _check_any(path, usable, "depths are NaN, infinite or negative")
    return np.where(usable, depth, np.float32(0))


def write_depth_map(path: Path, depth: DepthMap) -> None:
    """Write one depth map, shape (H, W), whole or not at all; its folder is made.

    NaN, infinite and negative depths are written as 0: COLMAP's fusion would let them
    through. WorkspaceError if the file cannot be written.
    """
    if depth.ndim != 2:
        raise ValueError(f"{depth.shape=} but expected (H, W).")
    usable = np.isfinite(depth) & (depth >= 0)
    write_planes(path, np.where(usable, depth, np.float32(0))[np.newaxis])


def read_normal_map(path: Path) -> NormalMap:
    """Read one normal map, shape (H, W, 3), float32, in the camera frame.

    (0, 0, 0) = none, also where a component in the file is not finite.

    Raises:
        WorkspaceError: If the file is not there, truncated, has a lying header or
            one channel, or if no normal is finite.
    """
    normals = np.moveaxis(read_planes(path, num_channels=3), 0, 2)
    finite = np.asarray(np.isfinite(normals).all(axis=2, keepdims=True))
    _check_any(path, finite, "normals are NaN or infinite")
    return np.ascontiguousarray(np.where(finite, normals, np.float32(0)))


def write_normal_map(path: Path, normals: NormalMap) -> None:
    """Write one normal map, whole or not at all; its folder is made.

    Unit normals in the camera frame, shape (H, W, 3), towards the camera (nz < 0);
    (0, 0, 0) = none, which is also written for a normal that is not finite.
    WorkspaceError if the file cannot be written.
    """
    if normals.ndim != 3 or normals.shape[2] != 3:
        raise ValueError(f"{normals.shape=} but expected (H, W, 3).")
    finite = np.isfinite(normals).all(axis=2, keepdims=True)
    clean = np.where(finite, normals, np.float32(0))
    write_planes(path, np.moveaxis(clean, 2, 0))


def write_consistency_graph(
    path: Path, agrees: npt.NDArray[np.bool_], image_indices: Sequence[int]
) -> None:
    """Write a consistency graph, whole or not at all; its folder is made.

    Args:
        path: The file to write.
        agrees: Whether source s agrees with a pixel, shape (S, H, W).
        image_indices: Index of each source among the images of the model, as COLMAP
            counts them, shape (S,).
    """
    num_sources, height, width = agrees.shape
    by_pixel = agrees.reshape(num_sources, height * width)
    counts = by_pixel.sum(axis=0)
    pixels = np.flatnonzero(counts)
    counts = counts[pixels]
    lengths = _NUM_LEADING + counts
    starts = np.cumsum(lengths) - lengths
    records = np.empty(int(lengths.sum()), "<i4")
    is_index = np.ones(records.size, np.bool_)
    leading = (pixels % width, pixels // width, counts)
    for offset, values in enumerate(leading):
        records[starts + offset] = values
        is_index[starts + offset] = False
    _, sources = np.nonzero(by_pixel[:, pixels].T)
    records[is_index] = np.asarray(image_indices, "<i4")[sources]
    write_whole(path, f"{width}&{height}&1&".encode("ascii") + records.tobytes())


def read_map_size(path: Path) -> tuple[int, int]:
    """Width and height of a map, in pixels; WorkspaceError if it has no header."""
    with reading(path), path.open("rb") as file:
        (width, height, _), _ = _parsed(path, file.read(_LONGEST_HEADER))
    return width, height


def read_planes(path: Path, num_channels: int) -> npt.NDArray[np.float32]:
    """Read a map, shape (C, H, W), as it is in the file.

    Raises:
        WorkspaceError: If the file is not there, has another number of channels, or
            holds more or fewer bytes than its header says.
    """
    with reading(path), path.open("rb") as file:
        header = file.read(_LONGEST_HEADER)
        (width, height, channels), num_header_bytes = _parsed(path, header)
        if channels != num_channels:
            raise WorkspaceError(
                f"{path}: the header says {channels} channels but expected "
                f"{num_channels}; depth maps have 1, normal maps 3."
            )
        num_present = os.fstat(file.fileno()).st_size
        num_expected = num_header_bytes + 4 * width * height * channels
        if num_present != num_expected:  # nothing is allocated before that
            raise WorkspaceError(
                f"{path}: the header says {width} x {height} x {channels}, that is "
                f"{num_expected} bytes, but the file has {num_present}; "
                "it is truncated or no map, compute it again."
            )
        file.seek(num_header_bytes)
        values = np.fromfile(file, dtype="<f4")
    return values.reshape(channels, height, width).astype(np.float32, copy=False)


def write_planes(path: Path, planes: npt.NDArray[np.floating]) -> None:
    """Write a map, shape (C, H, W), as it is; WorkspaceError if that fails."""
    channels, height, width = planes.shape
    header = f"{width}&{height}&{channels}&".encode("ascii")
    write_whole(path, header + planes.astype("<f4").tobytes())


def _check_any(path: Path, usable: npt.NDArray[np.bool_], fault: str) -> None:
    if not usable.any():
        raise WorkspaceError(
            f"{path}: all {usable.size} {fault}; delete the file or compute it again."
        )


def _parsed(path: Path, header: bytes) -> tuple[tuple[int, int, int], int]:
    """Width, height and number of channels; size of the header in bytes."""
    match = _HEADER.match(header)
    width, height, channels = map(int, match.groups()) if match else (0, 0, 0)
    if match is None or 0 in (width, height, channels):
        raise WorkspaceError(
            f"{path}: not a COLMAP map: it has {path.stat().st_size} bytes and begins "
            f"with {header!r} but expected 'WIDTH&HEIGHT&CHANNELS&'."
        )
    return (width, height, channels), match.end()
