"""Source selection: which views to compare a reference view with.

As in COLMAP, by the shared sparse points and their triangulation angle. Without sparse
points, by the poses: how much of the reference the other view sees, and at which angle,
averaged over a range of depths.
"""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from resdepth_colmap.geometry.overlap import overlap
from resdepth_colmap.scene import Matrix, Scene, View, baseline

GOOD_ANGLES_DEG = (2.0, 15.0)
"""Below, depth is uncertain; above, the images differ too much."""

LARGEST_ANGLE_DEG = 75.0
"""Beyond, hardly any surface is visible in both views."""

LEAST_BASELINE_RATIO = 1e-3
"""Baseline over the typical one of the scene below which two views are at one place."""

LEAST_GAIN = 0.05
"""Share of a view, seen in addition, for which a good source is exchanged."""

DEPTHS_IN_BASELINES = np.geomspace(1.0, 100.0, 13)


@dataclasses.dataclass(frozen=True, kw_only=True)
class SourceChoice:
    """A view chosen as source, and why.

    Attributes:
        index: Position in `Scene.views`.
        reason: Why it was chosen, as text.
        score: How good it is by itself, > 0; comparable for one reference.
        num_shared_points: Sparse points that both views see; 0 without sparse points.
        angle_deg: 75th percentile of the triangulation angle at these points; without
            points, the angle between the optical axes.
        baseline: Distance of the two projection centres, in units.
    """

    index: int
    reason: str
    score: float
    num_shared_points: int
    angle_deg: float
    baseline: float


def choose_sources(
    scene: Scene,
    reference_index: int,
    num_sources: int,
    candidates: Sequence[int] | None = None,
) -> tuple[SourceChoice, ...]:
    """The best views to compare a view with, best first.

    Args:
        scene: The views and their statistics.
        reference_index: Position of the reference in `scene.views`.
        num_sources: How many to choose at most.
        candidates: Positions to choose from; None = all other views.

    Returns:
        Up to `num_sources` choices; none if no view overlaps from another place.
    """
    others = range(len(scene.views)) if candidates is None else candidates
    apart = _at_other_places(scene, reference_index, others)
    if _shares_points(scene, reference_index, apart):
        scored = [_by_points(scene, reference_index, index) for index in apart]
    else:
        depths = _likely_depths(scene, reference_index, apart)
        scored = [_by_pose(scene, reference_index, index, depths) for index in apart]
    scored = [choice for choice in scored if choice.score > 0]
    scored.sort(key=lambda choice: (-choice.score, choice.index))
    return tuple(scored[:num_sources])


def spread_choices(
    scene: Scene,
    reference_index: int,
    choices: Sequence[SourceChoice],
    num_sources: int,
) -> tuple[SourceChoice, ...]:
    """Good sources that together see all of a view, best first.

    The best sources by themselves may all see the same part of a view and leave the
    rest to one or none. They are exchanged for others, the best exchange first, as long
    as two sources then see much more of the view at a good angle (docs/adr/0019).

    Args:
        scene: The views and their statistics.
        reference_index: Position of the reference in `scene.views`.
        choices: The result of `choose_sources`.
        num_sources: How many to take at most.

    Returns:
        Up to `num_sources` of the choices, in their order.
    """
    taken = list(range(min(num_sources, len(choices))))
    others = list(range(len(taken), len(choices)))
    if not taken or not others:
        return tuple(choices[index] for index in taken)
    seen = _well_seen(scene, reference_index, [choice.index for choice in choices])
    while True:
        number = seen[taken].sum(axis=0)
        values = np.array(
            [_value(number - seen[old] + seen[others]) for old in reversed(taken)]
        )
        if values.max() - _value(number) <= LEAST_GAIN:
            return tuple(choices[index] for index in taken)
        last, first = np.unravel_index(np.argmax(values), values.shape)
        taken[-1 - last], others[first] = others[first], taken[-1 - last]
        taken.sort()
        others.sort()


