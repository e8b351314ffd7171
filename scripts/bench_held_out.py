"""Measure the network on rendered rooms that it was not trained on.

    python scripts/bench_held_out.py [--rooms build/held_out] [OPTIONS OF
        `resdepth-colmap evaluate depth`]

Rooms of `make_training_data.py` whose seeds no training has used, matched in both
passes. Rooms that are there are kept. The figures go to
docs/measurements/held_out.json unless --output names another file; then
`python scripts/make_tables.py` puts them into the documents.
"""

import argparse
import os
import shutil
from pathlib import Path

from make_training_data import make_room

from resdepth_colmap.cli.main import main
from resdepth_colmap.errors import WorkspaceError

REPOSITORY = Path(__file__).resolve().parents[1]
RESULT = REPOSITORY / "docs" / "measurements" / "held_out.json"
FIRST_SEED = 9000
NUM_ROOMS = 20


def run() -> None:
    """Make the rooms and run the command; the last --output wins."""
    parser = argparse.ArgumentParser(description=__doc__, add_help=False)
    parser.add_argument("--rooms", type=Path, default=REPOSITORY / "build" / "held_out")
    arguments, options = parser.parse_known_args()
    for seed in range(FIRST_SEED, FIRST_SEED + NUM_ROOMS):
        room = arguments.rooms / f"room_{seed:06}"
        if (room / "stereo" / "resdepth-stereo.json").is_file():
            continue
        try:
            print(make_room(arguments.rooms, seed), flush=True)
        except WorkspaceError as error:  # its views see nothing in common
            print(f"{room.name} is left out: {error}", flush=True)
            shutil.rmtree(room)
    command = ["evaluate", "depth", str(arguments.rooms), "--output", str(RESULT)]
    main([*command, *options], prog_name="resdepth-colmap")


if __name__ == "__main__":
    os.environ.setdefault("NUMBA_NUM_THREADS", "1")
    run()
