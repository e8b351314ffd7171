"""Sets of crops that tests cut: small ones, as they are in the samples."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.training.config import TrainConfig
from resdepth_colmap.training.data.batches import Batch, CropSet

NETWORK = NetworkConfig(levels=3, base_channels=4, max_channels=8, color=True)


def crop_set(
    samples: Sequence[Path], network: NetworkConfig = NETWORK, **options: Any
) -> CropSet:
    """Crops of 32 pixels in batches of four, all pixels and no light changed."""
    plain = {"crop_px": 32, "seed": 1, "vary_light": False, "valid_importance": 1.0}
    config = TrainConfig(**{**plain, **options})
    return CropSet(paths=tuple(samples), network=network, config=config)


def batch_of_step(samples: Sequence[Path], step: int = 0, **options: Any) -> Batch:
    """The batch of a step of such a set."""
    (batch,) = crop_set(samples, **options).batches([step])
    return batch