def _well_seen(
    scene: Scene, reference: int, indices: Sequence[int]
) -> npt.NDArray[np.int64]:
    """Whether views see parts of the reference at a good angle, 0 or 1, (C, parts)."""
    depths = _likely_depths(scene, reference, indices)
    view = scene.views[reference]
    sightings = [overlap(view, scene.views[index], depths) for index in indices]
    well = [it.inside & (it.angle_deg >= GOOD_ANGLES_DEG[0]) for it in sightings]
    return np.stack(well).reshape(len(indices), -1).astype(np.int64)


def _value(number: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    """Mean share of two sources that see each part, in 0..1."""
    return np.asarray(np.minimum(number, 2).mean(axis=-1) / 2)


def _at_other_places(scene: Scene, reference: int, others: Sequence[int]) -> list[int]:
    """The others, without repetitions, that have a baseline to the reference."""
    view = scene.views[reference]
    distances = {i: baseline(view, scene.views[i]) for i in others if i != reference}
    typical = float(np.median([baseline(view, other) for other in scene.views]))
    centers = np.array([it.center_in_world for it in scene.views])
    rounding = 1e-9 * float(np.abs(centers).max())
    least = max(LEAST_BASELINE_RATIO * typical, rounding)
    return [index for index, distance in distances.items() if distance > least]


def _shares_points(scene: Scene, reference: int, others: Sequence[int]) -> bool:
    shared = scene.num_shared_points
    return shared is not None and any(shared[reference, i] > 0 for i in others)


def _by_points(scene: Scene, reference: int, index: int) -> SourceChoice:
    num_shared, angle_deg = 0, 0.0
    if scene.num_shared_points is not None:
        num_shared = int(scene.num_shared_points[reference, index])
    if scene.triangulation_angle_deg is not None:
        angle_deg = float(scene.triangulation_angle_deg[reference, index])
    reason = f"{num_shared} shared points, {angle_deg:.1f} deg"
    return SourceChoice(
        index=index,
        reason=reason,
        score=num_shared * float(_angle_weight(np.array(angle_deg))),
        num_shared_points=num_shared,
        angle_deg=angle_deg,
        baseline=baseline(scene.views[reference], scene.views[index]),
    )


def _by_pose(scene: Scene, reference: int, index: int, depths: Matrix) -> SourceChoice:
    view, other = scene.views[reference], scene.views[index]
    seen = overlap(view, other, depths)
    share = float(seen.inside.mean(axis=1).max())
    angle_deg = _angle_between_axes_deg(view, other)
    reason = (
        f"no sparse points: {100 * share:.0f} % overlap by pose, "
        f"{angle_deg:.1f} deg between axes"
    )
    return SourceChoice(
        index=index,
        reason=reason,
        score=float((seen.inside * _angle_weight(seen.angle_deg)).mean()),
        num_shared_points=0,
        angle_deg=angle_deg,
        baseline=baseline(view, other),
    )


def _likely_depths(scene: Scene, reference: int, others: Sequence[int]) -> Matrix:
    """Depths at which to compare all candidates, shape (D,), in units."""
    if scene.depth_range is not None and scene.depth_range[reference, 1] > 0:
        near, far = scene.depth_range[reference]
        return np.geomspace(near, far, len(DEPTHS_IN_BASELINES))
    view = scene.views[reference]
    nearest = sorted(baseline(view, scene.views[index]) for index in others)[:3]
    return DEPTHS_IN_BASELINES * (float(np.median(nearest)) if nearest else 1.0)


def _angle_weight(angle_deg: Matrix) -> Matrix:
    """1 at good angles, a quarter at half the least and twice the largest of them."""
    low, high = GOOD_ANGLES_DEG
    weight = np.minimum(angle_deg / low, high / np.maximum(angle_deg, high)) ** 2
    return np.where(angle_deg > LARGEST_ANGLE_DEG, 0.0, np.minimum(weight, 1.0))


def _angle_between_axes_deg(first: View, second: View) -> float:
    cosine = float(first.cam_from_world[2, :3] @ second.cam_from_world[2, :3])
    return math.degrees(math.acos(min(1.0, max(-1.0, cosine))))
