"""The batches of a training: which samples each step cuts its crops from."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from torch.utils.data import Sampler

from resdepth_colmap.errors import TrainingError
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.training.config import TrainConfig
from resdepth_colmap.training.data.samples import (
    DENSE,
    FILLED,
    HOLES,
    LATER,
    sample_size,
)
from resdepth_colmap.training.distributed import Ranks

ALONE_SHARE = 0.15
"""Share of crops without maps of other views, for a network that sees such maps: a user
may have none."""

LATER_SHARE = 0.6
"""Of the other crops, share of those whose other views have been refined."""


class Draw(NamedTuple):
    """A crop to cut.

    Attributes:
        path: The sample.
        shape: Height and width of the crop, in pixels; the same in all of a batch.
        rng: Chooses window, mirroring and light.
        batch_names: Names of the samples of the batch, over all processes.
    """

    path: Path
    shape: tuple[int, int]
    rng: np.random.Generator
    batch_names: tuple[str, ...]


class CropSampler(Sampler[list[Draw]]):
    """Draws the batches of a range of steps.

    The draws of a step depend on the samples, the seed and the step alone: a training
    that resumes gets the batches of an uninterrupted one, and each process its part of
    the batch that one process alone would get.

    Args:
        paths: The samples.
        network: The network that sees the crops.
        config: Batch size, crop size, seed and share of maps with holes.
        steps: Steps to draw batches for.
        ranks: The processes that share each batch.
    """

    def __init__(  # noqa: D107
        self,
        paths: Sequence[Path],
        network: NetworkConfig,
        config: TrainConfig,
        steps: Sequence[int],
        ranks: Ranks,
    ) -> None:
        self.network, self.config = network, config
        self.steps, self.ranks = steps, ranks
        self._pools = {
            end: [path for path in paths if path.stem.endswith(end)]
            for end in (DENSE, FILLED, LATER, HOLES)
        }

    def __len__(self) -> int:
        """Number of batches."""
        return len(self.steps)

    def __iter__(self) -> Iterator[list[Draw]]:
        """The draws of this process, a batch a step.

        Raises:
            TrainingError: If a sample is too small for the network.
        """
        for step in self.steps:
            yield self.batch(step)[self.ranks.rank :: self.ranks.count]

    def batch(self, step: int) -> list[Draw]:
        """The draws of all processes for a step."""
        drawn = [self._draw(step, index) for index in range(self.config.batch_size)]
        paths = [path for path, _ in drawn]
        shape = self._crop_shape(paths)
        names = tuple(path.stem for path in paths)
        return [Draw(path, shape, rng, names) for path, rng in drawn]

    def _draw(self, step: int, index: int) -> tuple[Path, np.random.Generator]:
        rng = np.random.default_rng((self.config.seed, step, index))
        sees_maps, holes_share = self.network.source_depth, self.config.holes_share
        filled, later = (FILLED, LATER) if sees_maps else (DENSE, DENSE)
        lot = (rng.random() - holes_share) / max(1.0 - holes_share, 1e-9)
        wanted = filled
        if lot < 0.0:
            wanted = HOLES
        elif lot < ALONE_SHARE:
            wanted = DENSE
        elif lot < ALONE_SHARE + LATER_SHARE * (1.0 - ALONE_SHARE):
            wanted = later
        kinds = (wanted, filled, DENSE, HOLES)
        pool = next(self._pools[kind] for kind in kinds if self._pools[kind])
        return pool[int(rng.integers(len(pool)))], rng

    def _crop_shape(self, paths: Sequence[Path]) -> tuple[int, int]:
        """Height and width of the crops of a batch: its smallest sample limits them."""
        multiple, most = self.network.multiple_px, self.config.crop_px
        sizes = np.array([sample_size(path) for path in paths])
        height, width = np.minimum(most, sizes.min(axis=0)) // multiple * multiple
        if min(height, width) == 0:
            smallest = int(sizes.min(axis=1).argmin())
            raise TrainingError(
                f"{paths[smallest].stem}: a side of {sizes[smallest].min()} px (or the "
                f"crop of {most} px) is too small for a network of "
                f"{self.network.levels} levels, which needs {multiple} px; leave this "
                "sample out or train with fewer levels."
            )
        return int(height), int(width)
