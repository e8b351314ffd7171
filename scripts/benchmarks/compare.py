"""Run `resdepth-colmap compare` on real workspaces and rendered rooms.

    python -m scripts.benchmarks.compare [--work FOLDER] [--only plant room_1 ...]

Refines and compares real workspaces; renders rooms, matches them on the CPU
(photometric maps, then filtered geometric ones), refines and compares them. Workspaces
lie below --work; a rendered and matched room is used again. Each command runs in a
process, whose seconds and memory are counted. Writes docs/measurements/compare.json
after each workspace. Small rooms for a trial:

    --width 160 --height 120 --views 3 --only room_1 --output /tmp/compare.json
"""

import argparse
import json
import shutil
from pathlib import Path
from typing import Any

from scripts.benchmarks.program import Cost, run
from scripts.benchmarks.record import BUILD, parser, stamp, write

REAL = ("meeting_room", "plant")
ROOMS = {"room_1": 910_001, "room_2": 910_002, "room_3": 910_003}
"""Seeds that no training room has."""


def room(name: str, arguments: argparse.Namespace) -> Path:
    """A rendered room; one that exists is kept."""
    size = f"{arguments.width}x{arguments.height}-{arguments.views}"
    folder = arguments.work / size
    path: Path = folder / f"room_{ROOMS[name]:06d}"
    if not path.is_dir():
        sizes = {
            "--num-views": arguments.views,
            "--width-px": arguments.width,
            "--height-px": arguments.height,
            "--seed": ROOMS[name],
        }
        options = [word for option in sizes.items() for word in option]
        run("synthesize", folder, "--num-scenes", 1, *options)
    return path


def real(name: str, arguments: argparse.Namespace) -> Path:
    """A copy of a real workspace: nothing is written into the data."""
    path: Path = arguments.work / name
    if not path.is_dir():
        shutil.copytree(arguments.data / name, path)
    return path


def measure(name: str, arguments: argparse.Namespace) -> dict[str, Any]:
    """Match a room, refine the workspace, compare its maps; the result and the cost.

    Maps that an earlier run has matched are kept, and so is their cost.
    """
    is_room = name in ROOMS
    path = room(name, arguments) if is_room else real(name, arguments)
    cost_path = path / "stereo_cost.json"
    cost: dict[str, Cost] = {}
    if is_room:
        if not cost_path.is_file():
            cost_path.write_text(json.dumps(run("stereo", path)), "utf-8")
        cost["stereo"] = json.loads(cost_path.read_text("utf-8"))
    weights = ["--weights", arguments.weights] if arguments.weights else []
    cost["refine"] = run(
        "refine", path, "--no-fuse", "--no-pictures", "--overwrite", *weights
    )
    report_path = path / "compare.json"
    cost["compare"] = run("compare", path, "--output", report_path)
    report = json.loads(report_path.read_text("utf-8"))
    result: dict[str, Any] = report["workspaces"][path.name]
    del result["per_view"]  # long, and in no table
    return {**result, "cost": cost, "weights_sha256": weights_of(path)}


def weights_of(path: Path) -> str:
    """Hash of the weights that the maps of a workspace were refined with."""
    record = json.loads((path / "resdepth" / "run.json").read_text("utf-8"))
    return str(record["weights_sha256"])


def main() -> None:
    """Read the command line, measure and write workspace by workspace."""
    options = parser(__doc__, "compare")
    samples = [*REAL, *ROOMS]
    options.add_argument("--work", type=Path, default=BUILD / "compare")
    options.add_argument("--only", nargs="*", choices=samples, default=samples)
    options.add_argument("--weights", type=Path)
    options.add_argument("--width", type=int, default=640)
    options.add_argument("--height", type=int, default=480)
    options.add_argument("--views", type=int, default=8)
    arguments = options.parse_args()
    results: dict[str, Any] = {}
    for name in arguments.only:
        results[name] = measure(name, arguments)
        measured = {
            **stamp("compare"),
            "weights_sha256": results[name]["weights_sha256"],
            "rooms": {
                "seeds": ROOMS,
                "size_px": [arguments.width, arguments.height],
                "views": arguments.views,
            },
            "results": results,
        }
        write(arguments.output, measured)


if __name__ == "__main__":
    main()
