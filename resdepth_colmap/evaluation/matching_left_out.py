"""What a map of COLMAP says of the pixels that COLMAP's other maps confirm.

How near another program can come to COLMAP's maps is not told by the share of confirmed
pixels on which it agrees: that COLMAP's maps agree with each other there is to be shown
first. So one of them is left out: of the pixels of a map that the maps of others
confirm, how many does it confirm too? And our map of its view, at the same pixels?
"""

import numpy as np
import numpy.typing as npt

from resdepth_colmap.evaluation.map_agreement import (
    ViewMap,
    depths_seen,
    mean_of,
    num_confirming,
)
from resdepth_colmap.evaluation.matching_meeting_room import (
    CONFIRMED_WITHIN,
    Room,
    matched_room,
)
from resdepth_colmap.evaluation.matching_passes import Folders, Result, depth_of

AGREES_WITHIN = 0.02
Numbers = npt.NDArray[np.float64]

ANSWERS = ("agree", "nearer", "farther")


def measure_left_out(folders: Folders) -> Result:
    """Of each image what the maps of other views say of it, COLMAP's and ours.

    Returns:
        By image and as means, for "theirs" and "ours", the shares of `ANSWERS`: a depth
        that is nearer may be of something that hides the point, one that is farther
        denies it. "apart" is the share that agrees of those that are not nearer.
    """
    room = matched_room(folders)
    maps = {name: _image(room, name) for name in room.theirs}
    maps = {name: entry for name, entry in maps.items() if entry}
    mean = {
        of: mean_of([entry[of] for entry in maps.values()]) for of in ("theirs", "ours")
    }
    return {"maps": maps, "mean": mean}


def _image(room: Room, name: str) -> Result:
    """Summed over the maps that are left out in turn; empty if none says anything."""
    reference, counts = room.theirs[name], room.counts(name)
    sums = {"theirs": np.zeros(len(ANSWERS)), "ours": np.zeros(len(ANSWERS))}
    for left_out in room.others(name):
        confirmed = counts > num_confirming(reference, [left_out], CONFIRMED_WITHIN)
        expected, seen = depths_seen(reference, left_out)
        where = confirmed & (seen > 0)
        sums["theirs"] += _answers(expected[where], seen[where])
        other = left_out.view.name
        ours = depth_of(room.matched.workspace, other, room.last_kind(other))
        _, seen = depths_seen(reference, ViewMap(view=left_out.view, depth=ours))
        sums["ours"] += _answers(expected[where], seen[where])
    if not sums["theirs"].any():
        return {}
    return {of: _shares(numbers) for of, numbers in sums.items()}


def _answers(expected: Numbers, seen: Numbers) -> Numbers:
    """How many depths agree, are nearer, and are farther; none at all denies, too."""
    seen = np.where(seen > 0, seen, np.inf)
    limit = AGREES_WITHIN * expected
    is_nearer, is_farther = seen < expected - limit, seen > expected + limit
    agrees = ~is_nearer & ~is_farther
    return np.array([it.sum() for it in (agrees, is_nearer, is_farther)], np.float64)


def _shares(numbers: Numbers) -> dict[str, float]:
    agree, _, farther = numbers
    shares = dict(zip(ANSWERS, (numbers / numbers.sum()).tolist(), strict=True))
    return {**shares, "apart": float(agree / max(agree + farther, 1.0))}
