"""Train the paper's variants with equal budgets, and compare them.

    python scripts/bench_variants.py rooms/ --watch middlebury/ --work build/variants

Unfiltered PatchMatch, its 5 x 5 median, Unet-stereo (images only), ResDepth-0, -mono,
-stereo and -stereo_iter (paper, section "Network Variants"): the paper's networks,
narrower, and its plain L1 loss, with a learning rate that fits the budget. Only
unfiltered maps are learnt from, and no rule is applied after a network. Scenes are held
out as a whole. Goes on where it stopped. The figures go to
docs/measurements/variants.json; then `python scripts/make_tables.py` puts them into the
documents.
"""

import argparse
import dataclasses
import datetime
import json
import logging
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.evaluation.depth_metrics import depth_metrics, median_filtered
from resdepth_colmap.evaluation.tables import HARDWARE
from resdepth_colmap.evaluation.variant_tables import variants_table
from resdepth_colmap.io.depth_map import write_depth_map
from resdepth_colmap.network.network_config import (
    InputVariant,
    NetworkConfig,
    Normalisation,
)
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.network.weights import load_weights
from resdepth_colmap.pipeline.refine import ViewInputs, refine_view
from resdepth_colmap.pipeline.versions import versions
from resdepth_colmap.scene import DepthMap
from resdepth_colmap.training.labelled_views import LabelledView, labelled_views
from resdepth_colmap.training.loop import train
from resdepth_colmap.training.scenes import check_apart, find_scenes, split_scenes
from resdepth_colmap.training.train_config import Preset, Schedule, TrainConfig

REPOSITORY = Path(__file__).resolve().parents[1]
RESULT = REPOSITORY / "docs" / "measurements" / "variants.json"
VARIANTS = {
    "unet_stereo": InputVariant.IMAGES_ONLY,
    "resdepth_0": InputVariant.DEPTH_ONLY,
    "resdepth_mono": InputVariant.MONO,
    "resdepth_stereo": InputVariant.STEREO,
}
ITERATED = "resdepth_stereo_iter"
MEASURES = ("mae", "rmse", "medae", "bad_2")
REFINED_KIND = "refined"

# The networks by themselves.
REFINING = RefineConfig(passes=1, keep_confirmed=False)


class Budget(NamedTuple):
    """What each variant gets."""

    network: NetworkConfig
    training: TrainConfig


def refined_by(networks: Sequence[ResDepthNet], view: ViewInputs) -> DepthMap:
    """Depth after one network after the other; each warps with what it gets."""
    for network in networks:
        depth = refine_view(view, network, REFINING).depth
        view = dataclasses.replace(view, depth=depth)
    return view.depth


def train_variant(
    name: str, variant: InputVariant, scenes: Sequence[Path], work: Path, budget: Budget
) -> ResDepthNet:
    """Train one variant, or take what an earlier call has trained."""
    print(f"training {name}", flush=True)
    network = dataclasses.replace(budget.network, variant=variant)
    return load_weights(train(scenes, work / name, network, budget.training))


def refined_copies(
    scenes: Sequence[Path], network: ResDepthNet, folder: Path
) -> list[Path]:
    """Workspaces that share all with these, but whose depth maps are refined."""
    copies = []
    for scene in scenes:
        copy = folder / scene.name
        copies.append(copy)
        if (copy / "stereo").is_dir():
            continue
        copy.mkdir(parents=True, exist_ok=True)
        for part in ("images", "sparse", "ground_truth"):
            (copy / part).unlink(missing_ok=True)
            (copy / part).symlink_to((scene / part).resolve())
        partial = copy / "partial" / "depth_maps"
        shutil.rmtree(partial.parent, ignore_errors=True)
        for view in unfiltered(scene):
            loaded = view.load(network.config.num_sources)
            if loaded is not None:
                depth = refined_by([network], loaded.inputs)
                path = partial / f"{view.image_name}.{REFINED_KIND}.bin"
                write_depth_map(path, depth)
        partial.mkdir(parents=True, exist_ok=True)
        partial.parent.rename(copy / "stereo")
    return copies


def unfiltered(scene: Path) -> list[LabelledView]:
    """The views of a scene with their photometric maps."""
    return [view for view in labelled_views(scene) if view.kind == "photometric"]


