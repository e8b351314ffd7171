"""Draw what the refinement does to real scenes: strips to look at, not to publish.

    python -m scripts.benchmarks.make_strips strips/ [SCENE ...] [--cache matched/]

Photo, initial and refined depth, what changed and, where the truth is known, the errors
before and after. Without scenes: those of Middlebury, and meeting_room, of
RESDEPTH_DATA. Middlebury's images are for research only: the strips show them, so they
are not in the repository. The cache is that of `resdepth-colmap evaluate depth`.
"""

import argparse
import logging
import os
from pathlib import Path

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.evaluation.depth.match_cache import MatchCache
from scripts.benchmarks.scene_strips import scene_strips, scenes_at

REPOSITORY = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("RESDEPTH_DATA", REPOSITORY.parent / "shared" / "data"))
SCENES = [DATA / "middlebury", DATA / "meeting_room"]


def main() -> None:
    """Read the command line and draw one scene after the other."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", type=Path, help="folder of the strips")
    parser.add_argument("scenes", type=Path, nargs="*", help="workspaces, or folders")
    parser.add_argument("--cache", type=Path, help="folder of matched depth")
    parser.add_argument(
        "--weights", type=Path, help="those of the package, if not given"
    )
    parser.add_argument("--passes", type=int, default=RefineConfig.inner_iterations)
    arguments = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    cache = MatchCache(folder=arguments.cache or arguments.output / "matched")
    config = RefineConfig(weights=arguments.weights, inner_iterations=arguments.passes)
    for path in arguments.scenes or SCENES:
        for scene in scenes_at(path):
            for strip in scene_strips(scene, arguments.output, cache, config):
                print(strip, flush=True)


if __name__ == "__main__":
    main()
