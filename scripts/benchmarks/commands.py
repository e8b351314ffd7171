"""Measure the time and memory of each command on small real workspaces.

    python -m scripts.benchmarks.commands [--data DATA] [--output FILE]

Each command runs once in a process, on copies of the data. Writes
docs/measurements/commands.json.
"""

import shutil
import tempfile
from pathlib import Path

from scripts.benchmarks.program import run
from scripts.benchmarks.record import parser, stamp, write

SCENES = ("middlebury", "eth3d_cloud_cases", "rendered_weak", "plant")


def command_lines(data: Path) -> list[tuple[str, list[str]]]:
    """The commands in the order in which they run, and what each runs on."""
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


def main() -> None:
    """Read the command line, run each command, write."""
    arguments = parser(__doc__, "commands").parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for scene in SCENES:
            shutil.copytree(arguments.data / scene, folder / scene)
        for what, words in command_lines(folder):
            cost = run("--quiet", *words, folder=folder, quiet=True)
            rows.append({"command": " ".join(words), "what": what, **cost})
    write(arguments.output, {**stamp("commands"), "commands": rows})


if __name__ == "__main__":
    main()
