"""What speaks for a depth map where its truth is not known, and what truth says of it.

None of the witnesses is an accuracy: sparse points are few and lie where matching is
easy, maps that are wrong alike agree with each other, and a wrong depth on a plain wall
looks like the right one. Each is one number a view, more of it is better, and each
exists twice where holes matter: over what the arm covers, and over the same pixels,
those that every arm covers ("common").
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from resdepth_colmap.evaluation.compare.method_maps import ViewMaps
from resdepth_colmap.evaluation.metrics.tile_sums import TileSums
from resdepth_colmap.geometry.projection import pixel_rays, project, transform
from resdepth_colmap.io.colmap.sparse_points import SparsePoints
from resdepth_colmap.scene import DepthMap, Matrix, cam_from_cam

Flags = npt.NDArray[np.bool_]
Sums = dict[str, TileSums]
"""By the name of the measure."""

WITHIN = 0.01
"""Relative difference of two depths that say the same."""

MOST_LOOKED_UP = 200_000
"""Pixels of a view that are looked up in its neighbours' maps, about."""


def coverage(maps: ViewMaps) -> dict[str, Sums]:
    """How much of a view has a depth, by arm."""
    everywhere = np.ones(maps.shape)
    return {
        method: {"coverage": TileSums.of(depth > 0, everywhere)}
        for method, depth in maps.depths.items()
    }


def against_truth(maps: ViewMaps, truth: DepthMap) -> dict[str, Sums]:
    """Which pixels are right, by arm.

    Args:
        maps: The view.
        truth: Its true depth, of the size of the maps, shape (H, W); 0 = not known.
    """
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
    """Which of the sparse points that a view saw its maps run through, by arm.

    Two halves, by the parity of the ids: what one half says, the other has to confirm.
    The pipeline takes neighbours and depth ranges from all of them, but no depth.
    """
    places = points.seen_by(maps.view.image_id)
    if not places.size:
        return {}
    pixels, z, inside = _pixels(points.xyz[places], maps)
    parity = points.ids[places[inside]] % 2
    common = maps.common.ravel()[pixels]
    found: dict[str, Sums] = {}
    for method, depth in maps.depths.items():
        at_point = depth.ravel()[pixels]
        is_near = (at_point > 0) & (np.abs(at_point - z) <= WITHIN * z)
        found[method] = {}
        for half, name in enumerate(("points_even", "points_odd")):
            for suffix, kept in (("", parity == half), ("_common", common)):
                counted = kept & (parity == half)
                found[method][name + suffix] = _sums_at(
                    pixels[counted], is_near[counted], maps.shape
                )
    return found


def agreement(maps: ViewMaps, neighbours: Sequence[ViewMaps]) -> dict[str, Sums]:
    """Whether the neighbours' maps of the same arm say the same depth, by arm.

    Of large maps every second or third pixel in a row and column is looked up.
    """
    step = max(1, round((maps.shape[0] * maps.shape[1] / MOST_LOOKED_UP) ** 0.5))
    everywhere = np.zeros(maps.shape, np.bool_)
    everywhere[step // 2 :: step, step // 2 :: step] = True
    totals = {method: _Agreement(maps.shape) for method in maps.depths}
    for other in neighbours:
        looked_up = {
            method: _look_up(maps, other, method, everywhere) for method in totals
        }
        in_all = np.logical_and.reduce([seen for seen, _ in looked_up.values()])
        for method, (seen, agrees) in looked_up.items():
            totals[method].add(seen, agrees, in_all)
    return {
        method: {
            "agreement": TileSums.of(total.num_agreeing, total.num_seen),
            "agreement_common": TileSums.of(total.num_agreeing_all, total.num_seen_all),
            "confirmed": TileSums.of(total.num_agreeing > 0, everywhere),
        }
        for method, total in totals.items()
    }


@dataclasses.dataclass(eq=False)
class _Agreement:
    """Of each pixel, how many neighbours have a depth there and how many agree."""

    shape: tuple[int, int]

    def __post_init__(self) -> None:
        self.num_seen = np.zeros(self.shape)
        self.num_agreeing = np.zeros(self.shape)
        self.num_seen_all = np.zeros(self.shape)
        self.num_agreeing_all = np.zeros(self.shape)

    def add(self, seen: Flags, agrees: Flags, in_all: Flags) -> None:
        self.num_seen += seen
        self.num_agreeing += agrees
        self.num_seen_all += in_all
        self.num_agreeing_all += agrees & in_all


def _look_up(
    maps: ViewMaps, other: ViewMaps, method: str, asked: Flags
) -> tuple[Flags, Flags]:
    """Where a neighbour's map has a depth for a pixel, and where it is the same."""
    depth = maps.depths[method]
    row, column = np.nonzero(asked & (depth > 0))
    rays = pixel_rays(np.stack([column, row], axis=-1), maps.K)
    xyz = rays * depth[row, column, np.newaxis]
    xyz = transform(cam_from_cam(other.view, maps.view), xyz)
    xy, z = project(xyz, other.K)
    pixels, inside = _inside(xy, z, other.shape)
    there = other.depths[method].ravel()[pixels]
    agrees = np.abs(there - z[inside]) <= WITHIN * there
    row, column = row[inside], column[inside]
    seen_map, agrees_map = np.zeros((2, *depth.shape), np.bool_)
    seen_map[row, column] = there > 0
    agrees_map[row, column] = (there > 0) & agrees
    return seen_map, agrees_map


def _pixels(
    xyz_in_world: Matrix, maps: ViewMaps
) -> tuple[npt.NDArray[np.int64], Matrix, Flags]:
    """The pixels of points, their depths, and which of the points these are."""
    xy, z = project(transform(maps.view.cam_from_world, xyz_in_world), maps.K)
    pixels, inside = _inside(xy, z, maps.shape)
    return pixels, z[inside], inside


def _inside(
    xy: Matrix, z: Matrix, shape: tuple[int, int]
) -> tuple[npt.NDArray[np.int64], Flags]:
    """Flat indices of the pixels of those points that lie in front of the map."""
    height_px, width_px = shape
    column, row = np.rint(xy.clip(-1e6, 1e6)).astype(np.int64).T
    inside = (z > 0) & (column >= 0) & (row >= 0)
    inside &= (column < width_px) & (row < height_px)
    return row[inside] * width_px + column[inside], inside


def _sums_at(
    pixels: npt.NDArray[np.int64], good: Flags, shape: tuple[int, int]
) -> TileSums:
    size = shape[0] * shape[1]
    sums = np.bincount(pixels, weights=good, minlength=size)
    counts = np.bincount(pixels, minlength=size)
    return TileSums.of(sums.reshape(shape), counts.reshape(shape))


def merged(parts: Sequence[Mapping[str, Sums]]) -> dict[str, Sums]:
    """The measures of several witnesses as one, by arm."""
    found: dict[str, Sums] = {}
    for part in parts:
        for method, sums in part.items():
            found.setdefault(method, {}).update(sums)
    return found
