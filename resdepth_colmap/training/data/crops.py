"""Random crops of training samples, in batches."""

import collections
import dataclasses
import functools
import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from resdepth_colmap.errors import TrainingError
from resdepth_colmap.geometry.pixels import cropped_K, mirrored_K
from resdepth_colmap.network.network_config import BLUE, RED, NetworkConfig
from resdepth_colmap.pipeline.refine.network_inputs import (
    InputStack,
    Scaling,
    network_input,
)
from resdepth_colmap.pipeline.refine.source_sampler import (
    Sight,
    SourceSampler,
    SourceTensors,
)
from resdepth_colmap.training.data.samples import (
    AGAIN,
    DENSE,
    FILLED,
    HOLES,
    Sample,
    guidance_names,
    read_sample,
    sample_size,
)

ALONE_SHARE = 0.15
"""Share of crops of a network that looks at the maps of other views for which there are
none: users may have none."""

AGAIN_SHARE = 0.6
"""Of the other crops, share of those for which these maps have been refined."""


class Batch(NamedTuple):
    """What one optimiser step sees.

    Attributes:
        inputs: The network's input, shape (B, C, H, W).
        target: True inverse depth, normalised as the input is, shape (B, 1, H, W).
        known: Where there is truth, shape (B, 1, H, W), bool.
        scaling: How that was done.
        source_sampler: Shows the first sources at other depths.
        importance: How much each pixel counts, shape (B, 1, H, W), 1 in the mean.
        names: Names of the samples of all processes, for the message when a loss is
            not a number.
    """

    inputs: Tensor
    target: Tensor
    known: Tensor
    scaling: Scaling
    source_sampler: SourceSampler
    importance: Tensor
    names: tuple[str, ...]

    def to(self, device: torch.device) -> "Batch":
        """The same on a device."""
        return Batch(
            inputs=self.inputs.to(device),
            target=self.target.to(device),
            known=self.known.to(device),
            scaling=Scaling(*(values.to(device) for values in self.scaling)),
            source_sampler=self.source_sampler.to(device),
            importance=self.importance.to(device),
            names=self.names,
        )

    def sample_source(self, normalised: Tensor) -> Tensor:
        """The first sources at these inverse depths (`network.unet.Look`)."""
        return self.source_sampler.gray_at(self.scaling.restore(normalised))


