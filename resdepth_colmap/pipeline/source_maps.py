"""What the depth maps of other views say of a view's own."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import torch

from resdepth_colmap.geometry.forward_warp import carry_inverse_depth
from resdepth_colmap.geometry.inverse_depth import invert_map
from resdepth_colmap.scene import DepthMap, FloatMap, Matrix

NUM_SOURCE_MAPS = 4
"""Other views whose maps are looked at."""

CONFIRMING_CHANGE = 0.02
"""Relative difference up to which another view's map confirms a depth."""


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


def carried_inverse_depth(
    inverse_depth: FloatMap, K: Matrix, maps: Sequence[SourceMap]
) -> FloatMap:
    """What the maps say of each pixel; of several the one nearest to what is there.

    Args:
        inverse_depth: Of the reference, shape (H, W), float32, in 1/unit, > 0.
        K: K of the reference for index coordinates, shape (3, 3), in pixels.
        maps: Those of other views.

    Returns:
        Inverse depth, shape (H, W), float32, in 1/unit; 0 where no map says anything.
    """
    height_px, width_px = inverse_depth.shape
    best = np.zeros_like(inverse_depth)
    for source in maps:
        arrived = carry_inverse_depth(
            torch.from_numpy(invert_map(source.depth))[None, None],
            torch.from_numpy(source.K)[None],
            torch.from_numpy(K)[None],
            torch.from_numpy(source.source_from_reference)[None],
            (height_px, width_px),
        )[0, 0].numpy()
        is_nearer = np.abs(arrived - inverse_depth) < np.abs(best - inverse_depth)
        best = np.where((arrived > 0) & (is_nearer | (best == 0)), arrived, best)
    return best


def confirmed_by(inverse_depth: FloatMap, carried: FloatMap) -> npt.NDArray[np.bool_]:
    """Where another view's map says the same, shape (H, W)."""
    change = np.abs(carried - inverse_depth)
    return np.asarray((carried > 0) & (change < CONFIRMING_CHANGE * inverse_depth))


def goes_along_rows(source: SourceMap, K: Matrix, size_px: tuple[int, int]) -> bool:
    """Whether a view's epipolar lines are nearer to the rows than to the columns.

    Args:
        source: The other view.
        K: K of the reference, shape (3, 3), in pixels.
        size_px: Height and width of the reference; its middle decides.
    """
    pose = source.source_from_reference
    epipole = K @ (-pose[:, :3].T @ pose[:, 3])
    middle_x, middle_y = (size_px[1] - 1) / 2, (size_px[0] - 1) / 2
    along_x = epipole[0] - epipole[2] * middle_x
    along_y = epipole[1] - epipole[2] * middle_y
    return bool(abs(along_x) >= abs(along_y))
