"""A changed constant reaches the kernels that it is compiled into."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from resdepth_colmap.matching.compilation import forget_stale_kernels

INNER = "FACTOR = {}\n"
OUTER = """
from numba import njit
from kernels.inner import FACTOR


@njit(cache=True)
def scaled(value):
    return FACTOR * value
"""
CALL = "from kernels.outer import scaled; print(scaled(1))"


def write(folder: Path, factor: int, mtime: int) -> None:
    folder.mkdir(exist_ok=True)
    init = (
        "from pathlib import Path\n"
        "from resdepth_colmap.matching.compilation import forget_stale_kernels\n"
        "forget_stale_kernels(Path(__file__).parent)\n"
    )
    files = {"__init__": init, "inner": INNER.format(factor), "outer": OUTER}
    for name, text in files.items():
        path = folder / f"{name}.py"
        if not path.exists() or path.read_text() != text:
            path.write_text(text)
            os.utime(path, (mtime, mtime))


def called(folder: Path) -> str:
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        [sys.executable, "-c", CALL],
        cwd=folder.parent,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()


@pytest.mark.slow
def test_a_kernel_is_compiled_anew_when_a_constant_of_another_file_changed(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "kernels"
    write(folder, 2, mtime=1_000_000_000)
    assert called(folder) == "2"
    assert list((folder / "__pycache__").glob("*.nbi"))
    write(folder, 3, mtime=4_000_000_000)
    assert called(folder) == "3"


def test_kernels_that_are_newer_than_their_sources_stay(tmp_path: Path) -> None:
    (tmp_path / "kernel.py").write_text("")
    os.utime(tmp_path / "kernel.py", (1_000_000_000, 1_000_000_000))
    index = tmp_path / "__pycache__" / "kernel.nbi"
    index.parent.mkdir()
    index.write_bytes(b"")
    forget_stale_kernels(tmp_path)
    assert index.exists()
    os.utime(tmp_path / "kernel.py", (4_000_000_000, 4_000_000_000))
    forget_stale_kernels(tmp_path)
    assert not index.exists()
