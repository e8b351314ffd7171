"""The choice of stereo pairs of an ETH3D scene.

The pairs of the paper were picked by hand, "with high overlap and reasonable
baselines", and are not published; here a rule or a file `pairs.txt` picks them.
"""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.geometry.overlap import overlap
from resdepth_colmap.geometry.view_selection import (
    GOOD_ANGLES_DEG,
    SourceChoice,
    choose_sources,
)
from resdepth_colmap.io.files import read_text
from resdepth_colmap.scene import Scene

PAIRS_NAME = "pairs.txt"
NUM_PAIRS = 4
"""Default number of pairs of a scene that is not in the paper."""

_NUM_CANDIDATES = 10  # sources of a reference

LEAST_OVERLAP = 0.6
"""Least share of the reference that the source sees, at the middle of its depths."""


class Pair(NamedTuple):
    """A stereo pair.

    Attributes:
        reference: Index of the reference view in `Scene.views`.
        source: Index of the source view.
    """

    reference: int
    source: int


def choose_pairs(
    scene: Scene, references: Collection[int], num_pairs: int
) -> tuple[Pair, ...]:
    """The pairs with the most shared points, at a moderate angle, preferably disjoint.

    Each reference is paired with the best of its sources (`choose_sources`) that see
    60 % of it at a triangulation angle of 2 to 15 degrees. The pairs with the most
    shared points are taken, those with a view of an earlier pair last; at most
    `num_pairs`, sorted by reference.
    """
    found: list[tuple[int, Pair]] = []
    for reference in sorted(references):
        for choice in choose_sources(scene, reference, _NUM_CANDIDATES):
            if _is_good(scene, reference, choice):
                pair = Pair(reference, choice.index)
                found.append((-choice.num_shared_points, pair))
                break
    ranked = [pair for _, pair in sorted(found)]
    taken: list[Pair] = []
    for pair in ranked:
        if not any(set(pair) & set(other) for other in taken):
            taken.append(pair)
    taken += [pair for pair in ranked if pair not in taken]
    return tuple(sorted(taken[:num_pairs]))


def read_pairs(path: Path) -> dict[str, list[tuple[str, str]]]:
    """Read a `pairs.txt`: scene, reference and source per line, "#" for comments.

    Returns:
        File names of reference and source, by the name of the scene.

    Raises:
        WorkspaceError: If it cannot be read, or a line does not have three words.
    """
    pairs: dict[str, list[tuple[str, str]]] = {}
    for line_number, line in enumerate(read_text(path).splitlines(), 1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        if len(words) != 3:
            raise WorkspaceError(
                f"{path}, line {line_number}: {line.strip()!r}, but expected the name "
                "of a scene, its reference and its source image, as in "
                "'office DSC_0220.JPG DSC_0221.JPG'."
            )
        pairs.setdefault(words[0], []).append((words[1], words[2]))
    return pairs


def named_pairs(
    path: Path, names: list[tuple[str, str]], indices: Mapping[str, int]
) -> tuple[Pair, ...]:
    """The pairs of file names that a `pairs.txt` lists, as indices of views.

    Raises:
        WorkspaceError: If the model lacks an image, or a pair is of one image.
    """
    for pair in names:
        for name in pair:
            if name not in indices:
                raise WorkspaceError(
                    f"{path}: names {name}, but the model has no such image."
                )
        if pair[0] == pair[1]:
            raise WorkspaceError(f"{path}: pairs {pair[0]} with itself.")
    return tuple(Pair(indices[first], indices[second]) for first, second in names)


def _is_good(scene: Scene, reference: int, choice: SourceChoice) -> bool:
    if scene.depth_range is None or scene.depth_range[reference, 1] <= 0:
        return True  # without sparse points, choose_sources uses the poses alone
    low, high = GOOD_ANGLES_DEG
    middle = float(np.sqrt(np.prod(scene.depth_range[reference])))
    seen = overlap(scene.views[reference], scene.views[choice.index], [middle])
    is_seen = float(seen.inside.mean()) >= LEAST_OVERLAP
    return is_seen and low <= choice.angle_deg <= high
