"""How far a depth map agrees with maps of another program, where those can be trusted.

Where no truth is known, a pixel of a map counts as right if the map of another view
says so: both were matched independently of each other.
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.geometry.projection import back_project, project, transform
from resdepth_colmap.scene import DepthMap, View, cam_from_cam

Pixels = npt.NDArray[np.bool_]


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class ViewMap:
    """The depth map of a view.

    Attributes:
        view: The view.
        depth: Shape (H, W), in units; 0 = no depth.
    """

    view: View
    depth: DepthMap


def num_confirming(
    reference: ViewMap, others: Sequence[ViewMap], limit: float
) -> npt.NDArray[np.int64]:
    """How many maps of other views say the same as that of the reference.

    A pixel is lifted by its depth and seen in the other view; the depth of the nearest
    pixel there is compared with that of the point.

    Args:
        reference: The map whose pixels are confirmed.
        others: The maps of other views.
        limit: Largest difference of the depths, relative to that of the point.

    Returns:
        Shape (H, W); 0 where the reference has no depth.
    """
    found = np.zeros(reference.depth.shape, np.int64)
    for other in others:
        found += _confirmed_by(reference, other, limit)
    return found


def confirmed(reference: ViewMap, others: Sequence[ViewMap], limit: float) -> Pixels:
    """Where the map of any other view does: see `num_confirming`."""
    return num_confirming(reference, others, limit) > 0


def _confirmed_by(reference: ViewMap, other: ViewMap, limit: float) -> Pixels:
    expected, seen = depths_seen(reference, other)
    return np.asarray((seen > 0) & (np.abs(seen - expected) <= limit * expected))


def depths_seen(
    reference: ViewMap, other: ViewMap
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Which depth a map's points have in another view, and which its map says there.

    Args:
        reference: The map whose pixels are lifted.
        other: That in whose nearest pixel each is looked up.

    Returns:
        Expected and seen depth in the other view, shape (H, W) of the reference; both 0
        where the reference has no depth, its point lies outside or behind the other
        view, or that has no depth there.
    """
    has_depth = reference.depth > 0
    points = back_project(reference.depth, _map_K(reference))[has_depth]
    xyz = transform(cam_from_cam(other.view, reference.view), points)
    xy, z = project(xyz, _map_K(other))
    height_px, width_px = other.depth.shape
    # Far off an image are pixels that no integer holds.
    column, row = np.rint(xy.clip(-1e6, 1e6)).astype(np.int64).T
    inside = (z > 0) & (column >= 0) & (column < width_px)
    inside &= (row >= 0) & (row < height_px)
    depths = np.zeros(len(z))
    depths[inside] = other.depth[row[inside], column[inside]]
    expected, seen = (np.zeros(reference.depth.shape) for _ in range(2))
    expected[has_depth] = np.where(depths > 0, z, 0.0)
    seen[has_depth] = depths
    return expected, seen


def _map_K(view_map: ViewMap) -> npt.NDArray[np.float64]:  # noqa: N802
    """K of the index coordinates of a map, which may be smaller than its image."""
    height_px, width_px = view_map.depth.shape
    return index_K(view_map.view.camera.resized(width_px, height_px))


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
