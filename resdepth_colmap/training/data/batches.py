"""Batches of crops, as one optimiser step sees them."""

import dataclasses
import hashlib
import signal
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.data import DataLoader

from resdepth_colmap.network.network_config import NetworkConfig
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
from resdepth_colmap.training.config import TrainConfig
from resdepth_colmap.training.data.crop_sampler import CropSampler
from resdepth_colmap.training.data.crops import Crop, CropDataset
from resdepth_colmap.training.data.samples import Sample
from resdepth_colmap.training.distributed import Ranks
from resdepth_colmap.training.stop_request import SIGNALS


class Batch(NamedTuple):
    """What one optimiser step sees.

    Attributes:
        inputs: The network's input, shape (B, C, H, W).
        target: True inverse depth, normalised as the input is, shape (B, 1, H, W).
        known: Where there is truth, shape (B, 1, H, W), bool.
        scaling: How that was done.
        source_sampler: Shows the first sources at other depths.
        importance: Weight of each pixel in the loss, shape (B, 1, H, W), 1 in the mean.
        names: Names of the samples of all processes, for the message when a loss is
            not finite.
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
        """The first sources at these inverse depths (`network.unet.SampleSource`)."""
        return self.source_sampler.gray_at(self.scaling.restore(normalised))


@dataclasses.dataclass(frozen=True, kw_only=True)
class CropSet:
    """Samples, and how batches of crops are made of them.

    Attributes:
        paths: The samples.
        network: The network that sees the crops.
        config: Batch size, crop size, seed and augmentation.
    """

    paths: tuple[Path, ...]
    network: NetworkConfig
    config: TrainConfig

    @property
    def key(self) -> str:
        """Tells these samples from others: a hash of their names."""
        names = "\n".join(path.stem for path in self.paths)
        return hashlib.sha256(names.encode()).hexdigest()[:16]

    def batches(
        self, steps: Sequence[int], ranks: Ranks | None = None, num_workers: int = 0
    ) -> Iterator[Batch]:
        """The batches of these steps; each is the same whenever it is asked for.

        Worker processes cut at most two batches each ahead of time. What they send is
        still in half precision and goes through a pipe: the shared memory of a
        container may be too small for a batch.

        Args:
            steps: The steps, in order.
            ranks: The processes that share each batch; None = this one alone.
            num_workers: Processes that read and cut; 0 = this process does.

        Raises:
            TrainingError: If a sample is too small for the network.
        """
        config, network = self.config, self.network
        loader: DataLoader[Crop] = DataLoader(
            CropDataset(network, config.vary_light),
            batch_sampler=CropSampler(
                self.paths, network, config, steps, ranks or Ranks()
            ),
            num_workers=num_workers,
            collate_fn=list,
            worker_init_fn=_ignore_stop_signals,
            generator=torch.Generator().manual_seed(config.seed),
        )
        for crops in loader:
            yield self.batch_of(crops)

    def batch_of(self, crops: Sequence[Crop]) -> Batch:
        """Crops of one size as a batch, normalised."""
        samples = [crop.sample for crop in crops]
        stack = InputStack(
            inverse_depth=_stacked([each.inverse_depth[None] for each in samples]),
            valid=_stacked([each.valid[None] for each in samples]),
            guidance=_stacked([each.guidance.astype(np.float32) for each in samples]),
            baseline=_stacked([self._baseline(each) for each in samples]),
        )
        inputs, scaling = network_input(stack, self.network)
        target = _stacked([each.target[None] for each in samples])
        return Batch(
            inputs=inputs,
            target=scaling.normalise(target),
            known=target > 0,
            scaling=scaling,
            source_sampler=SourceSampler(tuple(_sight(each) for each in samples)),
            importance=self._importance(stack.valid),
            names=crops[0].batch_names,
        )

    def _importance(self, valid: Tensor) -> Tensor:
        importance = torch.where(valid, self.config.valid_importance, 1.0)
        return importance / importance.mean(dim=(1, 2, 3), keepdim=True)

    def _baseline(self, sample: Sample) -> NDArray[np.float32]:
        index = 0 if self.network.uses_sources else 1
        return sample.baseline[index, None, None, None]


def _ignore_stop_signals(_worker_id: int) -> None:
    """Leave Ctrl-C and SIGTERM to the training, which still needs a batch to stop.

    Both reach the workers too where they are sent to the process group, as terminals
    and torchrun do.
    """
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def _sight(sample: Sample) -> Sight | None:
    if not sample.source_gray.size:
        return None
    source = SourceTensors(
        gray=torch.from_numpy(sample.source_gray.astype(np.float32))[None, None],
        K=torch.from_numpy(sample.source_K)[None],
        source_from_reference=torch.from_numpy(sample.source_from_reference)[None],
    )
    return Sight(torch.from_numpy(sample.K), source)


def _stacked(arrays: Sequence[NDArray]) -> Tensor:  # type: ignore[type-arg] # any dtype
    return torch.from_numpy(np.stack(arrays))
