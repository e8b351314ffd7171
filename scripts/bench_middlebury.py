"""Measure matcher and network on the two-view scenes of Middlebury.

    python scripts/bench_middlebury.py [--weights FILE] [--passes 2] [--cache FOLDER]

Prints the table, and writes the figures to docs/measurements/middlebury.json; then
`python scripts/make_tables.py` puts them into the documents.
"""

import argparse
import json
import os
from pathlib import Path

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.evaluation.match_cache import MatchCache
from resdepth_colmap.evaluation.middlebury import SceneResult, measure_middlebury
from resdepth_colmap.evaluation.tables import middlebury_table

REPOSITORY = Path(__file__).resolve().parents[1]
RESULT = REPOSITORY / "docs" / "measurements" / "middlebury.json"


def show(scene: SceneResult) -> None:
    """Say that a scene is done."""
    print(f"{scene.name}: MAE ratio {scene.mae_ratio:.3f}", flush=True)


def main() -> None:
    """Read the command line, measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    default = REPOSITORY.parent / "shared" / "data"
    parser.add_argument(
        "--data", type=Path, default=os.environ.get("RESDEPTH_DATA", default)
    )
    parser.add_argument("--weights", type=Path)
    parser.add_argument("--passes", type=int, default=RefineConfig.passes)
    parser.add_argument("--no-keep-confirmed", action="store_true")
    parser.add_argument("--cache", type=Path, help="keeps matched depth maps")
    parser.add_argument("--output", type=Path, default=RESULT)
    arguments = parser.parse_args()
    report = measure_middlebury(
        Path(arguments.data) / "middlebury",
        RefineConfig(
            passes=arguments.passes,
            keep_confirmed=not arguments.no_keep_confirmed,
            weights=arguments.weights,
        ),
        cache=MatchCache(folder=arguments.cache) if arguments.cache else None,
        on_scene=show,
    )
    command = "python scripts/bench_middlebury.py"
    if arguments.passes != RefineConfig.passes:
        command += f" --passes {arguments.passes}"
    if arguments.no_keep_confirmed:
        command += " --no-keep-confirmed"
    measured = {"command": command, **report.to_mapping()}
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    arguments.output.write_text(json.dumps(measured, indent=2) + "\n", "utf-8")
    print(middlebury_table(measured))


if __name__ == "__main__":
    main()
