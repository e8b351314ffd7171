"""Edges of the depth where the photo has them (docs/adr/0014)."""

import numpy as np
import torch
from torch import Tensor

from resdepth_colmap.geometry.guided_median import guided_median
from resdepth_colmap.pipeline.inputs import ViewTensors

LEAST_ERROR = 0.003
"""Relative error that a pixel is taken to have at least: none is certain."""


def follow_edges(refined: Tensor, error: Tensor | None, tensors: ViewTensors) -> Tensor:
    """Near edges of depth, the median of what has the pixel's colour.

    Args:
        refined: Inverse depth of one view, shape (1, 1, H, W), > 0, in 1/unit.
        error: Its expected error, likewise; the surer of two pixels weighs more (by the
            square root of the ratio). None = all weigh alike.
        tensors: The view; a grey photo guides by its grey values.

    Returns:
        Like `refined`, on its device.
    """
    photo = tensors.gray if tensors.colors is None else tensors.colors
    weights = torch.ones_like(refined)
    if error is not None:
        weights = (error / refined + LEAST_ERROR) ** -0.5
    followed = guided_median(
        refined[0, 0].cpu().numpy(),
        np.moveaxis(photo[0].cpu().numpy(), 0, -1),
        weights[0, 0].cpu().numpy(),
    )
    return torch.from_numpy(followed)[None, None].to(refined)
