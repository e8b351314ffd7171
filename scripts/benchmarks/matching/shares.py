"""Shares of pixels whose depth is near the expected one."""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from resdepth_colmap.scene import DepthMap

Pixels = npt.NDArray[np.bool_]


def relative_errors(
    depth: DepthMap, expected: DepthMap, where: Pixels
) -> npt.NDArray[np.float64]:
    """Differences from the expected depth, relative to it.

    Args:
        depth: Shape (H, W), in units; 0 = no depth, which is infinitely wrong.
        expected: Likewise, > 0 where it counts.
        where: The pixels that count, same shape.

    Returns:
        One error a pixel that counts, shape (N,).

    Raises:
        ValueError: If the shapes differ, or no pixel counts.
    """
    if not depth.shape == expected.shape == where.shape:
        shapes = [depth.shape, expected.shape, where.shape]
        raise ValueError(f"shapes of depth, expected depth and pixels differ: {shapes}")
    if not where.any():
        raise ValueError("no pixel counts.")
    true_depth = expected[where].astype(np.float64)
    found = depth[where].astype(np.float64)
    return np.where(found > 0, np.abs(found - true_depth) / true_depth, np.inf)


def shares_within(
    depth: DepthMap, expected: DepthMap, where: Pixels, limits: Sequence[float]
) -> dict[str, float]:
    """Shares of pixels whose depth is near the expected one.

    Args:
        depth: As in `relative_errors`.
        expected: Likewise.
        where: Likewise.
        limits: Largest differences, relative to the expected depth.

    Returns:
        Shares in 0..1 by limit, as "0.02", and the median error as "median".

    Raises:
        ValueError: If the shapes differ, or no pixel counts.
    """
    errors = relative_errors(depth, expected, where)
    shares = {f"{limit:g}": float((errors <= limit).mean()) for limit in limits}
    return {**shares, "median": float(np.median(errors))}


def mean_of(rows: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """The mean of each value over the maps."""
    return {key: float(np.mean([row[key] for row in rows])) for key in rows[0]}
