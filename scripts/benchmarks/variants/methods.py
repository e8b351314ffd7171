"""The variants that are trained: the paper's, and what is added to the best of them.

The paper's part (its section "Network Variants"): Unet-stereo (images only),
ResDepth-0, -mono, -stereo and -stereo_iter. The additions start with a ResDepth-stereo
on inverse depth times the baseline, as in the paper's experiment on ETH3D, and add one
thing after the other.
"""

import dataclasses
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from resdepth_colmap.network.network_config import (
    InputVariant,
    NetworkConfig,
    Normalisation,
)
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.network.weights import load_weights
from resdepth_colmap.training.config import TrainConfig
from resdepth_colmap.training.loop import train
from scripts.benchmarks.variants.method import Method
from scripts.benchmarks.variants.scenes import refined_copies

STEREO, ITERATED = "resdepth_stereo", "resdepth_stereo_iter"
Methods = dict[str, Method]


class Options(NamedTuple):
    """What a variant changes in the network and in its training."""

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
"""Each keeps what those before it have."""

FOLDERS = {STEREO: f"{STEREO}-baseline", "robust": f"{STEREO}-robust"}
"""Of networks that are among the paper's variants, too."""


class Budget(NamedTuple):
    """The network and training that each variant changes."""

    network: NetworkConfig
    training: TrainConfig


class Trainer(NamedTuple):
    """Trains variants on the same scenes; a trained one is loaded."""

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


def added_methods(trainer: Trainer) -> Methods:
    """ResDepth-stereo and the additions; then two inner iterations of the last one."""
    methods: Methods = {}
    options = Options()
    for name, more in ADDITIONS.items():
        options = Options(
            {**options.network, **more.network}, {**options.training, **more.training}
        )
        network = trainer.network(FOLDERS.get(name, name), options)
        methods[name] = Method([network])
    methods["two_inner_iterations"] = Method([network, network])
    return methods
