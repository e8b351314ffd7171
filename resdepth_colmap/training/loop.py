"""The training loop: seeded, resumable, stopped by a loss that is not finite."""

import logging
import math
import time
from collections.abc import Sequence
from pathlib import Path

import torch

from resdepth_colmap.errors import TrainingError
from resdepth_colmap.io.images import write_png
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.progress import Advance, Progress, SilentProgress
from resdepth_colmap.training import checkpoint
from resdepth_colmap.training.config import TrainConfig
from resdepth_colmap.training.curves import draw_curves
from resdepth_colmap.training.data.batches import Batch
from resdepth_colmap.training.data.sets import Data, Folders, prepare_data
from resdepth_colmap.training.distributed import join_ranks
from resdepth_colmap.training.initialisation import fresh_network
from resdepth_colmap.training.log import Row, TrainingLog
from resdepth_colmap.training.optimizer import Optimisation
from resdepth_colmap.training.stop_request import StopRequest, stop_request
from resdepth_colmap.training.validation import mean_loss
from resdepth_colmap.viz.strips import depth_strip

logger = logging.getLogger(__name__)

CURVES_NAME = "curves.png"
PREDICTIONS_FOLDER = "predictions"


def train(
    workspaces: Sequence[Path],
    output: Path,
    network_config: NetworkConfig,
    config: TrainConfig,
    progress: Progress | None = None,
    validate_on: Sequence[Path] = (),
) -> Path:
    """Train a network on workspaces with ground truth, or resume a stopped training.

    Under torchrun each process takes its part of each batch; the first one logs,
    validates and saves.

    Args:
        workspaces: Dense workspaces with `ground_truth/`, or folders of such; those
            without depth maps are matched first.
        output: Folder of the samples, the state, the weights, the log and its pictures.
        network_config: The network to train.
        config: Options of the training.
        progress: Advances with each step.
        validate_on: More workspaces with `ground_truth/`, never trained on. If there
            are any, the best weights are the best on these, else on held-out scenes.

    Returns:
        Path of the best weights; of the last ones without validation.

    Raises:
        TrainingError: Without samples, when the loss is not finite, or if the output
            folder holds a training with other options.
        WorkspaceError: If a workspace is broken.
        WeightsError: If the weights to start from cannot be read.
        ConfigError: If they are of another network than `network_config`.
        KeyboardInterrupt: After Ctrl-C or SIGTERM; the state is saved.
    """
    with join_ranks(config.device) as ranks:
        if progress is None or not ranks.is_first:
            progress = SilentProgress()
        ranks.check_batch(config.batch_size)
        network = fresh_network(network_config, config)
        folders = Folders(workspaces, validate_on, output)
        data = prepare_data(folders, network_config, config, ranks, progress)
        torch.backends.cudnn.deterministic = True  # resumable to the bit on GPUs too
        run = Optimisation(network, config, ranks)
        with (
            stop_request() as stop,
            progress.stage("Training", config.steps) as advance,
        ):
            _Loop(run, data, output, stop).run(advance)
    best = output / checkpoint.BEST_NAME
    return best if best.is_file() else output / checkpoint.WEIGHTS_NAME


class _Loop:
    """Steps, and what the first process does between them."""

    def __init__(
        self, optimisation: Optimisation, data: Data, output: Path, stop: StopRequest
    ) -> None:
        self.optimisation = optimisation
        self.config, self.ranks = optimisation.config, optimisation.ranks
        self.data = data
        self.output = output
        self.stop = stop
        self.position = checkpoint.load_state(output, optimisation)
        self._check_samples()
        self.log: TrainingLog | None = None

    def run(self, advance: Advance) -> None:
        """Take the remaining steps."""
        advance(self.position.step)
        if self.position.step >= self.config.steps:
            return
        if self.ranks.is_first:
            self.log = TrainingLog(
                self.output, self.position.step, self.config.tensorboard
            )
        try:
            self._run(advance)
        finally:
            if self.log is not None:
                self.log.close()

    def _check_samples(self) -> None:
        key, before = self.data.training.key, self.position.samples_key
        if before and before != key and self.ranks.is_first:
            logger.warning(
                "%s: the samples have changed since the last step; the result differs "
                "from that of an uninterrupted training.",
                self.output,
            )
        self.position.samples_key = key

    def _run(self, advance: Advance) -> None:
        start = time.perf_counter()
        if self.log is not None and self.config.init and not self.position.step:
            self.log.add({"step": 0, **self._validate(self.log)})  # the score to beat
        steps = range(self.position.step, self.config.steps)
        crops, num_workers = self.data.training, self.config.loaders
        for batch in crops.batches(steps, self.ranks, num_workers):
            value, wants_stop = self._step(batch)
            self.position.step += 1
            self.position.loss_sum += value
            self.position.loss_count += 1
            advance(1.0)
            if self.log is not None:
                now = time.perf_counter()
                if self._report(self.log, now - start):
                    start = time.perf_counter()
                if wants_stop or self._is_due(self.config.checkpoint_steps):
                    checkpoint.save_state(self.output, self.optimisation, self.position)
            if wants_stop:
                raise KeyboardInterrupt
            if self._is_due(self.config.validation_steps):
                self.ranks.summed([0.0])  # the others wait for the first

    def _step(self, batch: Batch) -> tuple[float, bool]:
        try:
            return self.optimisation.step(batch, self.stop.is_made)
        except TrainingError as error:
            state = self.output / checkpoint.STATE_NAME
            kept = f"{state} is the last good state" if state.exists() else "not saved"
            raise TrainingError(
                f"step {self.position.step}: {error}; {kept}. Check the depth maps of "
                "these samples, or lower --learning-rate."
            ) from error

    def _is_due(self, every: int) -> bool:
        step = self.position.step
        return step % every == 0 or step == self.config.steps

    def _report(self, log: TrainingLog, seconds: float) -> bool:
        """Add a line to the log if one is due, after validating if that is due."""
        validates = self._is_due(self.config.validation_steps) and (
            self.data.held_out is not None or bool(self.data.sets)
        )
        if not validates and not self._is_due(self.config.checkpoint_steps):
            return False
        position = self.position
        row = {
            "step": position.step,
            "learning_rate": self.optimisation.learning_rate,
            "loss": position.loss_sum / position.loss_count,
            **(self._validate(log) if validates else {}),
            "seconds": seconds,
        }
        log.add(row)
        write_png(self.output / CURVES_NAME, draw_curves(log.rows))
        position.loss_sum, position.loss_count = 0.0, 0
        return True

    def _validate(self, log: TrainingLog) -> Row:
        """Refine views and draw some; save the weights if their score is the best."""
        network, step = self.optimisation.network, self.position.step
        row: Row = {}
        if self.data.held_out is not None:
            row["held_out_loss"] = mean_loss(network, self.data.held_out)
        score = math.inf
        for views in self.data.sets:  # the watched ones, if any, are the last
            scores, pictures = views.measure(network)
            row |= {f"{views.name}_{k}": v for k, v in scores._asdict().items()}
            score = scores.score
            for index, picture in enumerate(pictures):
                name, strip = f"{views.name}_{index}", depth_strip(picture)
                write_png(self.output / PREDICTIONS_FOLDER / f"{name}.png", strip)
                log.add_picture(name, strip, step)
        if score < self.position.best_score:
            self.position.best_score = score
            checkpoint.save_best(self.output, self.optimisation, step, row)
        return row
