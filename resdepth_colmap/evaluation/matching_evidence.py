"""Which of two depths the photographs prefer, by our cost and by COLMAP's."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.evaluation.matching_hypotheses import Hypotheses, PhotoCost
from resdepth_colmap.evaluation.matching_more_sources import MORE_SOURCES
from resdepth_colmap.matching.patch_match import MatchView
from resdepth_colmap.scene import Matrix

Numbers = npt.NDArray[np.float64]

BAD = 0.5
"""A cost beyond which nothing matches."""

WINDOWS = {
    "own": StereoConfig(),
    "colmap": StereoConfig(window_radius=5, window_step=1, sigma_color=0.2),
}
"""Our defaults and COLMAP's."""


def costs_of_both(
    views: Sequence[MatchView],
    pixels: npt.NDArray[np.int64],
    ours: Numbers,
    theirs: Numbers,
    normals: Sequence[Matrix],
    margin: float,
) -> dict[str, dict[str, float]]:
    """Which depth the photographs prefer, by two windows and two numbers of sources.

    Args:
        views: The view, then its sources, the best ones first.
        pixels: Column and row of the pixels, shape (N, 2).
        ours: One depth of each, (N,), > 0.
        theirs: The other one.
        normals: Normals to try, one array (N, 3) for each way to tell them.
        margin: See `preferences`.

    Returns:
        By window and number of sources what `preferences` says.
    """
    reference, *sources = views
    found = {}
    for label, config in WINDOWS.items():
        for number in (config.max_num_sources, MORE_SOURCES):
            cost = PhotoCost(reference, sources[:number], config, widens=label == "own")
            ours_least, theirs_least = (
                cost.least(
                    pixels,
                    Hypotheses(depth=depth, normals=normals),
                    np.random.default_rng(0),
                )
                for depth in (ours, theirs)
            )
            found[f"{label}_{number}"] = preferences(ours_least, theirs_least, margin)
    return found


def preferences(ours: Numbers, theirs: Numbers, margin: float) -> dict[str, float]:
    """Shares of pixels where a depth costs less than the other one.

    Args:
        ours: Cost of the one, (N,), in 0..2.
        theirs: Cost of the other.
        margin: Less by that much; else it is a tie.

    Returns:
        "ours", "theirs" and "tie", which sum to 1, and "neither", which matches badly.
    """
    return {
        "ours": float((theirs - ours > margin).mean()),
        "theirs": float((ours - theirs > margin).mean()),
        "tie": float((np.abs(ours - theirs) <= margin).mean()),
        "neither": float((np.minimum(ours, theirs) > BAD).mean()),
    }
