"""The options of the training, and the presets of them."""

import dataclasses
import enum
from pathlib import Path
from typing import Any, Self

from resdepth_colmap.config import Config, Device, option


class Preset(enum.StrEnum):
    """A set of options."""

    DEFAULT = "default"
    PAPER = "paper"


class Optimiser(enum.StrEnum):
    """The optimiser."""

    ADAM = "adam"  # weight decay is part of the gradient
    ADAMW = "adamw"  # weight decay is decoupled


class Precision(enum.StrEnum):
    """Number format of the forward and backward pass; weights stay single."""

    SINGLE = "single"
    BFLOAT16 = "bfloat16"  # up to twice as fast where the processor knows it


class Schedule(enum.StrEnum):
    """Course of the learning rate."""

    CONSTANT = "constant"
    ONE_CYCLE = "one-cycle"


@dataclasses.dataclass(frozen=True, kw_only=True)
class TrainConfig(Config):
    """Options of the training.

    Attributes:
        steps: Number of optimiser steps.
        batch_size: Crops per step, over all processes.
        crop_px: Largest side of a crop, in pixels.
        learning_rate: Learning rate; with one-cycle, its peak.
        weight_decay: Weight decay.
        optimiser: adam (the paper's) or adamw.
        schedule: Course of the learning rate.
        largest_gradient: Norm to which gradients are clipped; 0 = no clipping.
        distance_power: Weight errors of inverse depth by the refined depth to this
            power: 2 = absolute errors of depth, 1 = relative ones, 0 = the paper's.
        valid_importance: Weight of a pixel with measured and consistent depth,
            relative to a filled one; update gating protects the former anyway.
        log_weight: Weight of the logarithmic term, which keeps small errors small.
        confidence_weight: Weight of the likelihood of the predicted error scale.
        vary_light: Vary brightness and contrast of the crops.
        holes_share: Share of crops from maps that are filtered, or look like it.
        checkpoint_steps: Steps between two saved states.
        validation_steps: Steps between two validations.
        validation_share: Share of the scenes that is held out; 0 = none.
        validation_views: Views to refine of the held-out and of the watched scenes.
        loaders: Worker processes that load crops ahead of time; 0 = load them in the
            training process.
        device: Device to train on.
        precision: single (the paper's) or bfloat16, which is faster on processors with
            AVX512-BF16 or AMX and on GPUs.
        tensorboard: Log for TensorBoard too, where it is installed.
        seed: Seed of weights, crops and order.
        init: Weights file to start from, with a new optimiser; "shipped" = the weights
            of the package. The network is then that of the file. None = random weights.
        freeze_unet: Train the propagation alone; the U-Net keeps its weights.
        freeze_norms: Keep the running statistics of the norms and normalise by them
            instead of by those of each batch, to preserve good initial weights.
        outer_iterations: Outer iterations to train for: from 2 on, part of the crops
            are compared with maps of other views that the initial weights have refined.
        samples: Folder of prepared samples, which several trainings can share; None =
            one in the output folder.
    """

    steps: int = 3000
    batch_size: int = 4
    crop_px: int = 512
    learning_rate: float = 1e-3
    weight_decay: float = 1e-5
    optimiser: Optimiser = Optimiser.ADAMW
    schedule: Schedule = Schedule.ONE_CYCLE
    largest_gradient: float = 1.0
    distance_power: float = 2.0
    valid_importance: float = 0.3
    log_weight: float = 0.1
    confidence_weight: float = 0.05
    vary_light: bool = True
    holes_share: float = 0.2
    checkpoint_steps: int = 100
    validation_steps: int = 250
    validation_share: float = 0.05
    validation_views: int = 12
    loaders: int = 1
    device: Device = Device.AUTO
    precision: Precision = Precision.SINGLE
    tensorboard: bool = True
    seed: int = 0
    init: Path | None = None
    freeze_unet: bool = False
    freeze_norms: bool = False
    outer_iterations: int = option("rounds", 1)
    samples: Path | None = None

    def __post_init__(self) -> None:
        """Turn plain strings into their enums and check the ranges."""
        for name, kind in _WORDS.items():
            value = getattr(self, name)
            choices = [str(choice) for choice in kind]
            self._check(value in choices, " or ".join(choices), name)
            object.__setattr__(self, name, kind(value))
        for name in _AT_LEAST_ONE:
            self._check(getattr(self, name) >= 1, "at least 1", name)
        for name in _NOT_NEGATIVE:
            self._check(getattr(self, name) >= 0, "0 or more", name)
        self._check(
            self.crop_px >= 32 and self.crop_px % 32 == 0, "a multiple of 32", "crop_px"
        )
        self._check(self.learning_rate > 0, "more than 0", "learning_rate")
        self._check(0 <= self.holes_share <= 1, "0 to 1", "holes_share")
        self._check(0 <= self.validation_share <= 0.5, "0 to 0.5", "validation_share")

    @classmethod
    def of(cls, preset: Preset, options: dict[str, Any] | None = None) -> Self:
        """A preset with some options replaced.

        `paper` is the paper's training on ETH3D (section "Network Training"): plain L1
        on inverse depth scaled by the baseline, Adam at a constant rate, batches of
        four crops, horizontal flips and no other augmentation.

        Args:
            preset: The preset.
            options: Attributes that differ from it.

        Raises:
            ConfigError: For an unknown attribute or a value out of range.
        """
        chosen = _PAPER if preset is Preset.PAPER else {}
        return cls.from_mapping({**chosen, **(options or {})})


_WORDS: dict[str, type[enum.StrEnum]] = {
    "optimiser": Optimiser,
    "schedule": Schedule,
    "precision": Precision,
    "device": Device,
}
_AT_LEAST_ONE = (
    "steps",
    "batch_size",
    "checkpoint_steps",
    "validation_steps",
    "validation_views",
    "outer_iterations",
)
_NOT_NEGATIVE = (
    "distance_power",
    "weight_decay",
    "largest_gradient",
    "valid_importance",
    "log_weight",
    "confidence_weight",
    "loaders",
)
_PAPER: dict[str, Any] = {
    "learning_rate": 1e-5,
    "batch_size": 4,
    "crop_px": 512,
    "weight_decay": 1e-5,
    "optimiser": Optimiser.ADAM,
    "schedule": Schedule.CONSTANT,
    "largest_gradient": 0.0,
    "distance_power": 0.0,
    "valid_importance": 1.0,
    "log_weight": 0.0,
    "confidence_weight": 0.0,
    "vary_light": False,
}
