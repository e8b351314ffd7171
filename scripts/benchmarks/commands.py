"""Measure the time and memory of each command, on small real workspaces.

    python -m scripts.benchmarks.commands [--data DATA] [--output FILE]

Each command is a process of its own, run once on copies of the data; its memory is the
peak of that process. Writes docs/measurements/commands.json; then
`python -m scripts.benchmarks.make_tables` puts the figures into the documents.
"""

import argparse
import datetime
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("RESDEPTH_DATA", REPOSITORY.parent / "shared" / "data"))
RESULT = REPOSITORY / "docs" / "measurements" / "commands.json"


def command_lines(data: Path) -> list[tuple[str, list[str]]]:
    """What is run, in this order, and on what."""
    cloud = "eth3d_cloud_cases/" + min(
        path.name for path in (data / "eth3d_cloud_cases").iterdir()
    )
    scans = ["--ground-truth", f"{cloud}/scan_alignment.mlp"]
    return [
        ("7 scenes, matched", ["evaluate", "depth", "middlebury"]),
        ("a small cloud", ["evaluate", "cloud", f"{cloud}/reconstruction.ply", *scans]),
        ("6 views of 0.3 megapixels", ["stereo", "rendered_weak"]),
        ("4 views of 0.76 megapixels", ["refine", "plant", "--input", "photometric"]),
        ("4 views of 0.76 megapixels", ["compare", "plant"]),
        ("4 views of 0.76 megapixels", ["report", "plant"]),
        ("4 views of 0.76 megapixels", ["info", "plant"]),
    ]


def measured(arguments: list[str], folder: Path) -> dict[str, float]:
    """Run a command in the folder; seconds, processor seconds and peak memory.

    Raises:
        RuntimeError: If it fails.
    """
    command = [sys.executable, "-m", "resdepth_colmap", "--quiet", *arguments]
    start = time.perf_counter()
    with tempfile.TemporaryFile() as output:
        process = subprocess.Popen(command, cwd=folder, stdout=output, stderr=output)
        _, status, usage = os.wait4(process.pid, 0)
        seconds = time.perf_counter() - start
        if status:
            output.seek(0)
            raise RuntimeError(f"{' '.join(arguments)}: {output.read().decode()}")
    return {
        "seconds": seconds,
        "cpu_seconds": usage.ru_utime + usage.ru_stime,
        "peak_memory_mb": usage.ru_maxrss / 1024,
    }


def main() -> None:
    """Run each command once, and write down what it took."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=DATA, help="the real data")
    parser.add_argument("--output", type=Path, default=RESULT)
    arguments = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as name:
        for scene in ("middlebury", "eth3d_cloud_cases", "rendered_weak", "plant"):
            shutil.copytree(arguments.data / scene, Path(name) / scene)
        for what, words in command_lines(Path(name)):
            row = measured(words, Path(name))
            rows.append({"command": " ".join(words), "what": what, **row})
            print(f"{rows[-1]['command']}: {row['seconds']:.1f} s", flush=True)
    record = {
        "command": "python -m scripts.benchmarks.commands",
        "date": datetime.date.today().isoformat(),
        "commands": rows,
    }
    arguments.output.write_text(json.dumps(record, indent=2) + "\n")


if __name__ == "__main__":
    main()
