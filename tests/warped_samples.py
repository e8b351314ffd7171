"""How well the true depth of a sample warps its source into its reference."""

import numpy as np
import torch

from resdepth_colmap.evaluation.datasets.sample import DepthSample
from resdepth_colmap.geometry.warp import warp_to_reference
from resdepth_colmap.scene import cam_from_cam


def difference_when_warped(sample: DepthSample, scale: float = 1.0) -> float:
    """Mean difference of the grey values, at `scale` times the true depth."""
    known = sample.truth > 0
    inverse_depth = 1 / (scale * np.where(known, sample.truth, 1))
    source = sample.sources[0]
    warped, inside = warp_to_reference(
        torch.from_numpy(source.gray.astype(np.float64))[None, None],
        torch.from_numpy(inverse_depth.astype(np.float64))[None, None],
        torch.from_numpy(sample.reference.K)[None],
        torch.from_numpy(source.K)[None],
        torch.from_numpy(cam_from_cam(source, sample.reference))[None],
    )
    counted = known & inside[0, 0].numpy()
    difference = np.abs(warped[0, 0].numpy() - sample.reference.gray)[counted]
    return float(difference.mean())
