"""Train the paper's variants, and additions to them, with equal budgets.

    python -m scripts.make_training_data rooms --num-scenes 90
    python -m scripts.benchmarks.variants rooms/ --watch middlebury/
        --work build/variants

The networks are the paper's, narrower, with its plain L1 loss and a learning rate that
fits the budget. Inverse depth is divided by its spread, as the paper's ablation study
divides heights by their standard deviation. Each view counts with the map that a
refinement starts from; a scene without maps is matched in a copy. No update gating.
Held-out scenes share no view with the training. An interrupted run resumes. Writes
docs/measurements/variants.json and additions.json.
"""

import argparse
import dataclasses
import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from resdepth_colmap.network.network_config import NetworkConfig, Normalisation
from resdepth_colmap.training.config import Preset, Schedule, TrainConfig
from resdepth_colmap.training.data.labelled_views import labelled_views
from resdepth_colmap.training.data.scenes import check_apart, find_scenes, split_scenes
from scripts.benchmarks.record import MEASUREMENTS, stamp, write
from scripts.benchmarks.variants.errors import method_errors, method_summaries
from scripts.benchmarks.variants.methods import (
    Budget,
    Methods,
    Trainer,
    added_methods,
    paper_methods,
)
from scripts.benchmarks.variants.scenes import lean_copies

PARTS = {
    "variants": (paper_methods, Normalisation.ROBUST),
    "additions": (added_methods, Normalisation.BASELINE),
}


def measure(scenes: Sequence[Path], methods: Methods) -> dict[str, Any]:
    """Errors of each method on each view, and their means."""
    errors = {}
    for view in (view for scene in scenes for view in labelled_views(scene)):
        loaded = view.load(num_sources=1)
        if loaded is None:
            continue
        refined = {
            key: method.refined(loaded.inputs) for key, method in methods.items()
        }
        errors[view.name] = method_errors(loaded.inputs.depth, refined, loaded.truth)
    return {
        "num_scenes": len(scenes),
        "num_views": len(errors),
        "methods": method_summaries(errors),
    }


def parsed() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", type=Path, nargs="+")
    parser.add_argument("--watch", type=Path, nargs="*", default=[])
    parser.add_argument("--work", type=Path, required=True, help="weights and samples")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--steps", type=int, default=400)
    parser.add_argument("--width", type=int, default=8, help="base channels")
    parser.add_argument("--levels", type=int, default=NetworkConfig.levels)
    parser.add_argument("--crop-px", type=int, default=256)
    parser.add_argument("--learning-rate", type=float, default=1e-3)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--held-out", type=float, default=0.15, help="share of scenes")
    parser.add_argument("--output", type=Path, default=MEASUREMENTS, help="folder")
    return parser.parse_args()


def budget_of(arguments: argparse.Namespace) -> Budget:
    """The paper's network and training, at the size that is asked for."""
    network = dataclasses.replace(
        NetworkConfig.paper(),
        base_channels=arguments.width,
        max_channels=8 * arguments.width,
        levels=arguments.levels,
    )
    changes = {
        "steps": arguments.steps,
        "crop_px": arguments.crop_px,
        "learning_rate": arguments.learning_rate,
        "schedule": Schedule.ONE_CYCLE,
        "seed": arguments.seed,
        "holes_share": 0.0,
        "validation_share": 0.0,
        "tensorboard": False,
        "samples": arguments.work / "samples",
    }
    return Budget(network, TrainConfig.of(Preset.PAPER, changes))


def main() -> None:
    """Read the command line, train, measure and write part by part."""
    arguments = parsed()
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    budget, work = budget_of(arguments), arguments.work
    scenes, watched = find_scenes(arguments.scenes), find_scenes(arguments.watch)
    check_apart(scenes, watched)
    split = split_scenes(lean_copies(scenes, work / "scenes"), arguments.held_out)
    sets = {
        "rendered": split.held_out,
        "middlebury": lean_copies(watched, work / "watched"),
    }
    for part in arguments.parts:
        make_methods, normalisation = PARTS[part]
        network = dataclasses.replace(budget.network, normalisation=normalisation)
        budget = budget._replace(network=network)
        methods = make_methods(Trainer(split.training, work, budget))
        measured = {
            **stamp("variants"),
            "num_scenes": len(split.training),
            "steps": arguments.steps,
            "network": budget.network.to_mapping(),
            "training": {**budget.training.to_mapping(), "samples": None},
            "sets": {
                key: measure(paths, methods) for key, paths in sets.items() if paths
            },
        }
        write(arguments.output / f"{part}.json", measured)


if __name__ == "__main__":
    main()
