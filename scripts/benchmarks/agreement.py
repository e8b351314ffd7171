"""Measure how near COLMAP's unfiltered maps are to its filtered ones, and ours to them.

    python -m scripts.benchmarks.agreement

Refines a copy of the workspace plant/ of RESDEPTH_DATA from its photometric maps, which
have no holes, and compares the maps before and after with COLMAP's geometric ones where
its filter has left a depth. Writes docs/measurements/agreement.json.
"""

import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.io.colmap.maps import read_depth_map
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.network.weights import weights_hash
from resdepth_colmap.pipeline.refine.stage import refine_workspace
from resdepth_colmap.scene import DepthMap
from scripts.benchmarks.record import parser, rounded, stamp, write

LIMITS = {"within_1": 0.01, "within_2": 0.02, "within_5": 0.05}
UNFILTERED, FILTERED = "photometric", "geometric"


def agreement(depth: DepthMap, expected: DepthMap) -> dict[str, float]:
    """Shares of the expected depths that a map has, within each limit.

    Args:
        depth: Shape (H, W), in units; 0 = no depth.
        expected: Likewise; where it is 0 no pixel counts.
    """
    known = expected > 0
    change = np.abs(depth - expected)[known] / expected[known]
    return {name: float(np.mean(change < limit)) for name, limit in LIMITS.items()}


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
            "known": float(np.mean(expected > 0)),
            "unfiltered": agreement(before, expected),
            "refined": agreement(after, expected),
        }
    return images


def main() -> None:
    """Read the command line, measure and write."""
    options = parser(__doc__, "agreement")
    options.add_argument("--weights", type=Path, help="others than the shipped ones")
    arguments = options.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "plant"
        shutil.copytree(
            arguments.data / "plant",
            copy,
            copy_function=lambda source, target: Path(target).symlink_to(source),
        )
        images = measure(copy, arguments.weights)
    measured = {
        **stamp("agreement"),
        "weights_sha256": weights_hash(arguments.weights),
        "images": rounded(images, 4),
    }
    write(arguments.output, measured)


if __name__ == "__main__":
    main()
