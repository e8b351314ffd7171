"""What the training minimises."""

import torch
from torch import Tensor

from resdepth_colmap.network.unet import Refinement

SMALL_ERROR = 0.02
"""Errors below this share of a tile's spread are in the logarithm's steep part."""

LOG_WEIGHT = 0.1
CONFIDENCE_WEIGHT = 0.05
LARGEST_ERROR = 8.0
"""Beyond it an error says no more about the scale that the confidence should have."""


def refinement_loss(
    refined: Refinement, target: Tensor, known: Tensor, weight: Tensor
) -> Tensor:
    """L1, a logarithmic term and the likelihood of the predicted scale.

    L1 (paper, section "Network Training") leaves pixels alone that are nearly right:
    its gradient there is noise among those of outliers. The logarithmic term rises
    steeply near zero, so that pixels that were right stay right. The predicted scale is
    that of a Laplace distribution; its gradient does not reach the depth.

    Args:
        refined: The network's output, normalised.
        target: True inverse depth, normalised alike, shape (B, 1, H, W).
        known: Where there is truth, shape (B, 1, H, W), bool.
        weight: Weight of each pixel's error, shape (B, 1, H, W).

    Returns:
        The mean over the known pixels, a scalar; 0 if there are none.
    """
    known_float = known.to(target.dtype)
    distance = (refined.inverse_depth - torch.where(known, target, 0.0)).abs()
    error = distance * weight
    value = error + LOG_WEIGHT * torch.log1p(error / SMALL_ERROR)
    if refined.log_scale is not None:
        seen = distance.detach().clamp(max=LARGEST_ERROR)
        log_scale = refined.log_scale.clamp(-8.0, 4.0)
        likelihood = seen * torch.exp(-log_scale) + log_scale
        value = value + CONFIDENCE_WEIGHT * likelihood
    return (value * known_float).sum() / known_float.sum().clamp(min=1.0)
