"""Batch norm over the batch of all processes, on CPUs too (torch's is for GPUs only).

Several processes then train as one process with their batches together.
"""

from typing import Any, cast

import torch
from torch import Tensor, distributed, nn


class SyncedBatchNorm(nn.BatchNorm2d):
    """`nn.BatchNorm2d` with mean and variance over all processes."""

    def forward(self, values: Tensor) -> Tensor:
        """Normalise a batch, shape (B, C, H, W)."""
        if not self.training:
            return super().forward(values)
        channels = values.shape[1]
        local = values.new_full((1,), values.numel() / channels)
        sums = _summed(torch.cat([values.sum(dim=(0, 2, 3)), local]))
        count = sums[-1].detach()
        mean = sums[:-1] / count
        centred = values - mean[:, None, None]
        variance = _summed(centred.square().sum(dim=(0, 2, 3))) / count
        self._remember(mean.detach(), variance.detach() * count / (count - 1))
        scale = self.weight * torch.rsqrt(variance + self.eps)
        return centred * scale[:, None, None] + self.bias[:, None, None]

    @torch.no_grad()
    def _remember(self, mean: Tensor, variance: Tensor) -> None:
        momentum = cast(float, self.momentum)
        cast(Tensor, self.running_mean).lerp_(mean, momentum)
        cast(Tensor, self.running_var).lerp_(variance, momentum)
        cast(Tensor, self.num_batches_tracked).add_(1)


def sync_norms(network: nn.Module) -> None:
    """Replace each batch norm of a network; weights and their names stay."""
    for module in list(network.modules()):
        for name, child in module.named_children():
            if type(child) is nn.BatchNorm2d:
                synced = SyncedBatchNorm(child.num_features, child.eps, child.momentum)
                synced.load_state_dict(child.state_dict())
                setattr(module, name, synced.to(child.weight.device))


class _Sum(torch.autograd.Function):
    """The sum over all processes; the gradient is the sum over all processes too."""

    @staticmethod
    def forward(_context: Any, values: Tensor) -> Tensor:
        total = values.clone()
        distributed.all_reduce(total)
        return total

    @staticmethod
    def backward(_context: Any, *gradients: Tensor) -> Tensor:
        total = gradients[0].clone()
        distributed.all_reduce(total)
        return total


def _summed(values: Tensor) -> Tensor:
    return cast(Tensor, _Sum.apply(values))  # type: ignore[no-untyped-call] # torch's own
