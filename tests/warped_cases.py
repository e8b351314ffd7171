"""How well the true depth of a case carries its source into its reference."""

import numpy as np
import torch

from resdepth_colmap.evaluation.datasets.sample import DepthCase, source_from_reference
from resdepth_colmap.geometry.warp import warp_to_reference


def difference_when_warped(case: DepthCase, scale: float = 1.0) -> float:
    """Mean difference of the grey values, at `scale` times the true depth."""
    known = case.truth > 0
    inverse_depth = 1 / (scale * np.where(known, case.truth, 1))
    source = case.sources[0]
    warped, inside = warp_to_reference(
        torch.from_numpy(source.gray.astype(np.float64))[None, None],
        torch.from_numpy(inverse_depth.astype(np.float64))[None, None],
        torch.from_numpy(case.reference.K)[None],
        torch.from_numpy(source.K)[None],
        torch.from_numpy(source_from_reference(case.reference, source))[None],
    )
    counted = known & inside[0, 0].numpy()
    difference = np.abs(warped[0, 0].numpy() - case.reference.gray)[counted]
    return float(difference.mean())
