"""Measure the network on rendered rooms that it was not trained on.

    python -m scripts.benchmarks.held_out [--rooms build/held_out]
        [--like-colmap] [OPTIONS OF `evaluate depth`]

Renders rooms with seeds that no training has used, matches all views in both passes,
unfiltered, and runs `resdepth-colmap evaluate depth` on them. Rooms that exist are
kept. Writes docs/measurements/held_out.json unless --output names another file.
--like-colmap matches the same rooms in one pass without smoothness, which leaves maps
more like COLMAP's unfiltered ones, and writes held_out_like_colmap.json.
"""

import argparse
import dataclasses
import subprocess
import sys
from pathlib import Path

from scripts.benchmarks.program import evaluate_depth
from scripts.benchmarks.record import BUILD, REPOSITORY

FIRST_SEED = 9000
NUM_ROOMS = 20


def main() -> None:
    """Make the rooms and run the command; the last --output wins."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rooms", type=Path, default=BUILD / "held_out")
    parser.add_argument("--like-colmap", action="store_true")
    arguments, options = parser.parse_known_args()
    rooms: Path = arguments.rooms.resolve()
    maker = [sys.executable, "-m", "scripts.make_training_data", str(rooms)]
    seeds = ["--first-seed", str(FIRST_SEED), "--num-scenes", str(NUM_ROOMS)]
    subprocess.run([*maker, *seeds], check=True, cwd=REPOSITORY)
    if arguments.like_colmap:
        evaluate_depth(matched_like_colmap(rooms), "held_out_like_colmap", options)
    else:
        evaluate_depth(rooms, "held_out", options)


def matched_like_colmap(rooms: Path) -> Path:
    """A folder beside the rooms: the same, but with maps like COLMAP's unfiltered."""
    from scripts.benchmarks.matching.matched_workspace import matched_workspace
    from scripts.benchmarks.matching.passes import AUTO, FIRST

    folder = rooms.with_name(f"{rooms.name}_like_colmap")
    for room in sorted(rooms.glob("room_*")):
        copy = matched_workspace(room, folder / room.name)
        images = {view.name: AUTO for view in copy.scene.views}
        copy.match("photometric", images, dataclasses.replace(FIRST, smoothness=0.0))
    return folder


if __name__ == "__main__":
    main()
