"""Metrics of the maps of one view: reference-free ones, and against ground truth.

No reference-free metric is an accuracy: sparse points are few and lie where matching is
easy, maps with the same error agree with each other, and a wrong depth on a plain wall
looks like the right one. Where holes matter, a metric exists twice: over the pixels
that the method covers, and over those that every method covers ("common").
"""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from resdepth_colmap.evaluation.metrics.view_maps import TileSums, ViewMaps, with_common
from resdepth_colmap.geometry.projection import lift, look_up, transform
from resdepth_colmap.io.colmap.model import SparsePoints
from resdepth_colmap.scene import DepthMap, cam_from_cam

Flags = npt.NDArray[np.bool_]
Sums = dict[str, TileSums]
"""By measure."""

WITHIN = 0.01
"""Largest relative difference of two depths that agree."""

MAX_NUM_PIXELS = 200_000
"""Approximate number of pixels that are reprojected into the neighbours."""


def coverage(maps: ViewMaps) -> dict[str, Sums]:
    """Share of pixels with a depth, by method."""
    everywhere = np.ones(maps.shape)
    return {
        method: {"coverage": TileSums.of(depth > 0, everywhere)}
        for method, depth in maps.depths.items()
    }


def against_truth(maps: ViewMaps, truth: DepthMap) -> dict[str, Sums]:
    """Shares of pixels near the true depth, shape (H, W), 0 = unknown, by method."""
    known = truth > 0
    common = known & maps.common
    found: dict[str, Sums] = {}
    for method, depth in maps.depths.items():
        found[method] = {}
        for name, tolerance in (("right_1", 0.01), ("right_2", 0.02)):
            right = (depth > 0) & (np.abs(depth - truth) <= tolerance * truth)
            found[method][name] = TileSums.of(right, known)
            found[method][f"{name}_common"] = TileSums.of(right, common)
    return found


def sparse_points(maps: ViewMaps, points: SparsePoints) -> dict[str, Sums]:
    """Share of the sparse points of a view that lie on its map, by method.

    The points are split into two halves by the parity of their ids: a difference has to
    show in both. The pipeline takes source views and depth ranges from the points, but
    no depth.
    """
    indices = points.seen_by(maps.view.image_id)
    if not indices.size:
        return {}
    xyz = transform(maps.view.cam_from_world, points.xyz[indices])
    inside, pixels = look_up(xyz, maps.K, maps.shape)
    z = xyz[inside, 2]
    parity = points.ids[indices[inside]] % 2
    common = maps.common.ravel()[pixels]
    found: dict[str, Sums] = {}
    for method, depth in maps.depths.items():
        at_point = depth.ravel()[pixels]
        is_near = (at_point > 0) & (np.abs(at_point - z) <= WITHIN * z)
        found[method] = {}
        for half, name in enumerate(("points_even", "points_odd")):
            in_half = parity == half
            for suffix, counted in (("", in_half), ("_common", in_half & common)):
                found[method][name + suffix] = _sums_at(
                    pixels[counted], is_near[counted], maps.shape
                )
    return found


def agreement(maps: ViewMaps, neighbours: Sequence[ViewMaps]) -> dict[str, Sums]:
    """Consistency with the maps of neighbouring views, by method.

    Of a large map, every second or third pixel per axis is reprojected.
    """
    step = max(1, round((maps.shape[0] * maps.shape[1] / MAX_NUM_PIXELS) ** 0.5))
    everywhere = np.zeros(maps.shape, np.bool_)
    everywhere[step // 2 :: step, step // 2 :: step] = True
    totals = {method: np.zeros((4, *maps.shape)) for method in maps.depths}
    for other in neighbours:
        looked_up = {
            method: _look_up(maps, other, method, everywhere) for method in totals
        }
        in_all = np.logical_and.reduce([seen for seen, _ in looked_up.values()])
        for method, (seen, agrees) in looked_up.items():
            totals[method] += np.stack([agrees, seen, agrees & in_all, in_all])
    return {
        method: {
            **with_common("agreement", total),
            "consistent": TileSums.of(total[0] > 0, everywhere),
        }
        for method, total in totals.items()
    }


def _look_up(
    maps: ViewMaps, other: ViewMaps, method: str, asked: Flags
) -> tuple[Flags, Flags]:
    """Where the map of a neighbour has a depth for a pixel, and where it agrees."""
    depth = maps.depths[method]
    pixels = np.flatnonzero(asked & (depth > 0))
    xyz = lift(pixels, depth, maps.K)
    xyz_there = transform(cam_from_cam(other.view, maps.view), xyz)
    points, pixels_there = look_up(xyz_there, other.K, other.shape)
    there = other.depths[method].ravel()[pixels_there]
    agrees = np.abs(there - xyz_there[points, 2]) <= WITHIN * there
    seen_map, agrees_map = np.zeros((2, *depth.shape), np.bool_)
    seen_map.ravel()[pixels[points]] = there > 0
    agrees_map.ravel()[pixels[points]] = (there > 0) & agrees
    return seen_map, agrees_map


def _sums_at(
    pixels: npt.NDArray[np.int64], good: Flags, shape: tuple[int, int]
) -> TileSums:
    size = shape[0] * shape[1]
    sums = np.bincount(pixels, weights=good, minlength=size)
    counts = np.bincount(pixels, minlength=size)
    return TileSums.of(sums.reshape(shape), counts.reshape(shape))


def merged(parts: Sequence[Mapping[str, Sums]]) -> dict[str, Sums]:
    """The union of several groups of measures, by method."""
    found: dict[str, Sums] = {}
    for part in parts:
        for method, sums in part.items():
            found.setdefault(method, {}).update(sums)
    return found
