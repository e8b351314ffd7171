"""The CPU PatchMatch beside COLMAP's own maps, where these confirm each other."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from resdepth_colmap.evaluation.map_agreement import (
    ViewMap,
    num_confirming,
    shares_within,
)
from resdepth_colmap.evaluation.matched_workspace import (
    MatchedWorkspace,
    matched_workspace,
)
from resdepth_colmap.evaluation.matching_passes import (
    AUTO,
    KINDS,
    LIMITS,
    Folders,
    Result,
    compared,
    depth_of,
    match_both,
    mean_over,
)
from resdepth_colmap.io.workspace import Workspace, open_workspace

NAME = "meeting_room"
CONFIRMED_WITHIN = 0.01


class Room(NamedTuple):
    """The scene.

    Attributes:
        colmap: The workspace with COLMAP's maps.
        matched: That with ours.
        theirs: COLMAP's maps by image name.
        seconds: What ours took, see `match_both`.
    """

    colmap: Workspace
    matched: MatchedWorkspace
    theirs: dict[str, ViewMap]
    seconds: Result

    def others(self, name: str) -> list[ViewMap]:
        """COLMAP's maps of the other images."""
        return [other for key, other in self.theirs.items() if key != name]

    def counts(self, name: str) -> npt.NDArray[np.int64]:
        """How many of those confirm COLMAP's map of an image, shape (H, W)."""
        return num_confirming(self.theirs[name], self.others(name), CONFIRMED_WITHIN)

    def last_kind(self, name: str) -> str:
        """The last pass that made a map of an image."""
        # A view of whose sources none was matched has no geometric map.
        kinds = self.matched.workspace.map_kinds(name)
        return KINDS[1] if KINDS[1] in kinds else KINDS[0]


def matched_room(folders: Folders) -> Room:
    """Match the photos with maps of COLMAP, and all others once if they are wanted."""
    colmap = open_workspace(folders.data / NAME)
    matched = matched_workspace(colmap.path, folders.cache / NAME)
    views = [v for v in matched.scene.views if colmap.map_kinds(v.name)]
    first = matched.scene.views if folders.all_photos else views
    seconds = match_both(
        matched,
        {view.name: AUTO for view in first},
        {view.name: AUTO for view in views},
    )
    theirs = {
        view.name: ViewMap(view=view, depth=depth_of(colmap, view.name, KINDS[0]))
        for view in views
    }
    return Room(colmap=colmap, matched=matched, theirs=theirs, seconds=seconds)


def measure_meeting_room(folders: Folders) -> Result:
    """Where a neighbour's map confirms COLMAP's: how often ours says the same."""
    room = matched_room(folders)
    maps: Result = {}
    for name, oracle in room.theirs.items():
        counts = room.counts(name)
        maps[name] = {
            "pixels": float((counts > 0).mean()),
            "chance": _confirmed_by_chance(oracle, room.others(name)),
        }
        for kind in room.matched.workspace.map_kinds(name):
            depth = depth_of(room.matched.workspace, name, kind)
            maps[name][kind] = shares_within(depth, oracle.depth, counts > 0, LIMITS)
            maps[name][f"{kind}_twice"] = shares_within(
                depth, oracle.depth, counts > 1, LIMITS
            )
    result = compared(maps, room.seconds)
    confirmed = sum(entry["pixels"] for entry in maps.values())
    result["chance"] = sum(entry["chance"] for entry in maps.values()) / confirmed
    result["mean_twice"] = {kind: mean_over(maps, f"{kind}_twice") for kind in KINDS}
    result["matched"] = matched_photos(room)
    return result


def matched_photos(room: Room) -> dict[str, int]:
    """How many of the photos have a map of ours, and how many there are."""
    views = room.matched.scene.views
    with_map = sum(bool(room.matched.workspace.map_kinds(v.name)) for v in views)
    return {"with_map": with_map, "in_all": len(views)}


def _confirmed_by_chance(oracle: ViewMap, others: list[ViewMap]) -> float:
    """Share of the pixels that others confirm when all depths are wrong by 5 %."""
    counts = [
        num_confirming(
            ViewMap(view=oracle.view, depth=oracle.depth * np.float32(factor)),
            *(others, CONFIRMED_WITHIN),
        )
        for factor in (0.95, 1.05)
    ]
    return float((np.stack(counts) > 0).mean())
