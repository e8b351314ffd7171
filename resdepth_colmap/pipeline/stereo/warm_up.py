"""Compiling the matcher before there is work for it, with a word if that takes long."""

import dataclasses
import logging
import threading

import numpy as np

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.matching.filtering import filter_result
from resdepth_colmap.matching.patch_match import MatchView, Surface, match_view

logger = logging.getLogger(__name__)

PATIENCE_S = 3.0  # loading what was compiled before takes less
SIDE_PX = 32


def warm_up(config: StereoConfig) -> None:
    """Match views of a few pixels with all that the configuration needs.

    numba compiles at the first call on a machine, and keeps what it has compiled.
    """
    word = threading.Timer(
        PATIENCE_S,
        logger.info,
        ["Compiling the matcher: about half a minute, once on this machine."],
    )
    word.daemon = True
    word.start()
    try:
        _match_little(dataclasses.replace(config, num_iterations=1))
    finally:
        word.cancel()


def _match_little(config: StereoConfig) -> None:
    reference, *sources = (_view(index) for index in range(3))
    first = match_view(reference, sources, (2.0, 5.0), config)
    depths = None
    if config.geom_consistency:
        depths = [first.depth] * len(sources)
        start = Surface(depth=first.depth, normals=first.normals)
        first = match_view(
            reference, sources, (2.0, 5.0), config, start=start, source_depths=depths
        )
    if config.filter:
        filter_result(first, reference, sources, depths, config)


def _view(index: int) -> MatchView:
    """Noise, seen from places side by side."""
    gray = np.random.default_rng(index).random((SIDE_PX, SIDE_PX), dtype=np.float32)
    pose = np.eye(3, 4)
    pose[0, 3] = -0.1 * index
    K = np.array([[SIDE_PX, 0, SIDE_PX / 2], [0, SIDE_PX, SIDE_PX / 2], [0, 0, 1.0]])
    return MatchView(gray=gray, K=K, cam_from_world=pose)
