"""Whether more sources make the geometric maps of `meeting_room` more like COLMAP's."""

import dataclasses
import shutil
from pathlib import Path

from resdepth_colmap.evaluation.map_agreement import shares_within
from resdepth_colmap.evaluation.matched_workspace import (
    MatchedWorkspace,
    matched_workspace,
)
from resdepth_colmap.evaluation.matching_meeting_room import NAME, Room, matched_room
from resdepth_colmap.evaluation.matching_passes import (
    AUTO,
    BOTH,
    KINDS,
    LIMITS,
    Folders,
    Result,
    depth_of,
)

MORE_SOURCES = 20
"""As many as COLMAP takes by default."""

NUM_WORST = 3
"""Images that are matched again in the geometric pass."""


def measure_more_sources(folders: Folders) -> Result:
    """More sources in the geometric pass, for the images that agree least.

    It goes on from the same photometric maps, made with as many sources as by default.
    """
    room = matched_room(folders)
    before = {name: _agreement(room, name) for name in room.theirs}
    worst = sorted(before, key=lambda name: before[name]["0.02"])[:NUM_WORST]
    path = folders.cache / f"{NAME}_{MORE_SOURCES}_sources"
    maps: Result = {}
    for name in worst:
        maps[name] = {
            "before_kind": room.last_kind(name),
            "before": before[name],
            "geometric": _with_more(room, seeded_workspace(room.matched, path), name),
        }
    return {"num_sources": MORE_SOURCES, "maps": maps}


def _with_more(room: Room, seeded: MatchedWorkspace, name: str) -> Result:
    """Agreement, and processor seconds of the passes that were not there."""
    config = dataclasses.replace(BOTH, max_num_sources=MORE_SOURCES)
    cpu_s = seeded.match(name, {name: AUTO}, config)
    depth = depth_of(seeded.workspace, name, KINDS[1])
    where = room.counts(name) > 0
    shares = shares_within(depth, room.theirs[name].depth, where, LIMITS)
    return {**shares, "cpu_s": cpu_s}


def _agreement(room: Room, name: str) -> dict[str, float]:
    depth = depth_of(room.matched.workspace, name, room.last_kind(name))
    oracle = room.theirs[name].depth
    return shares_within(depth, oracle, room.counts(name) > 0, LIMITS)


def seeded_workspace(source: MatchedWorkspace, path: Path) -> MatchedWorkspace:
    """Another workspace whose photometric maps are copies, as if others had made them.

    So they are never made again, whatever the options are.
    """
    seeded = matched_workspace(source.path, path)
    for folder in ("depth_maps", "normal_maps"):
        target = seeded.workspace.stereo_path / folder
        target.mkdir(exist_ok=True)
        for name in (view.name for view in source.scene.views):
            file = Path(folder) / f"{name}.{KINDS[0]}.bin"
            original, copy = (
                w.stereo_path / file for w in (source.workspace, seeded.workspace)
            )
            if original.is_file() and not copy.exists():
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(original, copy)
    return seeded
