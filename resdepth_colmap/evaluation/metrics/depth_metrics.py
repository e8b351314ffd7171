"""Errors of a depth map: those of the paper, and shares of bad pixels; edges apart.

Paper, section "Evaluation": mean absolute error, root mean square error and median
absolute error, after residuals beyond a limit (10 m on ETH3D) have been discarded.
"""

import dataclasses
import math
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt
from scipy.ndimage import maximum_filter, minimum_filter

from resdepth_colmap.evaluation.datasets.paper import PAPER_MAX_RESIDUAL
from resdepth_colmap.scene import DepthMap

_ROWS_AT_ONCE = 128


class Residuals(NamedTuple):
    """Absolute errors of the pixels with a true depth, each of shape (N,).

    Attributes:
        truth: True depth, float64, in units.
        errors: In units, float64; infinite without a depth.
        is_valid: Which errors are finite and within the limit.
    """

    truth: npt.NDArray[np.float64]
    errors: npt.NDArray[np.float64]
    is_valid: npt.NDArray[np.bool_]

    @property
    def valid(self) -> npt.NDArray[np.float64]:
        """The valid errors, shape (M,)."""
        return self.errors[self.is_valid]

    def bad_share(self, limits: npt.NDArray[np.float64] | float) -> float:
        """Share of invalid pixels and of errors beyond limits in units; NaN of none."""
        is_bad = ~self.is_valid | (self.errors > limits)
        return float(is_bad.mean()) if is_bad.size else math.nan


@dataclasses.dataclass(frozen=True, kw_only=True)
class DepthMetrics:
    """Errors of one depth map over the pixels with a true depth.

    Attributes:
        num_pixels: Number of pixels with a true depth, in the region.
        num_valid: Number of those that the errors are computed from.
        num_missing: Number of those without a depth.
        num_discarded: Number of those whose residual is beyond the limit.
        mae: Mean absolute error, in workspace units; NaN without valid pixels.
        rmse: Root mean square error, likewise.
        medae: Median absolute error, likewise.
        bad_1: Share of `num_pixels` off by more than 1 % of the true depth, in 0..1;
            missing and discarded pixels are bad. NaN without pixels.
        bad_2: The same for 2 %.
        bad_1cm: The same for 0.01 workspace units; bad_2cm, bad_5cm likewise.
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

    @classmethod
    def of(cls, residuals: Residuals) -> Self:
        """The errors, each computed from all residuals."""
        truth, errors, is_valid = residuals
        valid = residuals.valid
        return cls(
            num_pixels=errors.size,
            num_valid=valid.size,
            num_missing=int(np.isinf(errors).sum()),
            num_discarded=int((np.isfinite(errors) & ~is_valid).sum()),
            mae=float(valid.mean()) if valid.size else math.nan,
            rmse=float(np.sqrt(np.mean(valid**2))) if valid.size else math.nan,
            medae=float(np.median(valid)) if valid.size else math.nan,
            bad_1=residuals.bad_share(0.01 * truth),
            bad_2=residuals.bad_share(0.02 * truth),
            bad_1cm=residuals.bad_share(0.01),
            bad_2cm=residuals.bad_share(0.02),
            bad_5cm=residuals.bad_share(0.05),
        )

    def to_mapping(self) -> dict[str, float | int | None]:
        """Plain values, ready for JSON; NaN becomes None."""
        values = dataclasses.asdict(self)
        return {key: None if math.isnan(v) else v for key, v in values.items()}


def depth_metrics(
    depth: DepthMap,
    truth: DepthMap,
    region: npt.NDArray[np.bool_] | None = None,
    max_residual: float | None = PAPER_MAX_RESIDUAL,
) -> DepthMetrics:
    """The errors of a depth map; see `find_residuals`."""
    return DepthMetrics.of(find_residuals(depth, truth, region, max_residual))


def find_residuals(
    depth: DepthMap,
    truth: DepthMap,
    region: npt.NDArray[np.bool_] | None = None,
    max_residual: float | None = PAPER_MAX_RESIDUAL,
) -> Residuals:
    """Compare a depth map with the ground truth; ValueError if the shapes differ.

    Args:
        depth: Shape (H, W), in workspace units; 0 = no depth.
        truth: True depth, same shape; 0 = unknown, which does not count.
        region: Where to compare, same shape; None = everywhere.
        max_residual: Absolute errors beyond it, in workspace units, are invalid; None =
            no limit.
    """
    shapes = [it.shape for it in (depth, truth, region) if it is not None]
    if len(set(shapes)) > 1:
        raise ValueError(f"shapes of depth, truth and region differ: {shapes}.")
    known = truth > 0 if region is None else (truth > 0) & region
    true_depth = truth[known].astype(np.float64)
    estimate = depth[known].astype(np.float64)
    present = np.isfinite(estimate) & (estimate > 0)
    errors = np.abs(np.where(present, estimate, np.inf) - true_depth)
    limit = math.inf if max_residual is None else max_residual
    return Residuals(true_depth, errors, present & (errors <= limit))


def median_filtered(depth: DepthMap, size: int = 5) -> DepthMap:
    """The baseline of the paper: the median of the square window of each pixel.

    Holes stay holes; windows leave out holes and what lies outside of the map. The
    median of an even number of values is the lower of the middle two, so it is always
    the depth of a pixel and never a mean across an edge.

    Args:
        depth: Shape (H, W), in workspace units; 0 = no depth.
        size: Side of the window, in pixels; odd, else ValueError.
    """
    if size < 1 or size % 2 == 0:
        raise ValueError(f"{size=} but expected an odd number of pixels.")
    present = depth > 0
    padded = np.pad(np.where(present, depth, np.inf), size // 2, constant_values=np.inf)
    result = np.zeros_like(depth, dtype=np.float32)
    for top in range(0, depth.shape[0], _ROWS_AT_ONCE):
        bottom = min(top + _ROWS_AT_ONCE, depth.shape[0])
        band = padded[top : bottom + size - 1]
        windows = np.lib.stride_tricks.sliding_window_view(band, (size, size))
        values = np.sort(windows.reshape(*windows.shape[:2], -1), axis=2)  # holes last
        middle = np.maximum(np.isfinite(values).sum(axis=2, keepdims=True) - 1, 0) // 2
        result[top:bottom] = np.take_along_axis(values, middle, axis=2)[..., 0]
    return np.where(present, result, np.float32(0))


EDGE_RADIUS_PX = 4
EDGE_RATIO = 1.1
"""Least ratio of true depths across an edge."""


def edge_region(truth: DepthMap) -> npt.NDArray[np.bool_]:
    """Pixels near a depth discontinuity: a ratio of 1.1 within 9 x 9 pixels.

    A floor at a grazing angle changes by 1 % per pixel, so it is no edge. Laser scans
    have holes along edges; the window reaches across them.

    Args:
        truth: True depth, shape (H, W), in units; 0 = unknown, which is False.
    """
    known = truth > 0
    size = 2 * EDGE_RADIUS_PX + 1
    nearest = minimum_filter(np.where(known, truth, np.inf), size, mode="nearest")
    farthest = maximum_filter(np.where(known, truth, 0), size, mode="nearest")
    return np.asarray(known & (farthest > EDGE_RATIO * nearest))
