"""One process of a training: takes a step and keeps its gradients.

    python gradient_worker.py SAMPLES WEIGHTS OUTPUT

Its number and those of the others come from the environment, as torchrun sets it.
"""

import sys
from pathlib import Path

import torch

from resdepth_colmap.config import Device
from resdepth_colmap.network.weights import load_weights
from resdepth_colmap.training.config import TrainConfig
from resdepth_colmap.training.data.batches import CropSet
from resdepth_colmap.training.distributed import join_ranks
from resdepth_colmap.training.initialisation import fresh_network
from resdepth_colmap.training.optimizer import Optimisation


def take_step(samples: Path, weights: Path, output: Path) -> None:
    """Take the first step; write gradients, running statistics and loss."""
    torch.set_num_threads(1)
    config = TrainConfig(
        batch_size=4, crop_px=32, init=weights, steps=3, validation_share=0.0
    )
    network_config = load_weights(weights).config
    with join_ranks(Device.CPU) as ranks:
        run = Optimisation(fresh_network(network_config, config), config, ranks)
        paths = tuple(sorted(samples.glob("*.npz")))
        crops = CropSet(paths=paths, network=network_config, config=config)
        (batch,) = crops.batches([0], ranks)
        loss, wants_stop = run.step(batch, wants_stop=ranks.rank == 1)
    network = run.network
    result = {f"grad {n}": p.grad for n, p in network.named_parameters()}
    result |= {f"buffer {n}": b.double() for n, b in network.named_buffers()}
    result["loss"] = torch.tensor(loss)
    result["stop"] = torch.tensor(float(wants_stop))
    result["crops"] = torch.tensor(float(len(batch.inputs)))
    torch.save(result, output / f"{ranks.rank}_of_{ranks.count}.pt")


if __name__ == "__main__":
    take_step(*map(Path, sys.argv[1:]))
