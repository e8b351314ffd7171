"""Measure how long the refinement of one view takes, by its size.

    python -m scripts.benchmarks.refine [--weights FILE] [--passes 2]

Random texture and random depth: the time depends on neither. Writes the figures to
docs/measurements/refine.json; then
`python -m scripts.benchmarks.make_tables` puts them into the documents.
"""

import argparse
import datetime
import json
import statistics
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.network.inference import for_inference
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.network.weights import load_weights, weights_hash
from resdepth_colmap.pipeline.refine.view import SourceView, ViewInputs, refine_view
from resdepth_colmap.versions import versions
from scripts.benchmarks.tables.documents import refine_table

REPOSITORY = Path(__file__).resolve().parents[2]
RESULT = REPOSITORY / "docs" / "measurements" / "refine.json"
SIZES_PX = ((704, 496), (1632, 1224))  # 0.35 and 2 megapixels
NUM_REPETITIONS = 3
NUM_THREADS = 2


def random_view(width_px: int, height_px: int) -> ViewInputs:
    """A view with one source aside, of random texture and depth."""
    rng = np.random.default_rng(0)
    images = rng.random((2, height_px, width_px), dtype=np.float32)
    depth = (2 + 2 * rng.random((height_px, width_px))).astype(np.float32)
    K = np.array([[width_px, 0, width_px / 2], [0, width_px, height_px / 2], [0, 0, 1]])
    pose = np.eye(3, 4)
    pose[0, 3] = -0.2
    source = SourceView(gray=images[1], K=K, source_from_reference=pose)
    return ViewInputs(depth=depth, gray=images[0], K=K, sources=(source,))


def measure(
    width_px: int, height_px: int, network: ResDepthNet, config: RefineConfig
) -> dict[str, Any]:
    """Refine a view several times, and once before for memory and caches to settle."""
    view = random_view(width_px, height_px)
    seconds = []
    for _ in range(1 + NUM_REPETITIONS):
        start = time.perf_counter()
        refine_view(view, network, config)
        seconds.append(round(time.perf_counter() - start, 3))
    megapixels = width_px * height_px / 1e6
    median_s = statistics.median(seconds[1:])
    return {
        "width_px": width_px,
        "height_px": height_px,
        "megapixels": round(megapixels, 3),
        "seconds": seconds[1:],
        "s_per_mp_and_pass": round(median_s / megapixels / config.inner_iterations, 3),
    }


def main() -> None:
    """Read the command line, measure size by size, print and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--weights", type=Path)
    parser.add_argument("--passes", type=int, default=RefineConfig.inner_iterations)
    parser.add_argument("--output", type=Path, default=RESULT)
    arguments = parser.parse_args()
    torch.set_num_threads(NUM_THREADS)
    config = RefineConfig(inner_iterations=arguments.passes, weights=arguments.weights)
    network = for_inference(load_weights(config.weights))
    measured = {
        "command": "python -m scripts.benchmarks.refine",
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "weights_sha256": weights_hash(config.weights),
        "options": {
            "inner_iterations": config.inner_iterations,
            "threads": NUM_THREADS,
        },
        "versions": versions(),
        "sizes": [measure(*size, network, config) for size in SIZES_PX],
    }
    if config.inner_iterations != RefineConfig.inner_iterations:
        measured["command"] = (
            f"{measured['command']} --passes {config.inner_iterations}"
        )
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    arguments.output.write_text(json.dumps(measured, indent=2) + "\n", "utf-8")
    print(refine_table(measured))


if __name__ == "__main__":
    main()
