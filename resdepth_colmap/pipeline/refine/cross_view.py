"""What the depth maps of other views say of a view's own."""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch

from resdepth_colmap.geometry.completion import complete_from_background
from resdepth_colmap.geometry.forward_warp import reproject_inverse_depth
from resdepth_colmap.geometry.inverse_depth import invert_map
from resdepth_colmap.pipeline.refine.network_inputs import initial_maps
from resdepth_colmap.scene import DepthMap, FloatMap, Matrix, Wanted, projection_center

FILTERED_SHARE = 0.95
"""A map with less of its pixels filled has been filtered."""

NUM_SOURCE_MAPS = 4
"""Other views whose maps are looked at."""

CONSISTENT_CHANGE = 0.02
CONSISTENT_PX = 1.0
"""Another view's map confirms a depth that is off by less than that relatively, or by
less than that in its image: with a short baseline, two percent are less than anyone can
match (COLMAP's geometric consistency allows 1 px there and back)."""


Counts = npt.NDArray[np.uint8]

LEAST_CONSISTENT_SHARE = 0.05
"""Maps that confirm less of a map are of another scene, or of failed pairs."""


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class SourceMap:
    """The depth map of another view.

    Attributes:
        depth: Of any size, shape (Hs, Ws), in units; 0 = hole.
        K: K for index coordinates at that size, shape (3, 3), in pixels.
        source_from_reference: Pose, shape (3, 4), translation in units.
    """

    depth: DepthMap
    K: Matrix
    source_from_reference: Matrix


class Start(NamedTuple):
    """What the refinement of a view starts from.

    Attributes:
        inverse_depth: Complete, shape (H, W), float32, in 1/unit.
        valid: Where it was measured, and consistent with another map if there are any,
            shape (H, W).
        reprojected: The maps of other views, reprojected, shape (H, W), float32, in
            1/unit; 0 = nothing. None = there are no maps that are of any use.
        num_consistent: How many of them say the same as was measured, shape (H, W);
            likewise.
        is_filtered: Whether the map has so many holes that it must have been filtered.
    """

    inverse_depth: FloatMap
    valid: npt.NDArray[np.bool_]
    reprojected: FloatMap | None = None
    num_consistent: Counts | None = None
    is_filtered: bool = False


def start_from(
    depth: DepthMap,
    K: Matrix,
    maps: Sequence[SourceMap],
    wanted: Wanted | None = None,
) -> Start:
    """Complete a depth map, and compare it with those of other views.

    In an unfiltered map only what another one confirms is taken for measured; the rest
    is completed from the background. In a filtered one all that is there was confirmed
    before; its holes take what other views measured there.

    Args:
        depth: Initial depth, shape (H, W), in units; 0 = hole.
        K: K for index coordinates, shape (3, 3), in pixels.
        maps: Those of other views, the first that of the best; may be empty.
        wanted: Pixels that should have a depth, shape (H, W): others tell nothing of a
            filter; None = all.

    Raises:
        ValueError: If no pixel is valid.
    """
    filled, valid = initial_maps(depth)
    share = valid.mean() if wanted is None else valid[wanted].mean()
    is_filtered = bool(share < FILTERED_SHARE)
    alone = Start(filled, valid, is_filtered=is_filtered)
    if not maps:
        return alone
    reprojected, counts = reprojected_depth(filled, K, maps)
    num_consistent = np.where(valid, counts, np.uint8(0))
    consistent = num_consistent > 0
    if consistent.sum() < LEAST_CONSISTENT_SHARE * valid.sum():
        return alone
    if is_filtered:
        filled, _ = initial_maps(np.where(valid, depth, invert_map(reprojected)))
        return Start(filled, valid, reprojected, num_consistent, is_filtered)
    along_rows = goes_along_rows(maps[0], K, depth.shape)
    filled_in = complete_from_background(filled, consistent, along_rows)
    return Start(filled_in, consistent, reprojected, num_consistent)


class Reprojected(NamedTuple):
    """What maps of other views say of a view.

    Attributes:
        inverse_depth: Of several the one nearest to what is there, shape (H, W),
            float32, in 1/unit; 0 where no map says anything.
        num_consistent: How many maps say the same as is there, shape (H, W).
    """

    inverse_depth: FloatMap
    num_consistent: Counts


def reprojected_depth(
    inverse_depth: FloatMap, K: Matrix, maps: Sequence[SourceMap]
) -> Reprojected:
    """Carry the maps of other views into a view and compare.

    Args:
        inverse_depth: Of the reference, shape (H, W), float32, in 1/unit, > 0.
        K: K of the reference for index coordinates, shape (3, 3), in pixels.
        maps: Those of other views.
    """
    height_px, width_px = inverse_depth.shape
    best = np.zeros_like(inverse_depth)
    num_consistent = np.zeros(inverse_depth.shape, np.uint8)
    for source in maps:
        arrived = reproject_inverse_depth(
            torch.from_numpy(invert_map(source.depth))[None, None],
            torch.from_numpy(source.K)[None],
            torch.from_numpy(K)[None],
            torch.from_numpy(source.source_from_reference)[None],
            (height_px, width_px),
        )[0, 0].numpy()
        is_there, change = arrived > 0, np.abs(arrived - inverse_depth)
        is_nearer = (best == 0) | (change < np.abs(best - inverse_depth))
        best = np.where(is_there & is_nearer, arrived, best)
        limit = np.maximum(CONSISTENT_CHANGE * inverse_depth, _of_pixels(source))
        num_consistent += is_there & (change < limit)
    return Reprojected(best, num_consistent)


def _of_pixels(source: SourceMap) -> float:
    """The change of inverse depth, in 1/unit, that moves a point `CONFIRMING_PX`."""
    baseline = float(np.linalg.norm(source.source_from_reference[:, 3]))
    return CONSISTENT_PX / max(baseline * float(source.K[0, 0]), 1e-12)


def goes_along_rows(source: SourceMap, K: Matrix, size_px: tuple[int, int]) -> bool:
    """Whether a view's epipolar lines are nearer to the rows than to the columns.

    Args:
        source: The other view.
        K: K of the reference, shape (3, 3), in pixels.
        size_px: Height and width of the reference; its middle decides.
    """
    pose = source.source_from_reference
    epipole = K @ projection_center(pose)
    middle_x, middle_y = (size_px[1] - 1) / 2, (size_px[0] - 1) / 2
    along_x = epipole[0] - epipole[2] * middle_x
    along_y = epipole[1] - epipole[2] * middle_y
    return bool(abs(along_x) >= abs(along_y))
