"""COLMAP's models through pycolmap: quiet, checked, with errors that name the folder.

pycolmap 4.2.1 never returns from a truncated `points3D.bin`, and takes what is missing
of `cameras.bin` and `images.bin` from uninitialised memory. So each record is walked.
"""

import contextlib
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pycolmap

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.files import read_text

PYCOLMAP_ERRORS = (ValueError, IndexError, KeyError, RuntimeError, OSError)
"""What pycolmap raises for a broken model (UnicodeDecodeError is a ValueError)."""


def open_reconstruction(path: Path) -> Any:
    """Read a pycolmap.Reconstruction, binary or text, of any COLMAP version.

    Raises:
        WorkspaceError: If the model is missing or broken.
    """
    check_model_files(path)
    with quiet_pycolmap():
        try:
            return pycolmap.Reconstruction(path)
        except PYCOLMAP_ERRORS as error:
            raise broken_model(path, error) from error


def broken_model(path: Path, error: Exception) -> WorkspaceError:
    """What to raise for a model that pycolmap cannot read."""
    reason = " ".join(str(error).split())[:200]
    return WorkspaceError(
        f"{path}: the model cannot be read ({reason}); "
        "copy it again or export it again with `colmap model_converter`."
    )


@contextlib.contextmanager
def quiet_pycolmap() -> Iterator[None]:
    """Keep COLMAP's log off stderr: what matters is raised."""
    level = pycolmap.logging.minloglevel
    pycolmap.logging.minloglevel = int(pycolmap.logging.FATAL)
    try:
        yield
    finally:
        pycolmap.logging.minloglevel = level


MODEL_PARTS = ("cameras", "images", "points3D", "rigs", "frames")
"""The files of a model, each as .bin or .txt; the last two are of COLMAP 3.12 on."""

# Number of parameters of COLMAP's camera models, by model id.
_NUM_PARAMETERS = (3, 4, 4, 5, 8, 8, 12, 5, 4, 5, 12, 16, 4, 5, 3, 4, 6, 2)


def find_model(folder: Path) -> str | None:
    """The kind of model in a folder: ".bin", ".txt" or None; binary goes first."""
    for suffix in (".bin", ".txt"):
        if (folder / f"cameras{suffix}").is_file():
            return suffix
    return None


def check_model_files(folder: Path) -> None:
    """WorkspaceError if there is no model, or a file of it is missing or truncated."""
    suffix = find_model(folder)
    if suffix is None:
        raise WorkspaceError(
            f"{folder}: no COLMAP model (no cameras.bin, cameras.txt)."
        )
    for part in MODEL_PARTS[:3]:
        if not (folder / f"{part}{suffix}").is_file():
            raise WorkspaceError(
                f"{folder / part}{suffix}: no such file, but a model has cameras, "
                "images and points3D; export the model again."
            )
    if suffix == ".bin":
        for part, step in _STEPS.items():
            _walk(folder / f"{part}.bin", step)


def names_in_text(folder: Path) -> dict[int, str]:
    """The image names of a text model, by image id; WorkspaceError if it is no UTF-8.

    COLMAP writes names with blanks into `images.txt`, but reads them only up to the
    first one.
    """
    path = folder / "images.txt"
    lines = iter(read_text(path).split("\n"))
    names = {}
    for line in lines:
        fields = line.strip().split(maxsplit=9)
        if len(fields) == 10 and fields[0].isdecimal():
            names[int(fields[0])] = fields[9]
            next(lines, None)  # the points of the image
    return names


def _walk(path: Path, step: Callable[[bytes, int], int]) -> None:
    try:
        data = path.read_bytes()
        (num_records,) = struct.unpack_from("<Q", data)
        offset = 8
        for _ in range(num_records):
            offset = step(data, offset)
            if offset > len(data):
                break
        if offset > len(data):
            raise ValueError("the last record has no end")
    except (OSError, struct.error, ValueError, IndexError) as error:
        raise WorkspaceError(
            f"{path}: truncated or no COLMAP model file; copy it or export the model "
            "again."
        ) from error


def _after_camera(data: bytes, offset: int) -> int:
    _, model_id = struct.unpack_from("<II", data, offset)
    return offset + 24 + 8 * _NUM_PARAMETERS[model_id]


def _after_image(data: bytes, offset: int) -> int:
    end_of_name = data.index(b"\0", offset + 64)  # id, pose and camera id come before
    (num_points2d,) = struct.unpack_from("<Q", data, end_of_name + 1)
    return end_of_name + 9 + 24 * int(num_points2d)


def _after_point(data: bytes, offset: int) -> int:
    (track_length,) = struct.unpack_from("<Q", data, offset + 43)
    return offset + 51 + 8 * int(track_length)


_STEPS = {"cameras": _after_camera, "images": _after_image, "points3D": _after_point}
