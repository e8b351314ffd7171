"""Measure how right the CPU PatchMatch is, and how fast.

    python -m scripts.benchmarks.matching.quality [--only PART ...]
        [--cache FOLDER] [--data FOLDER]

Parts: plant against COLMAP's own maps; middlebury and rendered against the truth; speed
on noise. Maps are made by the stage `stereo` with default options, in workspaces of
their own in the cache; finished ones are not made again while the matcher finds the
same (its METHOD). One thread matches; processor seconds are told, which other jobs
change little. Each part goes to docs/measurements/matching.json when it is done; then
`python -m scripts.benchmarks.make_tables` puts the figures into the documents.
"""

import argparse
import datetime
import json
import logging
import os
from pathlib import Path

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.matching.patch_match import METHOD
from resdepth_colmap.versions import versions
from scripts.benchmarks.matching.parts import PARTS
from scripts.benchmarks.matching.passes import Folders, rounded
from scripts.benchmarks.tables.matching import matching_table

REPOSITORY = Path(__file__).resolve().parents[3]
RESULT = REPOSITORY / "docs" / "measurements" / "matching.json"
DATA = Path(os.environ.get("RESDEPTH_DATA", REPOSITORY.parent / "shared" / "data"))
CACHE = REPOSITORY / "build" / "matching"


def main() -> None:
    """Read the command line, measure, write and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=PARTS, nargs="+", default=list(PARTS))
    parser.add_argument("--data", type=Path, default=DATA, help="the real data")
    parser.add_argument("--cache", type=Path, default=CACHE, help="maps are kept there")
    parser.add_argument("--output", type=Path, default=RESULT)
    arguments = parser.parse_args()
    output: Path = arguments.output
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    import numba

    from resdepth_colmap.matching.compilation import choose_threading_layer

    choose_threading_layer()
    numba.set_num_threads(1)
    folders = Folders(
        data=arguments.data,
        cache=arguments.cache / f"method_{METHOD}",
    )
    for name in arguments.only:
        measured = json.loads(output.read_text("utf-8")) if output.exists() else {}
        part = rounded(PARTS[name](folders))
        measured[name] = {"date": today(), "method": METHOD, **part}
        measured |= {
            "command": "python -m scripts.benchmarks.matching.quality",
            "date": today(),
            "versions": versions(),
            "options": StereoConfig().to_mapping(),
        }
        output.parent.mkdir(parents=True, exist_ok=True)
        output.write_text(json.dumps(measured, indent=2) + "\n", "utf-8")
    print(matching_table(json.loads(output.read_text("utf-8"))))


def today() -> str:
    """The date, as documents have it."""
    return datetime.datetime.now(datetime.UTC).date().isoformat()


if __name__ == "__main__":
    main()
