"""Training scenes: how they are found, and which of them are held out.

A scene is either trained on or validated with, never both (paper, section "Network
Training"). Its side depends on its name alone: it stays there when scenes are added,
and in later trainings.
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
    """The workspaces with ground truth at these paths.

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


def _scenes_at(path: Path) -> list[Path]:
    if path.is_dir() and not (path / TRUTH_FOLDER).is_dir():
        below = sorted(found.parent for found in path.glob(f"*/{TRUTH_FOLDER}"))
        if below:
            return below
    workspace = open_workspace(path)
    if not (workspace.path / TRUTH_FOLDER).is_dir():
        raise WorkspaceError(
            f"{workspace.path}: no {TRUTH_FOLDER}/ with <image>.bin, which training "
            "needs; add the true depth maps or leave this workspace out."
        )
    return [workspace.path]


def split_scenes(scenes: Sequence[Path], share: float) -> Split:
    """Hold out about that share of the scenes, chosen by a hash of their names.

    Of two scenes or more, at least one is on either side, unless all have one name.

    Args:
        scenes: All scenes.
        share: Share to hold out, in 0..1; 0 = none.
    """
    if share <= 0 or len(scenes) < 2:
        return Split(tuple(scenes), ())
    hashes = [_hash(scene_name(path)) for path in scenes]
    # Of several names one is always held out, and one always trained on.
    last = max(hashes)
    limit = max(share, min(hashes)) if last > share else math.nextafter(last, 0)
    sides: dict[bool, list[Path]] = {True: [], False: []}
    for path, value in zip(scenes, hashes, strict=True):
        sides[value > limit].append(path)
    training, held_out = tuple(sides[True]), tuple(sides[False])
    return Split(training, held_out) if training else Split(tuple(scenes), ())


def check_apart(training: Sequence[Path], watched: Sequence[Path]) -> None:
    """Check that no watched scene is trained on.

    Raises:
        TrainingError: Naming the first one that is.
    """
    trained_on = {path.resolve() for path in training}
    for path in watched:
        if path.resolve() in trained_on:
            raise TrainingError(
                f"{path}: given both for training and for validation; leave it out of "
                "one of the two."
            )


def scene_name(path: Path) -> str:
    """The name of a scene: its folder, or the one above its `dense/` or `0/`."""
    full = path.resolve()
    for folder in (full, *full.parents):
        if folder.name and folder.name not in _NO_NAMES and not folder.name.isdigit():
            return folder.name
    return full.name


def _hash(name: str) -> float:
    """A value in 0..1 that depends on the name alone."""
    digest = hashlib.sha256(name.encode()).digest()
    return int.from_bytes(digest[:8], "big") / 2**64
