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
from resdepth_colmap.matching.cost import plane_cost, reference_window
from resdepth_colmap.matching.patch_match import MatchView

_CACHED_PX = 32
_NUM_CALLS = 200_000
_STREAMED_BYTES = 256 << 20
_NUM_REPEATS = 3


class CountedSources(NamedTuple):
    """`matching.cost.Sources`, and how often a plane was looked at in one of them."""

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
    def counting_cost(x, y, w, gx, gy, sources, *rest):
        sources.num_evaluations[0] += 1
        return counted_cost(x, y, w, gx, gy, sources, *rest)

    kernel = sweeps.sweep.py_func
    names = {**kernel.__globals__, "_view_cost": counting_cost}
    return njit(fastmath=True)(types.FunctionType(kernel.__code__, names))


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

    def counted(levels, K, planes, costs, sources, *rest):
        kernel(levels, K, planes, costs, CountedSources(*sources, count), *rest)

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
    x = np.float32(middle)
    level, mean, variance = reference_window(
        levels, middle, middle, window, weights, values
    )
    total = np.float32(0)
    for i in range(num_calls):
        w = np.float32(0.25) + np.float32(1e-3) * np.float32(i % 16)
        total += plane_cost(
            x, x, w, np.float32(1e-4), np.float32(1e-4), sources, 0, level, window,
            weights, values, mean, variance,
        )  # fmt: skip
    return total


@njit(cache=True, fastmath=True)
def _repeated_windows(levels, window, weights, values, num_calls):
    middle = levels.shape[1] // 2
    total = np.float32(0)
    for i in range(num_calls):
        x = middle + i % 4
        level, mean, variance = reference_window(
            levels, x, middle, window, weights, values
        )
        total += level + mean + variance
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
    flat = patch_match._flat_sources(reference, [source], None)
    window = patch_match._window(config)
    levels = patch_match._blurred(gray)
    weights = np.empty(len(window.dx), np.float32)
    values = np.empty(len(window.dx), np.float32)

    def costs(number):
        _repeated_costs(levels, flat, window, weights, values, number)

    def windows(number):
        _repeated_windows(levels, window, weights, values, number)

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
