"""One view, matched: arrays in, arrays out."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.matching.filtering import filter_result
from resdepth_colmap.matching.patch_match import Surface, match_view
from resdepth_colmap.pipeline.stereo.depth_range_probe import probed_range
from resdepth_colmap.pipeline.stereo.load_view import MatchData


class Matched(NamedTuple):
    """What was found.

    Attributes:
        surface: Depth and normals; 0 = none.
        agrees: Which sources agree with each pixel, shape (S, H, W); None = not asked.
        depth_range: Near and far depth that was searched, in units.
    """

    surface: Surface
    agrees: npt.NDArray[np.bool_] | None
    depth_range: tuple[float, float]


def match(
    data: MatchData,
    config: StereoConfig,
    is_filtered: bool,
    on_step: Callable[[int, int], None],
) -> Matched:
    """Match a view; a guessed depth range is narrowed first.

    Args:
        data: The view and its sources.
        config: Options of the matcher.
        is_filtered: Drop what too few sources agree with.
        on_step: Called with the number of steps done, and of all of them.
    """
    depth_range = data.depth_range
    if not data.wanted.any():
        return Matched(nothing(data.wanted.shape), None, depth_range)
    if data.probe is not None:
        depth_range = probed_range(*data.probe, depth_range, config)
    result = match_view(
        data.reference,
        data.sources,
        depth_range,
        config,
        start=data.start(depth_range),
        source_depths=data.source_depths,
        on_step=on_step,
    )
    found: Surface = result
    agrees = None
    if is_filtered:
        found, agrees = filter_result(
            result, data.reference, data.sources, data.source_depths, config
        )
    return Matched(masked(found, data.wanted), agrees, depth_range)


def masked(found: Surface, wanted: npt.NDArray[np.bool_]) -> Surface:
    """The same without depth and normals where none is wanted."""
    return Surface(
        depth=np.where(wanted, found.depth, np.float32(0)),
        normals=np.where(wanted[..., np.newaxis], found.normals, np.float32(0)),
    )


def nothing(shape: tuple[int, ...]) -> Surface:
    """Maps without any depth."""
    return Surface(
        depth=np.zeros(shape, np.float32),
        normals=np.zeros((*shape, 3), np.float32),
    )
