"""Random crops of training samples, in batches."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from resdepth_colmap.errors import TrainingError
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.pipeline.inputs import InputStack, network_input
from resdepth_colmap.training.samples import Sample, read_sample

NEAR_TRUTH_WEIGHT = (0.3, 3.0)
"""Range of the weight that turns errors of inverse depth into relative ones."""


class Batch(NamedTuple):
    """What one optimiser step sees.

    Attributes:
        inputs: The network's input, shape (B, C, H, W).
        target: True inverse depth, normalised as the input is, shape (B, 1, H, W).
        known: Where there is truth, shape (B, 1, H, W), bool.
        weight: Weight of each pixel, shape (B, 1, H, W).
        names: The samples' names, for the message when a loss is not a number.
    """

    inputs: Tensor
    target: Tensor
    known: Tensor
    weight: Tensor
    names: tuple[str, ...]


@dataclasses.dataclass(frozen=True, kw_only=True)
class CropSampler:
    """Random crops of samples; step n gives the same batch whenever it is asked for.

    Attributes:
        paths: The samples.
        config: The network that they were made for.
        batch_size: Crops in a batch.
        crop_px: Largest side of a crop; smaller where an image is smaller.
        seed: Seed of all choices.
        holes_share: Share of samples whose maps have holes.
    """

    paths: tuple[Path, ...]
    config: NetworkConfig
    batch_size: int
    crop_px: int
    seed: int
    holes_share: float = 0.2

    def batch(self, step: int) -> Batch:
        """The batch of a step: crop, flip, change brightness, normalise."""
        rng = np.random.default_rng((self.seed, step))
        holes = [path for path in self.paths if path.stem.endswith("-holes")]
        dense = [path for path in self.paths if not path.stem.endswith("-holes")]
        pools = [
            holes if holes and rng.random() < self.holes_share else dense
            for _ in range(self.batch_size)
        ]
        chosen = [pool[int(rng.integers(len(pool)))] for pool in pools]
        crops = [self._crop(read_sample(path), rng) for path in chosen]
        stack = InputStack(
            inverse_depth=_stacked([crop.inverse_depth[None] for crop in crops]),
            valid=_stacked([crop.valid[None] for crop in crops]),
            guidance=_stacked([crop.guidance.astype(np.float32) for crop in crops]),
            baseline=_stacked([crop.baseline[:, None, None] for crop in crops]),
        )
        inputs, scaling = network_input(stack, self.config)
        target = _stacked([crop.target[None] for crop in crops])
        known = target > 0
        weight = scaling.offset / torch.where(known, target, scaling.offset)
        return Batch(
            inputs=inputs,
            target=scaling.normalise(target),
            known=known,
            weight=weight.clamp(*NEAR_TRUTH_WEIGHT),
            names=tuple(path.stem for path in chosen),
        )

    def _crop(self, sample: Sample, rng: np.random.Generator) -> Sample:
        multiple_px = self.config.multiple_px
        height, width = sample.target.shape
        rows = _window(height, self.crop_px, multiple_px, rng)
        columns = _window(width, self.crop_px, multiple_px, rng)
        flip = -1 if rng.random() < 0.5 else 1

        def cut(values: NDArray) -> NDArray:  # type: ignore[type-arg] # any dtype
            cropped = values[..., rows, columns][..., ::flip]
            return np.ascontiguousarray(cropped)

        guidance = self._other_light(cut(sample.guidance).astype(np.float32), rng)
        return Sample(
            inverse_depth=cut(sample.inverse_depth),
            target=cut(sample.target),
            valid=cut(sample.valid),
            guidance=guidance.astype(np.float16),
            baseline=sample.baseline,
        )

    def _other_light(
        self, guidance: NDArray[np.float32], rng: np.random.Generator
    ) -> NDArray[np.float32]:
        """Another gamma and brightness for all images, and a little for each."""
        names = [name for name in self.config.channels if name != "inverse_depth"]
        gamma, gain = np.exp(rng.normal(0.0, 0.15)), np.exp(rng.normal(0.0, 0.1))
        for index, name in enumerate(names):
            if name == "reference" or name.startswith("source"):
                own = gamma * np.exp(rng.normal(0.0, 0.05))
                gray = np.clip(guidance[index], 0.0, 1.0) ** own
                gray = gray * gain * np.exp(rng.normal(0.0, 0.05))
                guidance[index] = np.clip(gray, 0.0, 1.0)
        return guidance


def _stacked(arrays: Sequence[NDArray]) -> Tensor:  # type: ignore[type-arg] # any dtype
    return torch.from_numpy(np.stack(arrays))


def _window(
    size_px: int, crop_px: int, multiple_px: int, rng: np.random.Generator
) -> slice:
    length = min(crop_px, size_px) // multiple_px * multiple_px
    if length == 0:
        raise TrainingError(
            f"an image side of {size_px} px is too small for a network that halves it "
            f"to 1/{multiple_px}; train on larger images or with fewer levels."
        )
    start = int(rng.integers(size_px - length + 1))
    return slice(start, start + length)
