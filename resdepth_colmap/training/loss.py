"""The loss of the training."""

from typing import NamedTuple

import torch
from torch import Tensor

from resdepth_colmap.network.unet import Refinement
from resdepth_colmap.training.config import TrainConfig
from resdepth_colmap.training.data.batches import Batch

SMALL_ERROR = 0.02
"""Error, over the spread of the tile, up to which the logarithmic term is steep."""

LARGEST_ERROR = 8.0
"""Error, over the spread of the tile, beyond which the likelihood no longer grows."""

DISTANCE_RATIOS = (0.25, 3.0)
"""Range of the refined depth, over the depth of the tile, that weights errors."""


class LossSum(NamedTuple):
    """A loss to add up over processes; the loss is `total / num_known`.

    Attributes:
        total: Sum over the pixels whose truth is known, a scalar with gradient.
        num_known: Number of these pixels, a scalar.
    """

    total: Tensor
    num_known: Tensor


def refinement_loss(refined: Refinement, batch: Batch, config: TrainConfig) -> LossSum:
    """L1, a logarithmic term and the likelihood of the predicted scale.

    L1 (paper, section "Network Training") has hardly any effect on pixels that are
    nearly right: the gradients of outliers dominate. The logarithmic term rises steeply
    near zero and keeps them right. The predicted scale is that of a Laplace
    distribution; its gradient does not reach the depth.

    Errors are weighted by the refined depth, not by the true one: a pixel that can
    belong to either of two surfaces then goes to the likelier, while weights that grow
    with the true depth would draw it to the farther (docs/adr/0015).

    Args:
        refined: The network's output, normalised.
        batch: Ground truth and weights, normalised alike.
        config: Weights of the terms; a term without weight is not computed.
    """
    known = batch.known.to(batch.target.dtype)
    truth = torch.where(batch.known, batch.target, 0.0)
    distance = (refined.inverse_depth - truth).abs()
    error = distance * _distance_weight(refined, batch, config.distance_power)
    value = error
    if config.log_weight:
        value = value + config.log_weight * torch.log1p(error / SMALL_ERROR)
    if config.confidence_weight and refined.log_scale is not None:
        seen = distance.detach().clamp(max=LARGEST_ERROR)
        log_scale = refined.log_scale.clamp(-8.0, 4.0)
        likelihood = seen * torch.exp(-log_scale) + log_scale
        value = value + config.confidence_weight * likelihood
    return LossSum((value * known * batch.importance).sum(), known.sum())


def _distance_weight(refined: Refinement, batch: Batch, power: float) -> Tensor:
    """The refined depth over that of the tile, to a power; without gradient."""
    near, far = DISTANCE_RATIOS
    inverse_depth = batch.scaling.restore(refined.inverse_depth.detach())
    inverse_ratio = inverse_depth / batch.scaling.offset
    return inverse_ratio.clamp(1.0 / far, 1.0 / near) ** -power
