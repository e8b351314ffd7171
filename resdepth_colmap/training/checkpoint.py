"""The state of a training on disk, from which a stopped training resumes."""

import dataclasses
import io
import logging
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from resdepth_colmap.errors import TrainingError
from resdepth_colmap.io.files import write_whole
from resdepth_colmap.network.weights import save_weights
from resdepth_colmap.training.optimizer import Optimisation

STATE_NAME = "state.pt"
WEIGHTS_NAME = "weights.safetensors"
BEST_NAME = "best.safetensors"

FREE_TO_CHANGE = (
    "checkpoint_steps",
    "validation_steps",
    "validation_views",
    "loaders",
    "device",
    "tensorboard",
    "samples",
)
"""Options that may differ when a training resumes: they do not change its steps."""

logger = logging.getLogger(__name__)


@dataclasses.dataclass(kw_only=True)
class Position:
    """Position of a training.

    Attributes:
        step: Number of steps taken.
        loss_sum: Sum of the losses since the last line of the log.
        loss_count: Number of these losses.
        best_score: Least score of a validation so far; infinite before the first.
        samples_key: Hash of the samples that the steps were taken with.
    """

    step: int = 0
    loss_sum: float = 0.0
    loss_count: int = 0
    best_score: float = math.inf
    samples_key: str = ""


def save_state(output: Path, run: Optimisation, position: Position) -> None:
    """Write the state and the weights, each whole or not at all.

    Raises:
        WorkspaceError: If the folder cannot be written to.
        WeightsError: If a weight is not finite.
    """
    state = {
        "position": dataclasses.asdict(position),
        "options": _options(run),
        "network": run.network.state_dict(),
        "optimiser": run.optimiser.state_dict(),
        "schedule": run.schedule.state_dict(),
    }
    buffer = io.BytesIO()
    torch.save(state, buffer)
    # The weights first: they refuse what is not finite, and the last state stays good.
    save_weights(output / WEIGHTS_NAME, run.network, {"steps": str(position.step)})
    write_whole(output / STATE_NAME, buffer.getvalue())


def save_best(
    output: Path, run: Optimisation, step: int, scores: Mapping[str, Any]
) -> None:
    """Write the weights that validate best, and their scores in the header."""
    facts = {"steps": str(step), **scores}
    save_weights(output / BEST_NAME, run.network, facts)


def load_state(output: Path, run: Optimisation) -> Position:
    """Load the last state, if there is one; returns its position.

    Raises:
        TrainingError: If the file is broken, or of a training with other options.
    """
    path = output / STATE_NAME
    if not path.exists():
        return Position()
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
        position, options = Position(**state["position"]), state["options"]
    except Exception as error:  # of torch, unpickling, zip, or another version
        raise TrainingError(
            f"{path}: not a readable state ({error}); start in another --output with "
            f"--init {output / WEIGHTS_NAME}."
        ) from error
    _check_options(path, options, run)
    run.network.load_state_dict(state["network"])
    run.optimiser.load_state_dict(state["optimiser"])
    run.schedule.load_state_dict(state["schedule"])
    if run.ranks.is_first:
        logger.info("Resuming after step %d of %s.", position.step, path)
    return position


def _options(run: Optimisation) -> dict[str, Any]:
    options = {**run.config.to_mapping(), **run.network.config.to_mapping()}
    return {key: options[key] for key in options if key not in FREE_TO_CHANGE}


def _check_options(path: Path, earlier: dict[str, Any], run: Optimisation) -> None:
    changed = [
        f"{name} was {earlier.get(name)}, not {value}"
        for name, value in _options(run).items()
        if earlier.get(name) != value
    ]
    if changed:
        raise TrainingError(
            f"{path}: of a training with other options ({', '.join(changed)}); resume "
            "with the same ones, or start in another --output with "
            f"--init {path.parent / WEIGHTS_NAME}."
        )
