"""Measure matcher and network on the two-view scenes of Middlebury.

    python scripts/bench_middlebury.py [OPTIONS OF `resdepth-colmap evaluate depth`]

It is that command on the folder middlebury/ of RESDEPTH_DATA, and writes the figures to
docs/measurements/middlebury.json unless --output names another file; then
`python scripts/make_tables.py` puts them into the documents.
"""

import os
import sys
from pathlib import Path

from resdepth_colmap.cli.main import main

REPOSITORY = Path(__file__).resolve().parents[1]
RESULT = REPOSITORY / "docs" / "measurements" / "middlebury.json"


def run() -> None:
    """Run the command; the last --output wins."""
    default = REPOSITORY.parent / "shared" / "data"
    scenes = Path(os.environ.get("RESDEPTH_DATA", default)) / "middlebury"
    command = ["evaluate", "depth", str(scenes), "--output", str(RESULT)]
    main([*command, *sys.argv[1:]], prog_name="resdepth-colmap")


if __name__ == "__main__":
    run()
