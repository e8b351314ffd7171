"""Whether our search misses COLMAP's depths: it starts from them.

Where our matcher, started on COLMAP's own map, leaves it for our depth, its cost
prefers that; where it stays, our search from chance did not find what it might have.
"""

import numpy as np

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.evaluation.map_agreement import Pixels
from resdepth_colmap.evaluation.matching_disagreement import (
    AGREES_WITHIN,
    Compared,
    automatic_sources,
    compared_image,
    match_view_of,
)
from resdepth_colmap.evaluation.matching_meeting_room import Room, matched_room
from resdepth_colmap.evaluation.matching_passes import Folders, Result
from resdepth_colmap.geometry.depth_range import depth_range
from resdepth_colmap.geometry.normals import normals_from_depth
from resdepth_colmap.matching.patch_match import MatchView, Surface, match_view
from resdepth_colmap.scene import DepthMap

BAND_ROWS = 120
"""Of each image so many rows are matched, where most pixels differ."""


def measure_from_theirs(folders: Folders) -> Result:
    """The photometric pass from COLMAP's map, in a band of each image."""
    room = matched_room(folders)
    maps = {}
    for name in room.theirs:
        image = compared_image(room, name)
        if image.disagree.any():
            maps[name] = from_theirs(room, image)
    keys = next(iter(maps.values()))
    mean = {
        key: float(np.mean([entry[key] for entry in maps.values()])) for key in keys
    }
    return {"num_rows": BAND_ROWS, "maps": maps, "mean": mean}


def from_theirs(room: Room, image: Compared) -> dict[str, float]:
    """Match the band of an image, starting from COLMAP's depth; ours where it has none.

    Returns:
        "before" and "after": share of its confirmed pixels that agree with COLMAP's.
        "stay" and "return": of those that differed before, how many then agree with
        COLMAP's depth, and with ours.
    """
    rows = worst_rows(image.disagree)
    scene = room.matched.scene
    config = StereoConfig()
    sources = automatic_sources(room, image, config.max_num_sources)
    indices = [scene.index(view.name) for view in sources]
    limits = depth_range(scene, scene.index(image.view.name), indices)
    reference = band_of(match_view_of(room, image.view), rows)
    theirs, ours = image.theirs[rows], image.ours[rows]
    depth = np.where(theirs > 0, theirs, ours).clip(*limits).astype(np.float32)
    found = match_view(
        reference,
        [match_view_of(room, view) for view in sources],
        limits,
        config,
        start=Surface(depth=depth, normals=normals_from_depth(depth, reference.K)),
    ).depth
    agree, differ = image.agree[rows], image.disagree[rows]
    return {
        "before": float(agree.sum() / (agree | differ).sum()),
        "after": _near(found, theirs, agree | differ),
        "stay": _near(found, theirs, differ),
        "return": _near(found, ours, differ),
    }


def worst_rows(disagree: Pixels) -> slice:
    """The rows of the band with the most pixels that differ."""
    counts = disagree.sum(axis=1)
    height = min(BAND_ROWS, len(counts))
    sums = np.convolve(counts, np.ones(height), mode="valid")
    top = int(np.argmax(sums))
    return slice(top, top + height)


def band_of(view: MatchView, rows: slice) -> MatchView:
    """Rows of a view."""
    K = view.K.copy()
    K[1, 2] -= rows.start
    gray = np.ascontiguousarray(view.gray[rows])
    return MatchView(gray=gray, K=K, cam_from_world=view.cam_from_world)


def _near(depth: DepthMap, expected: DepthMap, where: Pixels) -> float:
    near = np.abs(depth - expected) <= AGREES_WITHIN * expected
    return float(near[where].mean())
