"""Measure the network on rendered rooms that it was not trained on.

    python scripts/bench_held_out.py [--rooms build/held_out] [OPTIONS OF
        `resdepth-colmap evaluate depth`]

Rooms of `make_training_data.py` whose seeds no training has used, matched in both
passes. Rooms that are there are kept. The figures go to
docs/measurements/held_out.json unless --output names another file; then
`python scripts/make_tables.py` puts them into the documents.
"""

import argparse
import subprocess
import sys
from pathlib import Path

from resdepth_colmap.cli.main import main

REPOSITORY = Path(__file__).resolve().parents[1]
RESULT = REPOSITORY / "docs" / "measurements" / "held_out.json"
FIRST_SEED = 9000
NUM_ROOMS = 20


def run() -> None:
    """Make the rooms and run the command; the last --output wins."""
    parser = argparse.ArgumentParser(description=__doc__, add_help=False)
    parser.add_argument("--rooms", type=Path, default=REPOSITORY / "build" / "held_out")
    arguments, options = parser.parse_known_args()
    maker = [sys.executable, str(REPOSITORY / "scripts" / "make_training_data.py")]
    seeds = ["--first-seed", str(FIRST_SEED), "--num-scenes", str(NUM_ROOMS)]
    subprocess.run([*maker, str(arguments.rooms), *seeds], check=True)
    command = ["evaluate", "depth", str(arguments.rooms), "--output", str(RESULT)]
    main([*command, *options], prog_name="resdepth-colmap")


if __name__ == "__main__":
    run()
