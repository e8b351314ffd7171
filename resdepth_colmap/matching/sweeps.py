"""The sweeps of the PatchMatch over the checkerboard. Compiled by numba."""

import numba
import numpy as np
from numba import njit, prange

from resdepth_colmap.matching.cost import MAX_COST, plane_cost, reference_window
from resdepth_colmap.matching.perturbation import NUM_TRIALS, make_trials
from resdepth_colmap.matching.planes import (
    inverse_depth_at,
    inverse_depth_per_px,
    next_random,
    plane_gradient,
    plane_normal,
    random_gradient,
    seeded_state,
)
from resdepth_colmap.matching.propagation import (
    NUM_STATES,
    earlier_twin,
    gather_states,
)
from resdepth_colmap.matching.smoothness import (
    NUM_NEIGHBORS,
    gather_neighbors,
    roughness,
)
from resdepth_colmap.matching.view_weights import weigh_views
from resdepth_colmap.matching.visibility import bounded_cost, geometric_cost

# Without this numba tries TBB first, and warns where it finds an old one.
numba.config.THREADING_LAYER_PRIORITY = [  # type: ignore[attr-defined] # set at run time
    "omp",
    "tbb",
    "workqueue",
]

ONE = np.float32(1)
LEAST_WEIGHT = np.float32(0.01)  # a source below it is not asked about trials


@njit(cache=True, parallel=True, fastmath=True)
def random_planes(planes, K, w_range, seed):
    """Fill planes (H, W, 3) by chance, uniform in inverse depth."""
    height, width = planes.shape[:2]
    for y in prange(height):
        for x in range(width):
            state = seeded_state(seed, y * width + x, 0)
            u, state = next_random(state)
            w = inverse_depth_at(u, w_range)
            fx, fy = np.float32(x), np.float32(y)
            gx, gy, state = random_gradient(w, fx, fy, K, state)
            planes[y, x, 0], planes[y, x, 1], planes[y, x, 2] = w, gx, gy


@njit(cache=True, parallel=True, fastmath=True)
def planes_of(depth, normals, K, w_range, planes):
    """Fill planes (H, W, 3) from depth (H, W) and normals (H, W, 3)."""
    height, width = depth.shape
    for y in prange(height):
        for x in range(width):
            w = w_range[0]
            if depth[y, x] > 0:
                w = min(max(ONE / depth[y, x], w_range[0]), w_range[1])
            n = normals[y, x]
            planes[y, x, 0] = w
            planes[y, x, 1], planes[y, x, 2] = np.float32(0), np.float32(0)
            if n[2] < 0:
                gx, gy = plane_gradient(
                    w, n[0], n[1], n[2], np.float32(x), np.float32(y), K
                )
                planes[y, x, 1], planes[y, x, 2] = gx, gy


@njit(cache=True, parallel=True, fastmath=True)
def normals_of(planes, K, normals):
    """Unit normals, towards the camera, of all planes."""
    height, width = planes.shape[:2]
    for y in prange(height):
        for x in range(width):
            n = plane_normal(planes[y, x, 0], planes[y, x, 1], planes[y, x, 2],
                        np.float32(x), np.float32(y), K)  # fmt: skip
            normals[y, x, 0], normals[y, x, 1], normals[y, x, 2] = n[0], n[1], n[2]


@njit(cache=True, parallel=True, fastmath=True)
def match_costs(levels, planes, sources, window, costs):
    """1 - NCC of each pixel's plane in each source: costs, shape (S, H, W), 0..2."""
    height, width = levels.shape[1:]
    for y in prange(height):
        weights = np.empty(window.dx.shape[0], np.float32)
        values = np.empty(window.dx.shape[0], np.float32)
        for x in range(width):
            level, mean, variance = reference_window(
                levels, x, y, window, weights, values
            )
            for s in range(costs.shape[0]):
                costs[s, y, x] = plane_cost(
                    np.float32(x), np.float32(y), planes[y, x, 0], planes[y, x, 1],
                    planes[y, x, 2], sources, s, level, window, weights, values, mean,
                    variance,
                )  # fmt: skip


@njit(cache=True, fastmath=True)
def _view_cost(x, y, w, gx, gy, sources, s, level, window, weights, values, mean,
               variance, geometric):  # fmt: skip
    """The cost of a plane in a source, `OUTSIDE` where that does not see it."""
    cost = plane_cost(
        x, y, w, gx, gy, sources, s, level, window, weights, values, mean, variance
    )
    if geometric:
        return geometric_cost(cost, x, y, w, sources, s)
    return cost


@njit(cache=True, fastmath=True)
def _finest_step(x, y, w, sources):
    """Inverse depth for a pixel of disparity, in the source where it is least."""
    step = np.float32(1e30)
    for s in range(sources.A.shape[0]):
        step = min(step, inverse_depth_per_px(x, y, w, sources.A, sources.b, s))
    return step


