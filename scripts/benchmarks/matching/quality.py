"""Measure how accurate and how fast the CPU PatchMatch is.

    python -m scripts.benchmarks.matching.quality [--only PART ...]
        [--cache FOLDER] [--data FOLDER]

Parts: plant against COLMAP's maps; middlebury and rendered against the truth; speed on
noise. The stage `stereo` makes the maps with default options, in workspaces below
--cache; maps that exist are kept until the method of the matcher changes (its METHOD).
One thread matches, and processor seconds are counted, which other jobs change little.
Writes docs/measurements/matching.json after each part.
"""

import logging
from pathlib import Path

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.matching.patch_match import METHOD
from scripts.benchmarks.matching.parts import PARTS
from scripts.benchmarks.matching.passes import Folders
from scripts.benchmarks.record import BUILD, parser, read, rounded, stamp, today, write


def main() -> None:
    """Read the command line, measure and write part by part."""
    options = parser(__doc__, "matching")
    options.add_argument("--only", choices=PARTS, nargs="+", default=list(PARTS))
    options.add_argument(
        "--cache", type=Path, default=BUILD / "matching", help="folder of the maps"
    )
    arguments = options.parse_args()
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    import numba

    from resdepth_colmap.matching.compilation import choose_threading_layer

    choose_threading_layer()
    numba.set_num_threads(1)
    folders = Folders(data=arguments.data, cache=arguments.cache / f"method_{METHOD}")
    for name in arguments.only:
        measured = read(arguments.output)
        part = rounded(PARTS[name](folders))
        measured[name] = {"date": today(), "method": METHOD, **part}
        measured |= {
            **stamp("matching.quality"),
            "options": StereoConfig().to_mapping(),
        }
        write(arguments.output, measured)


if __name__ == "__main__":
    main()