@dataclasses.dataclass(frozen=True, kw_only=True)
class CropSampler:
    """Random crops of samples; step n gives the same batch whenever it is asked for.

    Attributes:
        paths: The samples.
        config: The network that sees them.
        batch_size: Crops in a batch, over all processes.
        crop_px: Largest side of a crop; smaller where an image is smaller.
        seed: Seed of all choices.
        holes_share: Share of samples whose maps have holes.
        vary_light: Change brightness and contrast at random.
        valid_importance: How much a pixel of a valid depth counts, to one without.
    """

    paths: tuple[Path, ...]
    config: NetworkConfig
    batch_size: int
    crop_px: int
    seed: int
    holes_share: float = 0.2
    vary_light: bool = True
    valid_importance: float = 1.0

    def batch(self, step: int, rank: int = 0, num_ranks: int = 1) -> Batch:
        """The batch of a step: crop, flip, change brightness, normalise.

        Args:
            step: Which one.
            rank: Number of this process.
            num_ranks: Number of processes; each gets its part of the same batch.

        Raises:
            TrainingError: If an image is too small for the network.
        """
        draws = [self._draw(step, item) for item in range(self.batch_size)]
        sizes = np.array([sample_size(path) for path, _ in draws])
        size = sizes.min(axis=0)
        own = draws[rank::num_ranks]
        crops = [self._crop(path, size, rng) for path, rng in own]
        stack = InputStack(
            inverse_depth=_stacked([crop.inverse_depth[None] for crop in crops]),
            valid=_stacked([crop.valid[None] for crop in crops]),
            guidance=_stacked([crop.guidance.astype(np.float32) for crop in crops]),
            baseline=_stacked([self._baseline(crop) for crop in crops]),
        )
        inputs, scaling = network_input(stack, self.config)
        target = _stacked([crop.target[None] for crop in crops])
        known = target > 0
        return Batch(
            inputs=inputs,
            target=scaling.normalise(target),
            known=known,
            scaling=scaling,
            source_sampler=SourceSampler(tuple(_sight(crop) for crop in crops)),
            importance=self._importance(stack.valid),
            names=tuple(path.stem for path, _ in draws),
        )

    @property
    def samples_key(self) -> str:
        """Tells these samples from others: a hash of their names."""
        names = "\n".join(path.stem for path in self.paths)
        return hashlib.sha256(names.encode()).hexdigest()[:16]

    @functools.cached_property
    def _pools(self) -> dict[str, tuple[Path, ...]]:
        """The samples by the end of their names."""
        return {
            end: tuple(path for path in self.paths if path.stem.endswith(end))
            for end in (DENSE, FILLED, AGAIN, HOLES)
        }

    @functools.cached_property
    def _channels(self) -> list[int]:
        """Which channels of a sample the network sees."""
        names = guidance_names(self.config.num_sources)
        wanted = [name for name in self.config.channels if name != "inverse_depth"]
        return [names.index(name) for name in wanted]

    def _importance(self, valid: Tensor) -> Tensor:
        importance = torch.where(valid, self.valid_importance, 1.0)
        return importance / importance.mean(dim=(1, 2, 3), keepdim=True)

    def _draw(self, step: int, item: int) -> tuple[Path, np.random.Generator]:
        """A sample, and what decides on its crop: the same in every process."""
        rng = np.random.default_rng((self.seed, step, item))
        own = FILLED if self.config.source_depth else DENSE
        again = AGAIN if self.config.source_depth else DENSE
        lot = (rng.random() - self.holes_share) / max(1.0 - self.holes_share, 1e-9)
        kinds = [own, DENSE, HOLES]
        if lot < 0.0:
            kinds.insert(0, HOLES)
        elif lot < ALONE_SHARE:
            kinds.insert(0, DENSE)
        elif lot < ALONE_SHARE + AGAIN_SHARE * (1.0 - ALONE_SHARE):
            kinds.insert(0, again)
        pool = next(self._pools[kind] for kind in kinds if self._pools[kind])
        return pool[int(rng.integers(len(pool)))], rng

    def _crop(
        self, path: Path, size: NDArray[np.int_], rng: np.random.Generator
    ) -> Sample:
        """A window of a sample, mirrored in half of the cases.

        The sources in it were warped into the reference camera before: mirrored
        together, all channels are those of a mirrored pair of views. The source that
        will be looked at again stays as it is: the camera of the crop is mirrored.
        """
        sample = read_sample(path)
        limits = zip(sample.target.shape, size, strict=True)
        rows, columns = (self._window(path, *limit, rng) for limit in limits)
        flip = -1 if rng.random() < 0.5 else 1

        def cut(values: NDArray) -> NDArray:  # type: ignore[type-arg] # any dtype
            cropped = values[..., rows, columns][..., ::flip]
            return np.ascontiguousarray(cropped)

        K = cropped_K(sample.K, columns.start, rows.start)
        crop = sample._replace(
            inverse_depth=cut(sample.inverse_depth),
            target=cut(sample.target),
            valid=cut(sample.valid),
            guidance=cut(sample.guidance[self._channels]),
            K=K if flip > 0 else mirrored_K(K, columns.stop - columns.start),
        )
        return self._other_light(crop, rng) if self.vary_light else crop

    def _window(
        self, path: Path, size_px: int, least_px: int, rng: np.random.Generator
    ) -> slice:
        """A window as long as the crop, but no longer than the batch's least image."""
        multiple_px = self.config.multiple_px
        length = min(self.crop_px, least_px) // multiple_px * multiple_px
        if length == 0:
            raise TrainingError(
                f"{path.stem}: a side of {size_px} px (or the crop of {self.crop_px} "
                f"px) is too small for a network of {self.config.levels} levels, which "
                f"needs {multiple_px} px; leave it out or train with fewer levels."
            )
        start = int(rng.integers(size_px - length + 1))
        return slice(start, start + length)

    def _baseline(self, crop: Sample) -> NDArray[np.float32]:
        own = crop.baseline[:1] if self.config.uses_sources else crop.baseline[1:]
        return own[:, None, None]

    def _other_light(self, crop: Sample, rng: np.random.Generator) -> Sample:
        """Another gamma and brightness for all images, and a little for each."""
        names = [name for name in self.config.channels if name != "inverse_depth"]
        common = np.exp(rng.normal(0.0, (0.15, 0.1)))
        # One for all channels of an image.
        lights: dict[str, NDArray[np.float64]] = collections.defaultdict(
            lambda: common * np.exp(rng.normal(0.0, 0.05, size=2))
        )
        guidance = crop.guidance.copy()
        for index, name in enumerate(names):
            image = "reference" if name in (RED, BLUE) else name
            if image == "reference" or image.startswith("source"):
                guidance[index] = _lit(guidance[index], *lights[image])
        source_gray = _lit(crop.source_gray, *lights["source_0"])
        return crop._replace(guidance=guidance, source_gray=source_gray)


def _lit(values: NDArray[np.float16], gamma: float, gain: float) -> NDArray[np.float16]:
    lit = np.clip(values.astype(np.float32), 0.0, 1.0) ** np.float32(gamma) * gain
    return np.asarray(np.clip(lit, 0.0, 1.0), np.float16)


def _sight(crop: Sample) -> Sight | None:
    if not crop.source_gray.size:
        return None
    source = SourceTensors(
        gray=torch.from_numpy(crop.source_gray.astype(np.float32))[None, None],
        K=torch.from_numpy(crop.source_K)[None],
        source_from_reference=torch.from_numpy(crop.source_from_reference)[None],
    )
    return Sight(torch.from_numpy(crop.K), source)


def _stacked(arrays: Sequence[NDArray]) -> Tensor:  # type: ignore[type-arg] # any dtype
    return torch.from_numpy(np.stack(arrays))
