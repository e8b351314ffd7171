"""Depth ranges where there are no sparse points: from a match of small pictures.

Poses alone leave a range of two or three powers of ten, most of which a search would
spend on what is not there. A match of pictures of thumbnail size takes less than a
second, and what at least two sources confirm in it stands for the sparse points in
COLMAP's rule: 1 % and 99 % of the depths, stretched.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.matching.filtering import filter_result
from resdepth_colmap.matching.patch_match import MatchView, match_view

PROBE_SIDE_PX = 200
"""Longest side of the pictures."""

WIDE = 5.0
"""Ratio of far to near up to which a range is good enough."""

LEAST_NCC = 0.7
LEAST_SHARE = 0.1
"""Of the pixels that are confirmed; with fewer, the picture says too little."""

PERCENTILES = (1.0, 99.0)
NEAR_STRETCH = 1.5
FAR_STRETCH = 4.0
"""COLMAP stretches both by 1.25. What is far and thin is the first to be missed in a
small picture, and costs little: the search is uniform in inverse depth."""


def is_wide(depth_range: tuple[float, float]) -> bool:
    """Whether a range (near, far) is too wide to search without a probe."""
    near, far = depth_range
    return far > WIDE * near


def probed_range(
    reference: MatchView,
    sources: Sequence[MatchView],
    wide_range: tuple[float, float],
    config: StereoConfig,
) -> tuple[float, float]:
    """Near and far depth of what is confirmed in small pictures.

    Args:
        reference: The view, at a size of about `PROBE_SIDE_PX`.
        sources: Its sources, at the same scale.
        wide_range: The range known from the poses; the result lies within.
        config: Options of the matcher.

    Returns:
        Near and far depth; `wide_range` itself where too little is confirmed.
    """
    config = dataclasses.replace(
        config,
        filter_min_ncc=LEAST_NCC,
        filter_min_triangulation_angle=0.0,
        filter_min_num_consistent=2,
    )
    found = match_view(reference, sources, wide_range, config)
    depth = filter_result(found, reference, sources, None, config).surface.depth
    consistent = depth[depth > 0]
    if consistent.size < LEAST_SHARE * depth.size:
        return wide_range
    near, far = (float(value) for value in np.percentile(consistent, PERCENTILES))
    return (
        max(near / NEAR_STRETCH, wide_range[0]),
        min(far * FAR_STRETCH, wide_range[1]),
    )
