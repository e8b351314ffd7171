"""Measure how long the refinement of one view takes, by its size.

    python -m scripts.benchmarks.refine [--weights FILE] [--passes 2]

Random texture and random depth: the time depends on neither. Writes
docs/measurements/refine.json.
"""

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
from scripts.benchmarks.record import parser, stamp, write

SIZES_PX = ((704, 496), (1632, 1224))  # 0.35 and 2 megapixels
NUM_REPETITIONS = 3
NUM_THREADS = 2


def random_view(width_px: int, height_px: int) -> ViewInputs:
    """A view with one source beside it, of random texture and depth."""
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
        "s_per_mp_and_inner_iteration": round(
            median_s / megapixels / config.inner_iterations, 3
        ),
    }


def main() -> None:
    """Read the command line, measure size by size and write."""
    options = parser(__doc__, "refine", reads_data=False)
    options.add_argument("--weights", type=Path)
    options.add_argument("--passes", type=int, default=RefineConfig.inner_iterations)
    arguments = options.parse_args()
    torch.set_num_threads(NUM_THREADS)
    config = RefineConfig(inner_iterations=arguments.passes, weights=arguments.weights)
    network = for_inference(load_weights(config.weights))
    is_default = config.inner_iterations == RefineConfig.inner_iterations
    command = "refine" if is_default else f"refine --passes {config.inner_iterations}"
    measured = {
        **stamp(command),
        "weights_sha256": weights_hash(config.weights),
        "options": {
            "inner_iterations": config.inner_iterations,
            "threads": NUM_THREADS,
        },
        "sizes": [measure(*size, network, config) for size in SIZES_PX],
    }
    write(arguments.output, measured)


if __name__ == "__main__":
    main()
