"""The depth range of a view, in which stereo searches."""

from collections.abc import Sequence

import numpy as np

from resdepth_colmap.geometry.overlap import overlap
from resdepth_colmap.scene import Matrix, Scene, baseline

NEAREST_IN_BASELINES = 0.3
FARTHEST_IN_BASELINES = 300.0
NUM_DEPTHS = 61
LEAST_SHARE = 0.5
"""Of the pixels of the reference, relative to the depth where most are seen."""

LARGEST_ANGLE_DEG = 45.0
LEAST_DISPARITY_PX = 1.0


def depth_range(
    scene: Scene, reference_index: int, source_indices: Sequence[int]
) -> tuple[float, float]:
    """Nearest and farthest depth of the surfaces of a view.

    With sparse points it is COLMAP's range. Without, it follows from the poses: a depth
    is inside if a fair share of the pixels of the reference, placed there, is seen by a
    source at no more than 45 degrees and, at the far end, if its disparity differs by a
    pixel from that at infinity.

    Args:
        scene: The views and their statistics.
        reference_index: Position of the view in `scene.views`.
        source_indices: Positions of its sources.

    Returns:
        Near and far depth, in units, 0 < near < far.

    Raises:
        ValueError: If there are neither sparse points nor sources with a baseline.
    """
    if scene.depth_range is not None:
        near, far = (float(depth) for depth in scene.depth_range[reference_index])
        if 0 < near < far:
            return near, far
    return _range_by_pose(scene, reference_index, source_indices)


def _range_by_pose(
    scene: Scene, reference: int, sources: Sequence[int]
) -> tuple[float, float]:
    view = scene.views[reference]
    lengths = [baseline(view, scene.views[index]) for index in sources]
    longest = max(lengths, default=0.0)
    if not longest:
        raise ValueError(
            f"no depth range for {view.name}: no sparse points, and none of its "
            f"{len(lengths)} sources has a baseline."
        )
    shortest = min(length for length in lengths if length > 0)
    depths = np.geomspace(
        shortest * NEAREST_IN_BASELINES, longest * FARTHEST_IN_BASELINES, NUM_DEPTHS
    )
    share, disparity_px = _seen_by_any(scene, reference, sources, depths)
    counts = share >= max(LEAST_SHARE * share.max(), 1e-9)
    if not counts.any():
        return float(depths[0]), float(depths[-1])
    near = int(np.flatnonzero(counts)[0])
    measurable = np.flatnonzero(counts & (disparity_px >= LEAST_DISPARITY_PX))
    far = int(measurable[-1]) if len(measurable) else near
    # One sample further on both sides: the borders lie between the samples.
    return float(depths[max(near - 1, 0)]), float(depths[min(far + 1, len(depths) - 1)])


def _seen_by_any(
    scene: Scene, reference: int, sources: Sequence[int], depths: Matrix
) -> tuple[Matrix, Matrix]:
    """Share of pixels seen by any source, and the largest disparity; shapes (D,)."""
    view = scene.views[reference]
    sightings = [overlap(view, scene.views[index], depths) for index in sources]
    seen = [it.inside & (it.angle_deg <= LARGEST_ANGLE_DEG) for it in sightings]
    share = np.any(seen, axis=0).mean(axis=1)
    disparities = [np.median(it.disparity_px, axis=1) for it in sightings]
    return share, np.max(disparities, axis=0)
