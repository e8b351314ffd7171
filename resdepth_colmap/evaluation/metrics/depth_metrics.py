"""How far a depth map is from the truth: the paper's figures, and shares of bad pixels.

Paper, section "Evaluation": mean absolute error, root mean square error and median
absolute error; residuals beyond a limit (10 m on ETH3D) are discarded first.
"""

import dataclasses
import math

import numpy as np
import numpy.typing as npt

from resdepth_colmap.evaluation.datasets.paper import PAPER_MAX_RESIDUAL
from resdepth_colmap.scene import DepthMap

_ROWS_AT_ONCE = 128


@dataclasses.dataclass(frozen=True, kw_only=True)
class DepthMetrics:
    """Errors of one depth map over the pixels whose true depth is known.

    Attributes:
        num_pixels: Pixels with a true depth, in the region.
        num_valid: Those of them that the errors are taken of.
        num_missing: Those of them that have no depth.
        num_discarded: Those of them whose residual is beyond the limit.
        mae: Mean absolute error, in workspace units; NaN without valid pixels.
        rmse: Root mean square error, in workspace units; likewise.
        medae: Median absolute error, in workspace units; likewise.
        bad_1: Share of `num_pixels` off by more than 1 % of the true depth, in 0..1;
            missing and discarded pixels are bad. NaN without pixels.
        bad_2: The same for 2 %.
        bad_1cm: The same for 0.01 workspace units, a centimetre where that is a metre.
        bad_2cm: The same for 0.02 units.
        bad_5cm: The same for 0.05 units.
    """

    num_pixels: int
    num_valid: int
    num_missing: int
    num_discarded: int
    mae: float
    rmse: float
    medae: float
    bad_1: float
    bad_2: float
    bad_1cm: float
    bad_2cm: float
    bad_5cm: float

    def to_mapping(self) -> dict[str, float | int | None]:
        """Plain values, ready for JSON: NaN becomes None."""
        values = dataclasses.asdict(self)
        return {key: None if math.isnan(v) else v for key, v in values.items()}


def depth_metrics(
    depth: DepthMap,
    truth: DepthMap,
    region: npt.NDArray[np.bool_] | None = None,
    max_residual: float | None = PAPER_MAX_RESIDUAL,
) -> DepthMetrics:
    """Compare a depth map with the truth.

    Args:
        depth: Shape (H, W), in workspace units; 0 = no depth.
        truth: True depth, same shape; 0 = not known, which is not counted.
        region: Where to compare, same shape; None = everywhere.
        max_residual: Absolute errors beyond it, in workspace units, are discarded from
            mean, RMS and median; None = none is.

    Raises:
        ValueError: If the shapes differ.
    """
    if depth.shape != truth.shape or (
        region is not None and region.shape != truth.shape
    ):
        shapes = [depth.shape, truth.shape, None if region is None else region.shape]
        raise ValueError(f"shapes of depth, truth and region differ: {shapes}.")
    known = truth > 0 if region is None else (truth > 0) & region
    true_depth = truth[known].astype(np.float64)
    estimate = depth[known].astype(np.float64)
    present = np.isfinite(estimate) & (estimate > 0)
    residual = np.abs(np.where(present, estimate, np.inf) - true_depth)
    limit = math.inf if max_residual is None else max_residual
    kept = present & (residual <= limit)
    return DepthMetrics(
        num_pixels=true_depth.size,
        num_valid=int(kept.sum()),
        num_missing=int((~present).sum()),
        num_discarded=int((present & ~kept).sum()),
        **_errors(residual[kept]),
        bad_1=_share(~kept | (residual > 0.01 * true_depth)),
        bad_2=_share(~kept | (residual > 0.02 * true_depth)),
        bad_1cm=_share(~kept | (residual > 0.01)),
        bad_2cm=_share(~kept | (residual > 0.02)),
        bad_5cm=_share(~kept | (residual > 0.05)),
    )


def median_filtered(depth: DepthMap, size: int = 5) -> DepthMap:
    """The paper's baseline: each depth becomes the median of its square window.

    Holes stay holes and are left out of the windows, as is what lies outside the map.
    Of an even number of values the lower middle one is taken, so that each result is
    the depth of some pixel and never a mean across an edge.

    Args:
        depth: Shape (H, W), in workspace units; 0 = no depth.
        size: Side of the window, in pixels; odd.

    Raises:
        ValueError: If the size is even or less than 1.
    """
    if size < 1 or size % 2 == 0:
        raise ValueError(f"{size=} but expected an odd number of pixels.")
    present = depth > 0
    padded = np.pad(np.where(present, depth, np.inf), size // 2, constant_values=np.inf)
    result = np.zeros_like(depth, dtype=np.float32)
    for top in range(0, depth.shape[0], _ROWS_AT_ONCE):
        bottom = min(top + _ROWS_AT_ONCE, depth.shape[0])
        band = padded[top : bottom + size - 1]
        result[top:bottom] = _lower_median(band, size)
    return np.where(present, result, np.float32(0))


def _lower_median(padded: DepthMap, size: int) -> DepthMap:
    windows = np.lib.stride_tricks.sliding_window_view(padded, (size, size))
    values = np.sort(windows.reshape(*windows.shape[:2], -1), axis=2)  # holes last
    middle = np.maximum(np.isfinite(values).sum(axis=2) - 1, 0) // 2
    median: DepthMap = np.take_along_axis(values, middle[..., np.newaxis], axis=2)
    return median[..., 0]


def _errors(residual: npt.NDArray[np.float64]) -> dict[str, float]:
    if not residual.size:
        return {"mae": math.nan, "rmse": math.nan, "medae": math.nan}
    return {
        "mae": float(residual.mean()),
        "rmse": float(np.sqrt(np.mean(residual**2))),
        "medae": float(np.median(residual)),
    }


def _share(is_bad: npt.NDArray[np.bool_]) -> float:
    return float(is_bad.mean()) if is_bad.size else math.nan
