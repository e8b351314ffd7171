"""COLMAP's models through pycolmap: quiet, and with errors that name the folder."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pycolmap

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.model_file import check_model_files

PYCOLMAP_ERRORS = (ValueError, IndexError, KeyError, RuntimeError, OSError)
"""What pycolmap raises for a broken model (UnicodeDecodeError is a ValueError)."""


def open_reconstruction(path: Path) -> Any:
    """Read a model: a pycolmap.Reconstruction.

    Args:
        path: Its folder, binary or text, of any COLMAP version.

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
