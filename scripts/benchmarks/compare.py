"""Run `resdepth-colmap compare` on real workspaces and rendered rooms.

    python -m scripts.benchmarks.compare --output /somewhere [--only plant room_1 ...]

The whole road: real workspaces are refined and compared; rooms are rendered, matched by
us (photometric maps, then filtered geometric ones), refined and compared. All of it
lies below --output; what is there is not made again. Each command is a process of its
own, whose seconds and memory are counted. The figures go to
docs/measurements/compare.json; then
`python -m scripts.benchmarks.make_tables`. Small rooms for a trial:
 --width 160 --height 120 --views 3 --only room_1 --result /tmp/compare.json.
"""

import argparse
import datetime
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).resolve().parents[2]
RESULT = REPOSITORY / "docs" / "measurements" / "compare.json"
DATA = Path(os.environ.get("RESDEPTH_DATA", REPOSITORY.parent / "shared" / "data"))
CACHE = Path.home() / ".cache" / "resdepth-colmap" / "bench_compare"

REAL = ("meeting_room", "plant")
ROOMS = {"room_1": 910_001, "room_2": 910_002, "room_3": 910_003}
"""Seeds that no training room has."""

Cost = dict[str, float]


def run(*words: object) -> Cost:
    """Run `resdepth-colmap`, and count its wall seconds and peak memory.

    This script stays small on purpose: a child begins with its parent's memory count.

    Raises:
        RuntimeError: If the command fails.
    """
    program = Path(sys.executable).parent / "resdepth-colmap"
    command = [str(program), *map(str, words)]
    print("$", " ".join(command[1:]), flush=True)
    start = time.perf_counter()
    child = subprocess.Popen(command)
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise RuntimeError(f"{' '.join(command)}: exit code {child.returncode}.")
    unit = 1024**2 if sys.platform == "darwin" else 1024
    return {
        "seconds": round(time.perf_counter() - start, 1),
        "peak_memory_mb": round(usage.ru_maxrss / unit, 1),
    }


def room(name: str, arguments: argparse.Namespace) -> Path:
    """A rendered room, rendered only once."""
    size = f"{arguments.width}x{arguments.height}-{arguments.views}"
    folder = arguments.output / size
    path: Path = folder / f"room_{ROOMS[name]:06d}"
    if not path.is_dir():
        numbers = {
            "--num-views": arguments.views,
            "--width-px": arguments.width,
            "--height-px": arguments.height,
            "--seed": ROOMS[name],
        }
        options = [word for option in numbers.items() for word in option]
        run("synthesize", folder, "--num-scenes", 1, *options)
    return path


def real(name: str, arguments: argparse.Namespace) -> Path:
    """A copy of a real workspace: nothing is written into the data."""
    path: Path = arguments.output / name
    if not path.is_dir():
        shutil.copytree(arguments.data / name, path)
    return path


def measure(name: str, arguments: argparse.Namespace) -> dict[str, Any]:
    """Match a room, refine the workspace, compare its maps; what was found, and cost.

    A matching that an earlier run has finished is not done again; its cost is kept.
    """
    is_room = name in ROOMS
    path = room(name, arguments) if is_room else real(name, arguments)
    cost_path, cost = path / "bench_cost.json", {}
    if is_room:
        if not cost_path.is_file():
            cost_path.write_text(json.dumps(run("stereo", path)), "utf-8")
        cost["stereo"] = json.loads(cost_path.read_text("utf-8"))
    weights = ["--weights", arguments.weights] if arguments.weights else []
    cost["refine"] = run(
        "refine", path, "--no-fuse", "--no-pictures", "--overwrite", *weights
    )
    found_path = path / "compare.json"
    cost["compare"] = run("compare", path, "--output", found_path)
    report = json.loads(found_path.read_text("utf-8"))
    found: dict[str, Any] = report["workspaces"][path.name]
    del found["per_view"]  # long, and in no table
    return {**found, "cost": cost, "weights_sha256": weights_of(path)}


def weights_of(path: Path) -> str:
    """Hash of the weights that the maps of a workspace were refined with."""
    record = json.loads((path / "resdepth" / "run.json").read_text("utf-8"))
    return str(record["weights_sha256"])


def main() -> None:
    """Read the command line, measure case by case, write after each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=DATA, help="the real data")
    parser.add_argument("--output", type=Path, default=CACHE, help="of the workspaces")
    parser.add_argument("--result", type=Path, default=RESULT, help="of the figures")
    samples = [*REAL, *ROOMS]
    parser.add_argument("--only", nargs="*", choices=samples, default=samples)
    parser.add_argument("--weights", type=Path)
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--height", type=int, default=480)
    parser.add_argument("--views", type=int, default=8)
    arguments = parser.parse_args()
    results: dict[str, Any] = {}
    for name in arguments.only:
        results[name] = measure(name, arguments)
        measured = {
            "command": "python -m scripts.benchmarks.compare",
            "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
            "weights_sha256": results[name]["weights_sha256"],
            "rooms": {
                "seeds": ROOMS,
                "size_px": [arguments.width, arguments.height],
                "views": arguments.views,
            },
            "results": results,
        }
        arguments.result.parent.mkdir(parents=True, exist_ok=True)
        arguments.result.write_text(json.dumps(measured, indent=2) + "\n", "utf-8")
    print(arguments.result)


if __name__ == "__main__":
    main()
