"""The package as a library: light to import, whole when used, in any import order."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import resdepth_colmap

USE = """
from pathlib import Path
import numpy as np
from resdepth_colmap.io.images import read_rgb, write_png
from resdepth_colmap.io.colmap.model import read_scene
path = Path({folder!r}) / "picture.png"
write_png(path, np.full((8, 8, 3), 7, np.uint8))
assert (read_rgb(path) == 7).all()
"""


def run_python(code: str) -> None:
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr


def test_the_import_is_light_and_each_name_comes_when_asked_for() -> None:
    run_python(
        "import sys, resdepth_colmap\n"
        "assert not {'torch', 'open3d', 'pycolmap', 'numpy'} & set(sys.modules)\n"
        "resdepth_colmap.StereoConfig()\n"
        "assert not {'torch', 'open3d', 'pycolmap', 'numpy'} & set(sys.modules)\n"
    )


@pytest.mark.parametrize("name", resdepth_colmap.__all__)
def test_each_public_name_is_there_with_a_docstring(name: str) -> None:
    assert getattr(resdepth_colmap, name).__doc__
    assert name in dir(resdepth_colmap)


def test_what_a_type_checker_sees_is_what_is_there() -> None:
    source = Path(resdepth_colmap.__file__).read_text(encoding="utf-8")
    imported = {
        alias.name: node.module
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
        if node.module.startswith("resdepth_colmap")
    }
    assert set(imported) == set(resdepth_colmap.__all__)
    for name, module in imported.items():
        assert module == f"resdepth_colmap.{resdepth_colmap._MODULE_OF[name]}"


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="polish"):
        resdepth_colmap.polish  # noqa: B018  # the access is the test


@pytest.mark.parametrize(
    "first", ["import pycolmap", "import cv2", "import cv2, pycolmap", "import torch"]
)
def test_pictures_are_written_in_any_import_order(first: str, tmp_path: Path) -> None:
    # cv2.imwrite of a PNG aborts the process if pycolmap was imported before cv2.
    run_python(f"{first}\n{USE.format(folder=str(tmp_path))}")


def test_the_module_runs_as_the_command() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "resdepth_colmap", "--version"],
        capture_output=True,
        text=True,
    )
    assert resdepth_colmap.__version__ in done.stdout
