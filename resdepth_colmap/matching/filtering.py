"""What too few sources agree with is dropped: COLMAP's filter, with its meaning.

A source agrees with a pixel if its patch looks alike (NCC), its ray meets the
reference's at a sufficient angle, it sees the front of the surface and, where there is
a depth map of the source, if that map leads back to the pixel (Schoenberger et al.,
ECCV 2016, section 4.3; patch_match_cuda.cu). COLMAP compares a selection probability,
smoothed along rows and columns, with that of the least NCC; here it is the NCC itself.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.matching.patch_match import MatchResult, MatchView, Surface
from resdepth_colmap.scene import DepthMap, cam_from_cam

_NO_DEPTH = np.zeros((0, 0), np.float32)


class Filtered(NamedTuple):
    """What is left of a result.

    Attributes:
        surface: Depth and normals, 0 where they were dropped.
        agrees: Whether source s agrees with a pixel, shape (S, H, W), bool; nowhere
            where it was dropped.
    """

    surface: Surface
    agrees: npt.NDArray[np.bool_]


def filter_result(
    result: MatchResult,
    reference: MatchView,
    sources: Sequence[MatchView],
    source_depths: Sequence[DepthMap] | None,
    config: StereoConfig,
) -> Filtered:
    """Drop the depth of pixels that too few sources agree with.

    As in COLMAP, with fewer sources than `filter_min_num_consistent` all have to agree.

    Args:
        result: What `match_view` found.
        reference: The view it was found for.
        sources: The sources it was found with, S of them.
        source_depths: Their depth maps; 0 = none. None: photographs alone count.
        config: The options that begin with `filter_`.
    """
    from resdepth_colmap.matching.agreement import mark_agreeing  # numba: slow import

    limits = np.array(
        [
            1.0 - config.filter_min_ncc,
            math.cos(math.radians(config.filter_min_triangulation_angle)),
            config.filter_geom_consistency_max_cost,
        ]
    )
    agrees = np.zeros((len(sources), *result.depth.shape), np.bool_)
    for index, source in enumerate(sources):
        mark_agreeing(
            np.ascontiguousarray(result.depth),
            np.ascontiguousarray(result.normals),
            reference.K,
            np.ascontiguousarray(result.source_costs[index]),
            source.K,
            cam_from_cam(source, reference),
            _NO_DEPTH if source_depths is None else source_depths[index],
            limits,
            agrees[index],
        )
    needed = min(len(sources), config.filter_min_num_consistent)
    kept = (agrees.sum(axis=0) >= needed) & (result.depth > 0)
    agrees &= kept
    depth = np.where(kept, result.depth, np.float32(0))
    normals = np.where(kept[..., np.newaxis], result.normals, np.float32(0))
    return Filtered(Surface(depth=depth, normals=normals), agrees)
