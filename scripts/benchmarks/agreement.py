"""Measure whether refining COLMAP's unfiltered maps leads towards its filtered ones.

    python -m scripts.benchmarks.agreement

Refines a copy of the workspace plant/ of RESDEPTH_DATA from its photometric maps, which
are whole, and compares maps before and after with COLMAP's geometric ones where their
filter has left a depth. The figures go to docs/measurements/agreement.json; then
`python -m scripts.benchmarks.make_tables` puts them into the documents.
"""

import argparse
import datetime
import json
import os
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.io.colmap.depth_map import read_depth_map
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.network.weights import weights_hash
from resdepth_colmap.pipeline.refine.stage import refine_workspace
from resdepth_colmap.scene import DepthMap

REPOSITORY = Path(__file__).resolve().parents[2]
RESULT = REPOSITORY / "docs" / "measurements" / "agreement.json"
LIMITS = {"within_1": 0.01, "within_2": 0.02, "within_5": 0.05}
UNFILTERED, FILTERED = "photometric", "geometric"


def agreement(depth: DepthMap, expected: DepthMap) -> dict[str, float]:
    """The share of the expected depths that a map has, within each limit."""
    known = expected > 0
    change = np.abs(depth - expected)[known] / expected[known]
    return {name: round(float(np.mean(change < LIMITS[name])), 4) for name in LIMITS}


def measure(path: Path, weights: Path | None) -> dict[str, Any]:
    """Refine a workspace, and compare image by image."""
    workspace = open_workspace(path)
    config = RefineConfig(input=UNFILTERED, weights=weights)
    report = refine_workspace(workspace, config)
    images = {}
    for name in report.refined:
        expected = read_depth_map(workspace.depth_map_path(name, FILTERED))
        before = read_depth_map(workspace.depth_map_path(name, UNFILTERED))
        after = read_depth_map(report.output.depth_map_path(name))
        images[name] = {
            "known": round(float(np.mean(expected > 0)), 4),
            "unfiltered": agreement(before, expected),
            "refined": agreement(after, expected),
        }
    return images


def main() -> None:
    """Read the command line, measure and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    default = REPOSITORY.parent / "shared" / "data"
    data = Path(os.environ.get("RESDEPTH_DATA", default))
    parser.add_argument("--workspace", type=Path, default=data / "plant")
    parser.add_argument("--weights", type=Path, help="others than the shipped ones")
    parser.add_argument("--output", type=Path, default=RESULT)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "plant"
        shutil.copytree(
            arguments.workspace, copy, copy_function=lambda a, b: Path(b).symlink_to(a)
        )
        images = measure(copy, arguments.weights)
    measured = {
        "command": "python -m scripts.benchmarks.agreement",
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "weights_sha256": weights_hash(arguments.weights),
        "images": images,
    }
    arguments.output.write_text(json.dumps(measured, indent=2) + "\n", "utf-8")
    print(json.dumps(measured, indent=2))


if __name__ == "__main__":
    main()
