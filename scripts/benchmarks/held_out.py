"""Measure the network on rendered rooms that it was not trained on.

    python -m scripts.benchmarks.held_out [--rooms build/held_out]
        [--like-colmap] [OPTIONS OF `resdepth-colmap evaluate depth`]

Rooms of `make_training_data.py` whose seeds no training has used, matched in both
passes. Rooms that are there are kept. The figures go to docs/measurements/held_out.json
unless --output names another file; then
`python -m scripts.benchmarks.make_tables` puts them into the documents. With
--like-colmap the same rooms are matched in one pass without
smoothness, which leaves maps more like COLMAP's unfiltered ones; that goes to
held_out_rough.json.
"""

import argparse
import dataclasses
import subprocess
import sys
from pathlib import Path

from resdepth_colmap.cli.main import main
from scripts.benchmarks.matching.matched_workspace import matched_workspace
from scripts.benchmarks.matching.passes import AUTO, FIRST

REPOSITORY = Path(__file__).resolve().parents[2]
MEASUREMENTS = REPOSITORY / "docs" / "measurements"
FIRST_SEED = 9000
NUM_ROOMS = 20
LIKE_COLMAP = dataclasses.replace(FIRST, smoothness=0.0)


def run() -> None:
    """Make the rooms and run the command; the last --output wins."""
    parser = argparse.ArgumentParser(description=__doc__, add_help=False)
    parser.add_argument("--rooms", type=Path, default=REPOSITORY / "build" / "held_out")
    parser.add_argument("--like-colmap", action="store_true")
    arguments, options = parser.parse_known_args()
    rooms: Path = arguments.rooms
    maker = [sys.executable, str(REPOSITORY / "scripts" / "make_training_data.py")]
    seeds = ["--first-seed", str(FIRST_SEED), "--num-scenes", str(NUM_ROOMS)]
    subprocess.run([*maker, str(rooms), *seeds], check=True)
    name = "held_out"
    if arguments.like_colmap:
        rooms, name = matched_like_colmap(rooms), "held_out_rough"
    command = ["evaluate", "depth", str(rooms)]
    command += ["--output", str(MEASUREMENTS / f"{name}.json"), *options]
    main(command, prog_name="resdepth-colmap")


def matched_like_colmap(rooms: Path) -> Path:
    """A folder beside the rooms: the same, but with maps like COLMAP's unfiltered."""
    folder = rooms.with_name(f"{rooms.name}_like_colmap")
    for room in sorted(rooms.glob("room_*")):
        copy = matched_workspace(room, folder / room.name)
        images = {view.name: AUTO for view in copy.scene.views}
        copy.match("photometric", images, LIKE_COLMAP)
    return folder


if __name__ == "__main__":
    run()
