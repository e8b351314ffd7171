"""Train the paper's variants, and what is beyond the paper, with equal budgets.

    python -m scripts.make_training_data rooms
    python -m scripts.benchmarks.variants rooms/ --watch middlebury/
        --work build/variants

The paper's part: unfiltered PatchMatch, its 5 x 5 median, Unet-stereo (images only),
ResDepth-0, -mono, -stereo and -stereo_iter (paper, section "Network Variants"): the
paper's networks, narrower, and its plain L1 loss, with a learning rate that fits the
budget and inverse depth over its spread, as the paper's ablation study divides heights
by their standard deviation. The part beyond the paper begins with a ResDepth-stereo on
inverse depth times the baseline, as in the paper's experiment on ETH3D, and adds one
thing after the other. Each view counts with the map that a
refinement starts from; a scene without maps is matched in a copy. No rule is applied
after a network. Scenes are held out as a whole. Goes on where it stopped. Each part's
figures go to docs/measurements/; then
`python -m scripts.benchmarks.make_tables` puts them into the documents.
"""

import argparse
import dataclasses
import datetime
import json
import logging
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from resdepth_colmap.config import RefineConfig, StereoConfig
from resdepth_colmap.io.colmap.depth_map import write_depth_map
from resdepth_colmap.io.files import link_or_copy
from resdepth_colmap.network.network_config import (
    InputVariant,
    NetworkConfig,
    Normalisation,
)
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.network.weights import load_weights
from resdepth_colmap.pipeline.initial_map import choose_initial_map
from resdepth_colmap.pipeline.refine.view import ViewInputs, refine_view
from resdepth_colmap.scene import DepthMap
from resdepth_colmap.training.config import Preset, Schedule, TrainConfig
from resdepth_colmap.training.data.labelled_views import labelled_views
from resdepth_colmap.training.data.scenes import (
    check_apart,
    find_scenes,
    scene_name,
    split_scenes,
)
from resdepth_colmap.training.loop import train
from resdepth_colmap.versions import versions
from scripts.benchmarks.matching.matched_workspace import linked_maps, matched_workspace
from scripts.benchmarks.tables.documents import HARDWARE
from scripts.benchmarks.tables.variants import beyond_table, variants_table
from scripts.benchmarks.variant_errors import method_errors, method_summaries

REPOSITORY = Path(__file__).resolve().parents[2]
RESULTS = REPOSITORY / "docs" / "measurements"
STEREO, ITERATED = "resdepth_stereo", "resdepth_stereo_iter"
REFINED_KIND = "refined"

# The networks by themselves.
REFINING = RefineConfig(inner_iterations=1, update_gating=False)


class Options(NamedTuple):
    """What a variant changes, of the network and of its training."""

    network: Mapping[str, Any] = {}
    training: Mapping[str, Any] = {}


PAPER = {
    "unet_stereo": Options({"variant": InputVariant.IMAGES_ONLY}),
    "resdepth_0": Options({"variant": InputVariant.DEPTH_ONLY}),
    "resdepth_mono": Options({"variant": InputVariant.MONO}),
    STEREO: Options({"variant": InputVariant.STEREO}),
}
ADDITIONS = {
    STEREO: PAPER[STEREO],
    "robust": Options({"normalisation": Normalisation.ROBUST}),
    "inputs": Options({"valid": True, "photo_consistency": True}),
    "last_block": Options({"last_block": True}),
    "gate": Options({"gate": True}),
    "loss": Options(training={"distance_power": 1.0, "log_weight": 0.1}),
    "confidence": Options({"confidence": True}, {"confidence_weight": 0.05}),
    "source_depth": Options({"source_depth": True}),
    "holes": Options(training={"holes_share": TrainConfig.holes_share}),
    "color": Options({"color": True}),
    "length": Options(training={"distance_power": 2.0}),
    "propagation": Options({"propagation_channels": 48}),
}
"""Beyond the paper; each row keeps what those before it have."""

FOLDERS = {STEREO: f"{STEREO}-baseline", "robust": f"{STEREO}-robust"}
"""Of networks that are among the paper's variants, too."""


class Budget(NamedTuple):
    """What each variant gets."""

    network: NetworkConfig
    training: TrainConfig


class Trainer(NamedTuple):
    """Trains variants on the same scenes, or takes what an earlier call has trained."""

    scenes: Sequence[Path]
    work: Path
    budget: Budget

    def network(self, name: str, options: Options) -> ResDepthNet:
        """One variant, trained."""
        print(f"training {name}", flush=True)
        start = time.monotonic()
        network = dataclasses.replace(self.budget.network, **options.network)
        training = dataclasses.replace(self.budget.training, **options.training)
        weights = train(self.scenes, self.work / name, network, training)
        print(f"{name}: {time.monotonic() - start:.0f} s", flush=True)
        return load_weights(weights)