def measure(
    scenes: Sequence[Path], arms: dict[str, list[ResDepthNet]]
) -> dict[str, Any]:
    """Errors of each arm on each view, and their means."""
    errors: dict[str, dict[str, dict[str, float]]] = {}
    for view in (view for scene in scenes for view in unfiltered(scene)):
        loaded = view.load(num_sources=1)
        if loaded is None:
            continue
        depth = loaded.inputs.depth
        maps = {"unfiltered": depth, "median": median_filtered(depth)}
        maps |= {name: refined_by(nets, loaded.inputs) for name, nets in arms.items()}
        for name, values in maps.items():
            metrics = depth_metrics(values, loaded.truth).to_mapping()
            kept = {key: round(metrics[key] or 0.0, 6) for key in MEASURES}
            errors.setdefault(name, {})[view.name] = kept
        print(f"measured {view.name}", flush=True)
    return {
        "num_views": len(next(iter(errors.values()), {})),
        "arms": {name: _summary(errors[name], errors["unfiltered"]) for name in errors},
    }


def _summary(
    views: dict[str, dict[str, float]], initial: dict[str, dict[str, float]]
) -> dict[str, Any]:
    means = {key: _mean([view[key] for view in views.values()]) for key in MEASURES}
    ratios = {
        f"{key}_ratio": _mean(
            [views[name][key] / initial[name][key] for name in views if initial[name]]
        )
        for key in ("mae", "medae")
    }
    return {**means, **ratios, "views": {n: v["mae"] for n, v in views.items()}}


def _mean(values: list[float]) -> float:
    return round(sum(values) / len(values), 6)


def train_all(scenes: Sequence[Path], work: Path, budget: Budget) -> dict[str, Any]:
    """All variants; of each arm the networks that are applied one after the other."""
    arms = {
        name: [train_variant(name, variant, scenes, work, budget)]
        for name, variant in VARIANTS.items()
    }
    (stereo,) = arms["resdepth_stereo"]
    copies = refined_copies(scenes, stereo, work / "refined_scenes")
    variant = InputVariant.STEREO
    again = train_variant(ITERATED, variant, copies, work, budget)
    return {**arms, ITERATED: [stereo, again]}


def parsed() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", type=Path, nargs="+")
    parser.add_argument("--watch", type=Path, nargs="*", default=[])
    parser.add_argument("--work", type=Path, required=True, help="weights and samples")
    parser.add_argument("--steps", type=int, default=3000)
    parser.add_argument("--width", type=int, default=16, help="base channels")
    kinds = [str(kind) for kind in Normalisation]
    parser.add_argument("--normalisation", choices=kinds, default="baseline")
    parser.add_argument("--levels", type=int, default=NetworkConfig.levels)
    parser.add_argument("--crop-px", type=int, default=TrainConfig.crop_px)
    parser.add_argument("--learning-rate", type=float, default=1e-3)
    parser.add_argument("--held-out", type=float, default=0.1, help="share of scenes")
    parser.add_argument("--hardware", default=HARDWARE)
    parser.add_argument("--output", type=Path, default=RESULT)
    return parser.parse_args()


def main() -> None:
    """Read the command line, train, measure, print and write."""
    arguments = parsed()
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    budget = Budget(
        network=dataclasses.replace(
            NetworkConfig.paper(),
            base_channels=arguments.width,
            max_channels=8 * arguments.width,
            levels=arguments.levels,
            normalisation=arguments.normalisation,
        ),
        training=TrainConfig.of(
            Preset.PAPER,
            {
                "steps": arguments.steps,
                "crop_px": arguments.crop_px,
                "learning_rate": arguments.learning_rate,
                "schedule": Schedule.ONE_CYCLE,
                "holes_share": 0.0,
                "validation_share": 0.0,
                "tensorboard": False,
                "samples": arguments.work / "samples",
            },
        ),
    )
    scenes, watched = find_scenes(arguments.scenes), find_scenes(arguments.watch)
    check_apart(scenes, watched)
    split = split_scenes(scenes, arguments.held_out)
    arms = train_all(split.training, arguments.work, budget)
    sets = {"rendered": split.held_out, "middlebury": watched}
    measured = {
        "command": "python scripts/bench_variants.py",
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "hardware": arguments.hardware,
        "versions": versions(),
        "num_scenes": len(split.training),
        "steps": arguments.steps,
        "network": budget.network.to_mapping(),
        "training": {**budget.training.to_mapping(), "samples": None},
        "sets": {name: measure(paths, arms) for name, paths in sets.items() if paths},
    }
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    arguments.output.write_text(json.dumps(measured, indent=2) + "\n", "utf-8")
    print(variants_table(measured))


if __name__ == "__main__":
    main()