@njit(cache=True, parallel=True, fastmath=True)
def sweep(levels, K, planes, costs, sources, window, w_range, smoothness, seed,
          number, color, geometric, rows):  # fmt: skip
    """Update the pixels of one colour of the checkerboard in place.

    Each pixel takes the best of its own plane, those of eight neighbouring regions,
    and random and perturbed ones, by the cost weighted over the sources plus the
    roughness.

    Args:
        levels: Grey values of the reference at each level of blur, (NUM_LEVELS, H, W).
        K: Its intrinsics.
        planes: Shape (H, W, 3), updated.
        costs: Shape (H, W), updated.
        sources: The source views.
        window: Where windows are sampled.
        w_range: Least and greatest inverse depth.
        smoothness: Weight of the roughness; 0 = none.
        seed: Seed of the random planes.
        number: Number of the sweep, from 1.
        color: 0 or 1.
        geometric: Whether the sources' depth maps count.
        rows: First row and the one after the last; the order of rows is free.
    """
    width = levels.shape[2]
    num_sources = sources.A.shape[0]
    for index in prange(rows[1] - rows[0]):
        # An unsigned number and a signed one would make a float.
        y = rows[0] + np.int64(index)
        weights = np.empty(window.dx.shape[0], np.float32)
        values = np.empty(window.dx.shape[0], np.float32)
        states = np.empty((NUM_STATES, 3), np.float32)
        trials = np.empty((NUM_TRIALS, 3), np.float32)
        matrix = np.empty((NUM_STATES, num_sources), np.float32)
        view_weights = np.empty(num_sources, np.float32)
        near = np.zeros(NUM_NEIGHBORS, np.float32)
        near_weights = np.zeros(NUM_NEIGHBORS, np.float32)
        for x in range((y + color) % 2, width, 2):
            level, mean, variance = reference_window(
                levels, x, y, window, weights, values
            )
            fx, fy = np.float32(x), np.float32(y)
            if smoothness > 0:
                gather_neighbors(levels[0], planes, x, y, near, near_weights)
            count = gather_states(x, y, planes, costs, w_range, K, states)
            px_per_w = ONE / _finest_step(fx, fy, states[0, 0], sources)
            best, best_cost = 0, np.float32(1e9)
            for i in range(count):
                # A single source has all the weight: what is rough needs no match.
                if num_sources == 1 and best_cost <= smoothness * roughness(
                    states[i], px_per_w, near, near_weights
                ):
                    matrix[i, 0] = MAX_COST
                    continue
                twin = earlier_twin(states, i, px_per_w)
                for s in range(num_sources):
                    if twin >= 0:
                        matrix[i, s] = matrix[twin, s]
                    else:
                        matrix[i, s] = _view_cost(
                            fx, fy, states[i, 0], states[i, 1], states[i, 2], sources,
                            s, level, window, weights, values, mean, variance,
                            geometric,
                        )  # fmt: skip
                if num_sources == 1:
                    cost = bounded_cost(matrix[i, 0], geometric)
                    cost += smoothness * roughness(
                        states[i], px_per_w, near, near_weights
                    )
                    best_cost = min(best_cost, cost)
            weigh_views(matrix, count, number, view_weights)
            main = np.argmax(view_weights)
            w_per_px = inverse_depth_per_px(
                fx, fy, states[0, 0], sources.A, sources.b, main
            )
            best_cost = np.float32(1e9)
            for i in range(count):  # its own plane first: it wins ties
                cost = smoothness * roughness(
                    states[i], ONE / w_per_px, near, near_weights
                )
                for s in range(num_sources):
                    cost += view_weights[s] * bounded_cost(matrix[i, s], geometric)
                if cost < best_cost:
                    best, best_cost = i, cost
            plane = states[best]
            w_per_px = inverse_depth_per_px(
                fx, fy, plane[0], sources.A, sources.b, main
            )
            state = seeded_state(seed, y * width + x, number)
            make_trials(plane, fx, fy, K, w_range, w_per_px, state, trials)
            for i in range(NUM_TRIALS):
                if not w_range[0] <= trials[i, 0] <= w_range[1]:
                    continue
                cost = smoothness * roughness(
                    trials[i], ONE / w_per_px, near, near_weights
                )
                for s in range(num_sources):
                    # What is dear already is not looked at in more sources.
                    if view_weights[s] > LEAST_WEIGHT and cost < best_cost:
                        match = _view_cost(
                            fx, fy, trials[i, 0], trials[i, 1], trials[i, 2], sources,
                            s, level, window, weights, values, mean, variance,
                            geometric,
                        )  # fmt: skip
                        cost += view_weights[s] * bounded_cost(match, geometric)
                if cost < best_cost:
                    best_cost = cost
                    plane = trials[i]
            for i in range(3):
                planes[y, x, i] = plane[i]
            costs[y, x] = best_cost