def lean_copies(scenes: Sequence[Path], folder: Path) -> list[Path]:
    """Workspaces that share all with these, but have one map a view.

    It is the map that a refinement starts from. A scene without maps is matched.
    """
    copies = []
    for scene in scenes:
        copy = matched_workspace(scene, folder / scene_name(scene))
        linked_maps(scene, copy)
        views = labelled_views(copy.path, StereoConfig(filter=False))
        for view in views:
            kinds = [other.kind for other in views if other.index == view.index]
            camera = view.scene.views[view.index].camera
            best = choose_initial_map(view.workspace, view.image_name, camera, kinds)
            if view.kind != best.kind:
                view.map_path.unlink()
        copies.append(copy.path)
    return copies


def refined_copies(
    scenes: Sequence[Path], network: ResDepthNet, folder: Path
) -> list[Path]:
    """Workspaces that share all with these, but whose depth maps are refined."""
    copies = []
    for scene in scenes:
        copy = matched_workspace(scene, folder / scene_name(scene))
        for view in labelled_views(scene):
            path = copy.workspace.depth_map_path(view.image_name, REFINED_KIND)
            loaded = None if path.exists() else view.load(network.config.num_sources)
            if loaded is not None:
                write_depth_map(path, Method([network]).refined(loaded.inputs))
            elif not path.exists():  # of a failed pair: no training takes it
                link_or_copy(view.map_path, path)
        copies.append(copy.path)
    return copies


class Method(NamedTuple):
    """Networks that are applied one after the other."""

    networks: Sequence[ResDepthNet]

    def refined(self, view: ViewInputs) -> DepthMap:
        """Depth after the last network; each warps with what it gets."""
        for network in self.networks:
            depth = refine_view(view, network, REFINING).depth
            view = dataclasses.replace(view, depth=depth)
        return view.depth


Methods = dict[str, Method]


def measure(scenes: Sequence[Path], methods: Methods) -> dict[str, Any]:
    """Errors of each arm on each view, and their means."""
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


def paper_methods(trainer: Trainer) -> Methods:
    """The paper's variants."""
    suffix = trainer.budget.network.normalisation
    methods = {
        name: Method([trainer.network(f"{name}-{suffix}", PAPER[name])])
        for name in PAPER
    }
    (stereo,) = methods[STEREO].networks
    folder = trainer.work / f"refined_scenes-{suffix}"
    trainer = trainer._replace(scenes=refined_copies(trainer.scenes, stereo, folder))
    again = trainer.network(f"{ITERATED}-{suffix}", PAPER[STEREO])
    return {**methods, ITERATED: Method([stereo, again])}


def beyond_methods(trainer: Trainer) -> Methods:
    """ResDepth-stereo, what is added to it; what two passes add then."""
    methods: Methods = {}
    options = Options()
    for name, more in ADDITIONS.items():
        options = Options(
            {**options.network, **more.network}, {**options.training, **more.training}
        )
        network = trainer.network(FOLDERS.get(name, name), options)
        methods[name] = Method([network])
    methods["two_passes"] = Method([network, network])
    return methods


PARTS = {
    "variants": (paper_methods, variants_table, Normalisation.ROBUST),
    "beyond": (beyond_methods, beyond_table, Normalisation.BASELINE),
}


def parsed() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
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
    parser.add_argument("--hardware", default=HARDWARE)
    parser.add_argument("--output", type=Path, default=RESULTS, help="folder")
    return parser.parse_args()


def budget_of(arguments: argparse.Namespace) -> Budget:
    """The paper's network and training, at the size that was asked for."""
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
    """Read the command line, train, measure, print and write."""
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
    arguments.output.mkdir(parents=True, exist_ok=True)
    for part in arguments.parts:
        make_methods, table, normalisation = PARTS[part]
        network = dataclasses.replace(budget.network, normalisation=normalisation)
        budget = budget._replace(network=network)
        methods = make_methods(Trainer(split.training, work, budget))
        measured = {
            "command": "python -m scripts.benchmarks.variants",
            "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
            "hardware": arguments.hardware,
            "versions": versions(),
            "num_scenes": len(split.training),
            "steps": arguments.steps,
            "network": budget.network.to_mapping(),
            "training": {**budget.training.to_mapping(), "samples": None},
            "sets": {
                key: measure(paths, methods) for key, paths in sets.items() if paths
            },
        }
        text = json.dumps(measured, indent=2) + "\n"
        (arguments.output / f"{part}.json").write_text(text, "utf-8")
        print(table(measured))


if __name__ == "__main__":
    main()
