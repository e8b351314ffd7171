"""The scenes to train on, and which of them are held out.

Scenes are split as a whole: no part of a scene that validates is ever trained on
(paper, section "Network Training"). Which side a scene is on depends on its name alone,
so that it stays there when others are added, and in a later training too.
"""

import hashlib
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from resdepth_colmap.errors import TrainingError, WorkspaceError
from resdepth_colmap.io.colmap.workspace import open_workspace

TRUTH_FOLDER = "ground_truth"
_NO_NAMES = ("dense", "undistorted")  # folders that are called the same everywhere


class Split(NamedTuple):
    """Scenes to train on, and scenes to validate with."""

    training: tuple[Path, ...]
    held_out: tuple[Path, ...]


def find_scenes(paths: Sequence[Path]) -> tuple[Path, ...]:
    """The workspaces with true depth at these paths.

    Args:
        paths: Workspaces, or folders of workspaces.

    Returns:
        Paths of workspaces, in the given order, without repetitions.

    Raises:
        WorkspaceError: If a path is neither.
    """
    found: dict[Path, Path] = {}
    for path in paths:
        for scene in _scenes_at(path):
            found.setdefault(scene.resolve(), scene)
    return tuple(found.values())


def split_scenes(scenes: Sequence[Path], share: float) -> Split:
    """Hold out about that share of the scenes, chosen by the hash of their names.

    Of two scenes or more, at least one is on either side, unless all have one name.

    Args:
        scenes: All of them.
        share: Which part to hold out, in 0..1; 0 = none.
    """
    if share <= 0 or len(scenes) < 2:
        return Split(tuple(scenes), ())
    places = {path: _place(scene_name(path)) for path in scenes}
    first, last = min(places.values()), max(places.values())
    # Of several names one is always held out, and one always trained on.
    limit = max(share, first) if last > share else math.nextafter(last, 0)
    training = tuple(path for path in scenes if places[path] > limit)
    held_out = tuple(path for path in scenes if places[path] <= limit)
    return Split(training, held_out) if training else Split(tuple(scenes), ())


def check_apart(training: Sequence[Path], watched: Sequence[Path]) -> None:
    """Check that no scene to watch is trained on.

    Raises:
        TrainingError: Naming the first one that is.
    """
    trained_on = {path.resolve() for path in training}
    for path in watched:
        if path.resolve() in trained_on:
            raise TrainingError(
                f"{path}: to be trained on and to be validated with; leave it out of "
                "one of the two."
            )


def scene_name(path: Path) -> str:
    """What a scene is called: its folder, or what holds its `dense/` or `0/`."""
    full = path.resolve()
    for folder in (full, *full.parents):
        if folder.name and folder.name not in _NO_NAMES and not folder.name.isdigit():
            return folder.name
    return full.name


def _place(name: str) -> float:
    """A place in 0..1 by the name."""
    digest = hashlib.sha256(name.encode()).digest()
    return int.from_bytes(digest[:8], "big") / 2**64


def _scenes_at(path: Path) -> list[Path]:
    if path.is_dir() and not (path / TRUTH_FOLDER).is_dir():
        below = sorted(found.parent for found in path.glob(f"*/{TRUTH_FOLDER}"))
        if below:
            return below
    workspace = open_workspace(path)
    if not (workspace.path / TRUTH_FOLDER).is_dir():
        raise WorkspaceError(
            f"{workspace.path}: no {TRUTH_FOLDER}/ with <image>.bin, so nothing can be "
            "learnt from it; leave it out, or add its true depth maps."
        )
    return [workspace.path]
