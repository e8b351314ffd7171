"""How many of COLMAP's confirmed pixels are confirmed by chance: where they are sparse.

A noisy map that is seen in another noisy map meets it here and there. Such pixels lie
alone, as dust on plain walls; those of a surface that two maps know lie side by side.
"""

import cv2
import numpy as np
import numpy.typing as npt

from resdepth_colmap.evaluation.map_agreement import (
    ViewMap,
    mean_of,
    num_confirming,
)
from resdepth_colmap.evaluation.matching_meeting_room import (
    CONFIRMED_WITHIN,
    Room,
    matched_room,
)
from resdepth_colmap.evaluation.matching_passes import Folders, Result, depth_of

WINDOW_PX = 5
DENSE_SHARE = 0.5
"""Pixels are dense where so much of their window is confirmed."""

WRONG_FACTORS = (0.9, 0.95, 1.05, 1.1)
AGREES_WITHIN = 0.02


def measure_chance(folders: Folders) -> Result:
    """Agreement where confirmed pixels are dense and sparse, and chance in the latter.

    Chance is how many of the pixels would be confirmed if their depth were wrong by 5
    or 10 %, over how many are.
    """
    room = matched_room(folders)
    maps = {name: _image(room, name) for name in room.theirs}
    return {"maps": maps, "mean": mean_of(list(maps.values()))}


def _image(room: Room, name: str) -> dict[str, float]:
    theirs, others = room.theirs[name], room.others(name)
    confirmed = room.counts(name) > 0
    is_dense = dense(confirmed)
    ours = depth_of(room.matched.workspace, name, room.last_kind(name))
    agree = np.abs(ours - theirs.depth) <= AGREES_WITHIN * theirs.depth
    sparse = confirmed & ~is_dense
    by_chance = [
        num_confirming(
            ViewMap(view=theirs.view, depth=theirs.depth * np.float32(factor)),
            *(others, CONFIRMED_WITHIN),
        )
        > 0
        for factor in WRONG_FACTORS
    ]
    hits = [(hit & (theirs.depth > 0) & ~is_dense).sum() for hit in by_chance]
    return {
        "dense": _share(is_dense, confirmed),
        "agree_dense": _share(agree, confirmed & is_dense),
        "agree_sparse": _share(agree, sparse),
        "chance": float(np.mean(hits) / max(int(sparse.sum()), 1)),
    }


def dense(confirmed: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Where at least half of the window around a pixel is confirmed, shape (H, W)."""
    window = (WINDOW_PX, WINDOW_PX)
    share = cv2.boxFilter(
        confirmed.astype(np.float32), -1, window, borderType=cv2.BORDER_REPLICATE
    )
    # A little less: sums of 25 shares are not exact.
    return np.asarray(share >= DENSE_SHARE - 1e-4)


def _share(what: npt.NDArray[np.bool_], where: npt.NDArray[np.bool_]) -> float:
    return float(what[where].mean()) if where.any() else 0.0
