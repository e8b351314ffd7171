"""Runs `resdepth-colmap` for benchmarks, and counts what a run costs."""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from scripts.benchmarks.record import MEASUREMENTS

Cost = dict[str, float]
"""Wall seconds, processor seconds and peak memory in MiB, by these keys:
seconds, cpu_seconds, peak_memory_mb."""


def run(*words: object, folder: Path | None = None, quiet: bool = False) -> Cost:
    """Run a command of resdepth-colmap in a process, and count its cost.

    Modules that call it import nothing heavy: a child starts with the memory count of
    its parent.

    Args:
        words: The command line after the name of the program.
        folder: Where it runs; None = here.
        quiet: Whether its output is shown only if it fails.

    Raises:
        RuntimeError: If the command fails.
    """
    command = [sys.executable, "-m", "resdepth_colmap", *map(str, words)]
    print("$ resdepth-colmap", " ".join(command[3:]), flush=True)
    start = time.perf_counter()
    with tempfile.TemporaryFile() as output:
        shown = output if quiet else None
        child = subprocess.Popen(command, cwd=folder, stdout=shown, stderr=shown)
        _, status, usage = os.wait4(child.pid, 0)
        seconds = time.perf_counter() - start
        child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode:
            output.seek(0)
            raise RuntimeError(f"{' '.join(command)}: {output.read().decode()}")
    unit = 1024**2 if sys.platform == "darwin" else 1024
    return {
        "seconds": round(seconds, 2),
        "cpu_seconds": round(usage.ru_utime + usage.ru_stime, 2),
        "peak_memory_mb": round(usage.ru_maxrss / unit, 1),
    }


def evaluate_depth(scenes: Path, name: str, options: Sequence[str]) -> None:
    """Run `evaluate depth` in this process, and exit as it does.

    Args:
        scenes: Folder of the scenes.
        name: Name of the file in docs/measurements/, without suffix.
        options: Further options; a later --output wins.
    """
    from resdepth_colmap.cli.main import main

    output = ["--output", str(MEASUREMENTS / f"{name}.json")]
    main(
        ["evaluate", "depth", str(scenes), *output, *options],
        prog_name="resdepth-colmap",
    )
