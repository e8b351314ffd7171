"""Speed of the matcher on noise, by size, sources and threads, and its bounds."""

import os
import time
from statistics import median
from typing import Any

import numpy as np

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.matching.patch_match import MatchView, match_view

DEPTH = 4.0
DEPTH_RANGE = (2.0, 8.0)
PX_A_SHIFT = 40
"""Width over the disparity of the nearest source."""

MEGAPIXELS = (0.3, 0.75, 1.5, 3.0, 6.0)
NUM_SOURCES = (1, 2, 4, 6)
NUM_THREADS = (1, 2)
BASE_MEGAPIXELS, BASE_SOURCES = 0.3, 2
NUM_REPEATS = 3
LARGE_MEGAPIXELS = 2.0  # beyond it once is enough
CONFIG = StereoConfig(num_iterations=2)


def noise_views(megapixels: float, num_sources: int) -> list[MatchView]:
    """A plane of noise that faces all cameras, which stand in a row.

    Args:
        megapixels: Size of each image, about; 4 to 3.
        num_sources: Views beside the first one, the reference.
    """
    width_px = round((megapixels * 1e6 * 4 / 3) ** 0.5)
    height_px = round(width_px * 3 / 4)
    rng = np.random.default_rng(0)
    noise = rng.random((height_px, width_px), dtype=np.float32)
    smooth = (noise + np.roll(noise, 1, 0) + np.roll(noise, 1, 1)) / np.float32(3)
    K = np.array([[width_px, 0, width_px / 2], [0, width_px, height_px / 2], [0, 0, 1]])
    shift_px = max(width_px // PX_A_SHIFT, 1)
    views = []
    for index in range(num_sources + 1):
        # To the right, to the left, further to the right, ...
        steps = (index + 1) // 2 * (1 if index % 2 else -1)
        pose = np.eye(3, 4)
        pose[0, 3] = -DEPTH * steps * shift_px / width_px
        gray = np.roll(smooth, -steps * shift_px, axis=1).astype(np.float32)
        views.append(MatchView(gray=gray, K=K.astype(float), cam_from_world=pose))
    return views


def measured_speed() -> dict[str, Any]:
    """Time the photometric pass on noise, and compare it with its bounds."""
    base = noise_views(BASE_MEGAPIXELS, BASE_SOURCES)
    match_view(base[0], base[1:], DEPTH_RANGE, StereoConfig(num_iterations=1))
    start_load = os.getloadavg()[0]
    result = {
        "num_iterations": CONFIG.num_iterations,
        "threads": _by_threads(base),
        "sources": [_timed(BASE_MEGAPIXELS, count) for count in NUM_SOURCES],
        "sizes": [_timed(size, 1) for size in MEGAPIXELS],
        "bounds": _bounds(base),
    }
    return {**result, "load": [start_load, os.getloadavg()[0]]}


def _timed(megapixels: float, num_sources: int) -> dict[str, Any]:
    views = noise_views(megapixels, num_sources)
    repeats = NUM_REPEATS if megapixels < LARGE_MEGAPIXELS else 1
    seconds = median(_seconds(views)[0] for _ in range(repeats))
    units = views[0].gray.size / 1e6 * num_sources * CONFIG.num_iterations
    return {
        "megapixels": views[0].gray.size / 1e6,
        "num_sources": num_sources,
        "repeats": repeats,
        "cpu_s": seconds,
        "cpu_s_per_mp_source_iteration": seconds / units,
    }


def _seconds(views: list[MatchView]) -> tuple[float, float]:
    """Processor seconds of all threads, and those on the wall."""
    wall, cpu = time.perf_counter(), time.process_time()
    match_view(views[0], views[1:], DEPTH_RANGE, CONFIG)
    return time.process_time() - cpu, time.perf_counter() - wall


def _by_threads(views: list[MatchView]) -> list[dict[str, Any]]:
    """Time each number of threads in turn, repeatedly: other jobs disturb all alike."""
    import numba

    found: dict[int, list[tuple[float, float]]] = {n: [] for n in NUM_THREADS}
    before = numba.get_num_threads()
    most = int(getattr(numba.config, "NUMBA_NUM_THREADS", 1))  # set at run time
    possible = [count for count in NUM_THREADS if count <= most]
    for _ in range(NUM_REPEATS):
        for count in possible:
            numba.set_num_threads(count)
            found[count].append(_seconds(views))
    numba.set_num_threads(before)
    return [
        {
            "threads": count,
            "cpu_s": median(cpu for cpu, _ in found[count]),
            "wall_s": median(wall for _, wall in found[count]),
        }
        for count in possible
    ]


def _bounds(views: list[MatchView]) -> dict[str, Any]:
    """The seconds that arithmetic and memory alone take, and those of the matcher."""
    from scripts.benchmarks.matching import bounds  # numba

    num_px, num_sources = views[0].gray.size, len(views) - 1
    num_evaluations = bounds.count_evaluations(views, DEPTH_RANGE, CONFIG)
    cost_s, window_s = bounds.seconds_in_cache(CONFIG)
    # Before and after all sweeps, and in each, every pixel's window is read.
    num_windows = num_px * (CONFIG.num_iterations + 2)
    arithmetic_s = num_evaluations * cost_s + num_windows * window_s
    streamed = bounds.streamed_bytes(num_px, num_sources, CONFIG.num_iterations)
    speed = bounds.bytes_per_second()
    ours_s = median(_seconds(views)[0] for _ in range(NUM_REPEATS))
    return {
        "evaluations_per_px_source_iteration": num_evaluations
        / (num_px * num_sources * CONFIG.num_iterations),
        "ns_per_evaluation_in_cache": 1e9 * cost_s,
        "ns_per_window_in_cache": 1e9 * window_s,
        "gb_per_s": speed / 1e9,
        "arithmetic_s": arithmetic_s,
        "memory_s": streamed / speed,
        "ours_s": ours_s,
        "ours_over_bound": ours_s / max(arithmetic_s, streamed / speed),
    }
