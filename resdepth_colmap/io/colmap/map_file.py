"""COLMAP's map files: `W&H&C&`, then planes of little-endian float32."""

import os
import re
from pathlib import Path

import numpy as np
import numpy.typing as npt

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.files import write_whole

_HEADER = re.compile(rb"(\d{1,9})&(\d{1,9})&(\d{1,9})&")
_LONGEST_HEADER = 30  # three numbers of nine digits and their "&"


def read_planes(path: Path, num_channels: int) -> npt.NDArray[np.float32]:
    """Read a map, shape (C, H, W), as it is in the file.

    Args:
        path: A file in COLMAP's map format.
        num_channels: Number of channels that it has to have.

    Raises:
        WorkspaceError: If the file is not there, has a wrong number of channels, or
            holds more or fewer bytes than its header says.
    """
    try:
        with path.open("rb") as file:
            header = file.read(_LONGEST_HEADER)
            num_present = os.fstat(file.fileno()).st_size
            shape, num_header_bytes = _checked(path, header, num_present, num_channels)
            file.seek(num_header_bytes)
            values = np.fromfile(file, dtype="<f4")
    except WorkspaceError:
        raise
    except OSError as error:
        raise _unreadable(path, error) from error
    return values.reshape(shape).astype(np.float32, copy=False)


def read_size(path: Path) -> tuple[int, int]:
    """Width and height of a map, in pixels, from its header alone.

    Raises:
        WorkspaceError: If the file is not there or has no header.
    """
    width, height, _, _ = _parse_header(path, _read_header(path))
    return width, height


def write_planes(path: Path, planes: npt.NDArray[np.float32]) -> None:
    """Write a map of shape (C, H, W), whole or not at all.

    Raises:
        WorkspaceError: If the file cannot be written.
    """
    channels, height, width = planes.shape
    header = f"{width}&{height}&{channels}&".encode("ascii")
    write_whole(path, header + np.ascontiguousarray(planes, dtype="<f4").tobytes())


def _checked(
    path: Path, header: bytes, num_present: int, num_channels: int
) -> tuple[tuple[int, int, int], int]:
    """Shape of the map and size of its header; nothing is allocated before that."""
    width, height, channels, num_header_bytes = _parse_header(path, header)
    if channels != num_channels:
        raise WorkspaceError(
            f"{path}: the header says {channels} channels but expected {num_channels}; "
            "depth maps have 1, normal maps 3."
        )
    num_expected = num_header_bytes + 4 * width * height * channels
    if num_present != num_expected:
        raise WorkspaceError(
            f"{path}: the header says {width} x {height} x {channels}, that is "
            f"{num_expected} bytes, but the file has {num_present}; "
            "it is truncated or no map, compute it again."
        )
    return (channels, height, width), num_header_bytes


def _read_header(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(_LONGEST_HEADER)
    except OSError as error:
        raise _unreadable(path, error) from error


def _unreadable(path: Path, error: OSError) -> WorkspaceError:
    reason = error.strerror or str(error)
    return WorkspaceError(f"{path}: cannot read the map ({reason}).")


def _parse_header(path: Path, header: bytes) -> tuple[int, int, int, int]:
    match = _HEADER.match(header)
    width, height, channels = map(int, match.groups()) if match else (0, 0, 0)
    if match is None or 0 in (width, height, channels):
        raise WorkspaceError(
            f"{path}: not a COLMAP map: it has {path.stat().st_size} bytes and begins "
            f"with {header!r} but expected 'WIDTH&HEIGHT&CHANNELS&'."
        )
    return width, height, channels, match.end()
