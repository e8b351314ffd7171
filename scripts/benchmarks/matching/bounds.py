"""What the matcher cannot be faster than: its arithmetic, and the memory it streams.

The arithmetic is that of the window costs that a run computes, at the speed that they
have while all data stay in the nearest cache.
"""

import time
import types
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.matching import patch_match, sweeps
from resdepth_colmap.matching.cost import make_window, plane_cost, reference_patch
from resdepth_colmap.matching.patch_match import MatchView
from resdepth_colmap.matching.plane import Plane
from resdepth_colmap.matching.views import blur_levels, pack_sources

_CACHED_PX = 32
_NUM_CALLS = 200_000
_STREAMED_BYTES = 256 << 20
_NUM_REPEATS = 3


class CountedSources(NamedTuple):
    """`matching.views.Sources`, and how often a plane was looked at in one of them."""

    A: npt.NDArray[np.float32]
    b: npt.NDArray[np.float32]
    pixels: npt.NDArray[np.float32]
    inverse_depths: npt.NDArray[np.float32]
    starts: npt.NDArray[np.int64]
    sizes: npt.NDArray[np.int64]
    num_evaluations: npt.NDArray[np.int64]


def counting_sweep():
    """The kernel `sweep` on one thread; its sources are `CountedSources`."""
    counted_cost = sweeps._view_cost

    @njit(fastmath=True)
    def counting_cost(plane, patch, window, sources, s, geometric):
        sources.num_evaluations[0] += 1
        return counted_cost(plane, patch, window, sources, s, geometric)

    # The steps of the sweep are kernels too: all are made anew around that cost.
    names = {**vars(sweeps), "_view_cost": counting_cost}
    for name in ("_fill_cost_matrix", "_best_propagated", "_store_best", "sweep"):
        code = getattr(sweeps, name).py_func.__code__
        names[name] = njit(fastmath=True)(types.FunctionType(code, names))
    return names["sweep"]


def count_evaluations(
    views: list[MatchView], depth_range: tuple[float, float], config: StereoConfig
) -> int:
    """How often the photometric pass computes a window cost.

    Args:
        views: The reference, then the sources.
        depth_range: Near and far depth.
        config: Options of the matcher.
    """
    count = np.zeros(1, np.int64)
    kernel, original = counting_sweep(), sweeps.sweep

    def counted(reference, sources, *rest):
        kernel(reference, CountedSources(*sources, count), *rest)

    # The matcher looks its kernel up in the module at each call.
    setattr(sweeps, "sweep", counted)  # noqa: B010 (mypy wants a kernel there)
    try:
        patch_match.match_view(views[0], views[1:], depth_range, config)
    finally:
        setattr(sweeps, "sweep", original)  # noqa: B010
    # And those of the planes before and after all sweeps.
    return int(count[0]) + 2 * views[0].gray.size * (len(views) - 1)


@njit(cache=True, fastmath=True)
def _repeated_costs(levels, sources, window, weights, values, num_calls):
    middle = levels.shape[1] // 2
    patch = reference_patch(levels, middle, middle, window, weights, values)
    total = np.float32(0)
    for i in range(num_calls):
        w = np.float32(0.25) + np.float32(1e-3) * np.float32(i % 16)
        plane = Plane(w, np.float32(1e-4), np.float32(1e-4))
        total += plane_cost(plane, patch, window, sources, 0)
    return total


@njit(cache=True, fastmath=True)
def _repeated_windows(levels, window, weights, values, num_calls):
    middle = levels.shape[1] // 2
    total = np.float32(0)
    for i in range(num_calls):
        x = middle + i % 4
        patch = reference_patch(levels, x, middle, window, weights, values)
        total += patch.level + patch.mean + patch.variance
    return total


def seconds_in_cache(config: StereoConfig) -> tuple[float, float]:
    """Processor seconds of one window cost, and of one window of the reference.

    Both on images of 4 KB, which stay in the nearest cache; the least of three runs.
    """
    side = _CACHED_PX
    gray = np.random.default_rng(0).random((side, side), dtype=np.float32)
    K = np.array([[side, 0, side / 2], [0, side, side / 2], [0, 0, 1.0]])
    pose = np.eye(3, 4)
    pose[0, 3] = -0.1
    reference = MatchView(gray=gray, K=K, cam_from_world=np.eye(3, 4))
    source = MatchView(gray=gray, K=K, cam_from_world=pose)
    projections = patch_match._projections(reference, [source])
    packed = pack_sources(*projections, [gray], None)
    window = make_window(config)
    levels = blur_levels(gray)
    weights = np.empty(len(window.dx), np.float32)
    values = np.empty(len(window.dx), np.float32)

    def costs(num_calls):
        _repeated_costs(levels, packed, window, weights, values, num_calls)

    def windows(num_calls):
        _repeated_windows(levels, window, weights, values, num_calls)

    return _seconds_a_call(costs), _seconds_a_call(windows)


def _seconds_a_call(run: Callable[[int], None]) -> float:
    run(1)  # compile
    seconds = []
    for _ in range(_NUM_REPEATS):
        start = time.process_time()
        run(_NUM_CALLS)
        seconds.append(time.process_time() - start)
    return min(seconds) / _NUM_CALLS


def bytes_per_second() -> float:
    """How fast one core streams memory: the sum of an array beyond all caches."""
    array = np.ones(_STREAMED_BYTES // 4, np.float32)
    seconds = []
    for _ in range(_NUM_REPEATS):
        start = time.process_time()
        array.max()
        seconds.append(time.process_time() - start)
    return array.nbytes / min(seconds)


def streamed_bytes(num_px: int, num_sources: int, num_sweeps: int) -> int:
    """What has to come from memory and go there, if no image fits into a cache.

    Each sweep, of two colours, reads the reference and the sources, and reads and
    writes planes and costs: once a colour.
    """
    a_colour = 4 + 4 * num_sources + 2 * (12 + 4)
    return num_px * 2 * a_colour * num_sweeps
