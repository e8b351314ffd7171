"""One optimiser step: loss, gradients, new weights."""

import math

import torch
from torch import Tensor, nn
from torch.nn.parallel import DistributedDataParallel

from resdepth_colmap.errors import TrainingError
from resdepth_colmap.network.unet import Refinement, ResDepthNet, SampleSource
from resdepth_colmap.training.config import (
    Optimiser,
    Precision,
    Schedule,
    TrainConfig,
)
from resdepth_colmap.training.data.batches import Batch
from resdepth_colmap.training.distributed import Ranks
from resdepth_colmap.training.loss import refinement_loss
from resdepth_colmap.training.synced_norm import sync_norms

WARM_UP_SHARE = 0.05


class Optimisation:
    """A network in training, on the device of this process.

    Args:
        network: The network.
        config: Options of the training.
        ranks: The processes.
    """

    def __init__(  # noqa: D107
        self, network: ResDepthNet, config: TrainConfig, ranks: Ranks
    ) -> None:
        self.config, self.ranks = config, ranks
        self.network = network.to(ranks.device)
        _freeze(network, config)
        self._model: nn.Module = network
        if ranks.count > 1:
            sync_norms(network)
            self._model = DistributedDataParallel(network)
        else:
            network.to(memory_format=torch.channels_last)  # type: ignore[call-overload] # torch's stubs lack the keyword
        kinds = {Optimiser.ADAM: torch.optim.Adam, Optimiser.ADAMW: torch.optim.AdamW}
        self.optimiser = kinds[config.optimiser](
            [value for value in network.parameters() if value.requires_grad],
            lr=config.learning_rate,
            weight_decay=config.weight_decay,
        )
        self.schedule = _schedule(self.optimiser, config)

    @property
    def learning_rate(self) -> float:
        """Learning rate of the next step."""
        return float(self.optimiser.param_groups[0]["lr"])

    def step(self, batch: Batch, wants_stop: bool = False) -> tuple[float, bool]:
        """Take a step.

        Args:
            batch: The part of the batch of this process.
            wants_stop: Whether this process is to stop.

        Returns:
            The loss over the batch of all processes; and whether any is to stop.

        Raises:
            TrainingError: If loss or gradients are not finite. Only the running
                statistics of the norms have changed then.
        """
        self._model.train()
        _freeze(self.network, self.config)
        batch = batch.to(self.ranks.device)
        inputs = batch.inputs.contiguous(memory_format=torch.channels_last)
        loss = refinement_loss(
            self._refined(inputs, batch.sample_source), batch, self.config
        )
        total, num_known, num_stops = self.ranks.summed(
            [float(loss.total.detach()), float(loss.num_known), float(wants_stop)]
        )
        value = total / max(num_known, 1.0)
        self._check_finite("loss", value, batch)
        self.optimiser.zero_grad(set_to_none=True)
        # The gradients are averaged over the processes: times count, they are summed.
        mean = loss.total * (self.ranks.count / max(num_known, 1.0))
        mean.backward()  # type: ignore[no-untyped-call] # torch's own
        limit = self.config.largest_gradient or math.inf
        norm = nn.utils.clip_grad_norm_(self.network.parameters(), limit)
        self._check_finite("gradient", float(norm), batch)
        self.optimiser.step()
        self.schedule.step()
        return value, num_stops > 0

    def _refined(self, inputs: Tensor, sample_source: SampleSource) -> Refinement:
        """The network's output in single precision, whatever the precision inside."""
        halved = self.config.precision is Precision.BFLOAT16
        with torch.autocast(inputs.device.type, torch.bfloat16, enabled=halved):
            inverse_depth, log_scale = self._model(inputs, sample_source)
        return Refinement(
            inverse_depth.float(), None if log_scale is None else log_scale.float()
        )

    def _check_finite(self, what: str, value: float, batch: Batch) -> None:
        if not math.isfinite(value):
            raise TrainingError(
                f"the {what} is {value}; the batch: {', '.join(batch.names)}"
            )


def _freeze(network: ResDepthNet, config: TrainConfig) -> None:
    """Frozen parts get no gradients and keep their running statistics."""
    for module in network.modules():
        if config.freeze_norms and isinstance(module, nn.BatchNorm2d):
            module.eval()
    for name, child in network.named_children():
        if config.freeze_unet and name != "propagation":
            child.eval().requires_grad_(False)


def _schedule(
    optimiser: torch.optim.Optimizer, config: TrainConfig
) -> torch.optim.lr_scheduler.LRScheduler:
    if config.schedule is Schedule.CONSTANT:
        return torch.optim.lr_scheduler.ConstantLR(optimiser, factor=1.0)
    return torch.optim.lr_scheduler.OneCycleLR(
        optimiser,
        max_lr=config.learning_rate,
        total_steps=config.steps + 1,
        pct_start=WARM_UP_SHARE,
    )
