"""The training loop: seeded, resumable, stopped by a loss that is not a number."""

import csv
import logging
import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import torch

from resdepth_colmap.config import TrainConfig
from resdepth_colmap.errors import TrainingError
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.network.weights import save_weights
from resdepth_colmap.pipeline.progress import Progress, SilentProgress
from resdepth_colmap.training.beginning import fresh_network
from resdepth_colmap.training.crops import Batch, CropSampler
from resdepth_colmap.training.loss import refinement_loss
from resdepth_colmap.training.samples import prepare_samples

logger = logging.getLogger(__name__)

VALIDATION_SHARE = 20  # one workspace of so many is held out
VALIDATION_BATCHES = 8
WARM_UP_SHARE = 0.05
LARGEST_GRADIENT = 1.0


class Run(NamedTuple):
    """All that changes while training.

    Attributes:
        network: The network.
        optimiser: Adam with decoupled weight decay.
        schedule: One cycle of the learning rate, a value a step.
    """

    network: ResDepthNet
    optimiser: torch.optim.AdamW
    schedule: torch.optim.lr_scheduler.OneCycleLR


def train(
    workspaces: Sequence[Path],
    output: Path,
    network_config: NetworkConfig,
    config: TrainConfig,
    progress: Progress | None = None,
) -> Path:
    """Train a network on workspaces with ground truth, or go on where it stopped.

    Args:
        workspaces: Dense workspaces with depth maps and `ground_truth/`; one of every
            twenty is held out for validation.
        output: Folder of the samples, `state.pt`, `log.csv` and `weights.safetensors`.
        network_config: The network to train.
        config: How.
        progress: Is told of each step.

    Returns:
        Path of the weights.

    Raises:
        TrainingError: Without samples, or when the loss is not a number.
        WeightsError: If the weights to start from cannot be read.
        ConfigError: If they are of another network than `network_config`.
    """
    progress = progress or SilentProgress()
    network = fresh_network(network_config, config)
    held_out = workspaces[VALIDATION_SHARE - 1 :: VALIDATION_SHARE]
    used = [path for path in workspaces if path not in held_out]
    cache = output / "samples"
    sampler = _sampler(used, cache, network_config, config, progress)
    validation = (
        _sampler(held_out, cache, network_config, config, progress)
        if held_out
        else None
    )
    run = _start(network, config)
    first = _resume(run, output / "state.pt")
    with (
        progress.stage("Training", config.steps) as advance,
        ThreadPoolExecutor(max_workers=1) as loader,
    ):
        advance(first)
        following = loader.submit(sampler.batch, first)
        total = 0.0
        for step in range(first, config.steps):
            batch = following.result()
            following = loader.submit(sampler.batch, step + 1)
            total += _step(run, batch, step)
            advance(1.0)
            done = step + 1
            if done % config.checkpoint_steps == 0 or done == config.steps:
                since = (done - 1) % config.checkpoint_steps + 1
                held_out_loss = _validate(run.network, validation)
                _log(output / "log.csv", done, total / since, held_out_loss)
                _save(run, output, done)
                total = 0.0
    return output / "weights.safetensors"


def _sampler(
    workspaces: Sequence[Path],
    cache: Path,
    network_config: NetworkConfig,
    config: TrainConfig,
    progress: Progress,
) -> CropSampler:
    return CropSampler(
        paths=tuple(prepare_samples(workspaces, network_config, cache, progress)),
        config=network_config,
        batch_size=config.batch_size,
        crop_px=config.crop_px,
        seed=config.seed,
    )


def _start(network: ResDepthNet, config: TrainConfig) -> Run:
    network = network.to(memory_format=torch.channels_last)  # type: ignore[call-overload] # torch's stubs lack the keyword
    optimiser = torch.optim.AdamW(
        network.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
    )
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser,
        max_lr=config.learning_rate,
        total_steps=config.steps + 1,
        pct_start=WARM_UP_SHARE,
    )
    return Run(network, optimiser, schedule)


def _step(run: Run, batch: Batch, step: int) -> float:
    run.network.train()
    inputs = batch.inputs.contiguous(memory_format=torch.channels_last)
    loss = refinement_loss(run.network(inputs), batch.target, batch.known, batch.weight)
    value = float(loss.detach())
    if not math.isfinite(value):
        raise TrainingError(
            f"the loss of step {step} is {value}; its batch: {', '.join(batch.names)}."
        )
    run.optimiser.zero_grad(set_to_none=True)
    loss.backward()  # type: ignore[no-untyped-call] # torch's own
    torch.nn.utils.clip_grad_norm_(run.network.parameters(), LARGEST_GRADIENT)
    run.optimiser.step()
    run.schedule.step()
    return value


@torch.inference_mode()
def _validate(network: ResDepthNet, sampler: CropSampler | None) -> float:
    """Mean loss over the same few batches of held-out scenes; NaN if there are none."""
    if sampler is None:
        return math.nan
    network.eval()
    total = 0.0
    for index in range(VALIDATION_BATCHES):
        batch = sampler.batch(index)
        refined = network(batch.inputs)
        total += float(
            refinement_loss(refined, batch.target, batch.known, batch.weight)
        )
    return total / VALIDATION_BATCHES


def _save(run: Run, output: Path, step: int) -> None:
    state = {
        "step": step,
        "network": run.network.state_dict(),
        "optimiser": run.optimiser.state_dict(),
        "schedule": run.schedule.state_dict(),
    }
    partial = output / "state.pt.partial"
    torch.save(state, partial)
    partial.replace(output / "state.pt")
    save_weights(output / "weights.safetensors", run.network, {"steps": str(step)})


def _resume(run: Run, path: Path) -> int:
    """Load the last state, if there is one; returns the step to go on with."""
    if not path.exists():
        return 0
    state = torch.load(path, weights_only=True)
    run.network.load_state_dict(state["network"])
    run.optimiser.load_state_dict(state["optimiser"])
    run.schedule.load_state_dict(state["schedule"])
    logger.info("Going on after step %d of %s.", state["step"], path)
    return int(state["step"])


def _log(path: Path, step: int, loss: float, held_out_loss: float) -> None:
    is_new = not path.exists()
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        if is_new:
            writer.writerow(["step", "loss", "held_out_loss"])
        writer.writerow([step, f"{loss:.5f}", f"{held_out_loss:.5f}"])
