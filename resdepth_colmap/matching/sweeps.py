"""The sweeps of the PatchMatch over the checkerboard. Compiled by numba."""

import math

import numba
import numpy as np
from numba import njit, prange

from resdepth_colmap.matching.cost import plane_cost, reference_window, weigh_views
from resdepth_colmap.matching.planes import (
    faces_camera,
    inverse_depth_at,
    inverse_depth_per_px,
    next_random,
    plane_gradient,
    plane_normal,
    random_gradient,
    seeded_state,
)

# Without this numba tries TBB first, and warns where it finds an old one.
numba.config.THREADING_LAYER_PRIORITY = [  # type: ignore[attr-defined] # set at run time
    "omp",
    "tbb",
    "workqueue",
]

NUM_STATES = 9  # eight neighbours and the plane that the pixel has
NUM_TRIALS = 6  # random and perturbed planes

# The checkerboard's regions (Xu & Tao, ACMM, CVPR 2019, fig. 2): four near ones shaped
# like a V and four far strips. All offsets are odd, so that a sweep over one colour
# reads only the other one and its result does not depend on the order.
_NEAR = [(0, -1), (-1, -2), (1, -2), (-2, -3), (2, -3), (-3, -4), (3, -4)]
_FAR = [(0, -step) for step in range(3, 25, 2)]


def _regions() -> tuple[np.ndarray, np.ndarray]:
    offsets = np.zeros((8, len(_FAR), 2), np.int64)
    counts = np.zeros(8, np.int64)
    for turn in range(4):
        for far, base in enumerate((_NEAR, _FAR)):
            region = 2 * turn + far
            counts[region] = len(base)
            for index, (x, y) in enumerate(base):
                for _ in range(turn):
                    x, y = -y, x
                offsets[region, index] = (x, y)
    return offsets, counts


REGION_OFFSETS, REGION_COUNTS = _regions()


@njit(cache=True, parallel=True, fastmath=True)
def start(reference, K, planes, costs, A, b, pixels, starts, sizes, offsets, w_range,
          sigma_color, seed):  # fmt: skip
    """Random planes, uniform in inverse depth, and their mean cost over the sources."""
    height, width = reference.shape
    for y in prange(height):
        weights = np.empty(offsets.shape[1], np.float32)
        values = np.empty(offsets.shape[1], np.float32)
        for x in range(width):
            mean, variance = reference_window(
                reference, x, y, offsets, sigma_color, weights, values
            )
            state = seeded_state(seed, y * width + x, 0)
            u, state = next_random(state)
            w = inverse_depth_at(u, w_range)
            fx, fy = np.float32(x), np.float32(y)
            gx, gy, state = random_gradient(w, fx, fy, K, state)
            cost = np.float32(0)
            for s in range(A.shape[0]):
                cost += plane_cost(
                    fx, fy, w, gx, gy, A[s], b[s], pixels[starts[s] :], sizes[s, 0],
                    sizes[s, 1], offsets, weights, values, mean, variance,
                )  # fmt: skip
            planes[y, x, 0], planes[y, x, 1], planes[y, x, 2] = w, gx, gy
            costs[y, x] = cost / A.shape[0]


@njit(cache=True, fastmath=True)
def _gather_states(x, y, planes, costs, w_range, K, states):
    """The best plane of each checkerboard region, and the pixel's own (last).

    Returns:
        Number of states found.
    """
    height, width = costs.shape
    count = 0
    for region in range(8):
        best = np.float32(1e9)
        bx, by = -1, -1
        for index in range(REGION_COUNTS[region]):
            nx = x + REGION_OFFSETS[region, index, 0]
            ny = y + REGION_OFFSETS[region, index, 1]
            if 0 <= nx < width and 0 <= ny < height and costs[ny, nx] < best:
                best = costs[ny, nx]
                bx, by = nx, ny
        if bx < 0:
            continue
        gx, gy = planes[by, bx, 1], planes[by, bx, 2]
        w = planes[by, bx, 0] + gx * (x - bx) + gy * (y - by)
        if w_range[0] <= w <= w_range[1]:
            n = plane_normal(w, gx, gy, np.float32(x), np.float32(y), K)
            if faces_camera(n[0], n[1], n[2], np.float32(x), np.float32(y), K):
                states[count, 0], states[count, 1], states[count, 2] = w, gx, gy
                count += 1
    for i in range(3):
        states[count, i] = planes[y, x, i]
    return count + 1


@njit(cache=True, fastmath=True)
def _make_trials(plane, x, y, K, w_range, w_per_px, state, trials):
    """Random and perturbed planes (COLMAP: five combinations; here a sixth).

    Perturbations are log-uniform from 3 px down to 0.02 px of disparity, so that each
    sweep searches both widely and finely.
    """
    w, gx, gy = plane[0], plane[1], plane[2]
    u, state = next_random(state)
    w_random = inverse_depth_at(u, w_range)
    gx_random, gy_random, state = random_gradient(w, x, y, K, state)
    nx, ny, nz = plane_normal(w, gx, gy, x, y, K)
    u, state = next_random(state)
    size = np.float32(0.5) * np.float32(math.exp(np.float32(-4.0) * u))
    dx, state = next_random(state)
    dy, state = next_random(state)
    dz, state = next_random(state)
    nx += size * (np.float32(2) * dx - np.float32(1))
    ny += size * (np.float32(2) * dy - np.float32(1))
    nz += size * (np.float32(2) * dz - np.float32(1))
    gx_near, gy_near = gx, gy
    if faces_camera(nx, ny, nz, x, y, K):
        gx_near, gy_near = plane_gradient(w, nx, ny, nz, x, y, K)
    steps = (np.float32(0), np.float32(0))
    for _ in range(2):
        u, state = next_random(state)
        sign, state = next_random(state)
        step = np.float32(3.0) * np.float32(math.exp(np.float32(-5.0) * u)) * w_per_px
        if sign < np.float32(0.5):
            step = -step
        steps = (steps[1], step)
    ratio = w_random / w
    _set(trials, 0, w, gx_random, gy_random)
    _set(trials, 1, w_random, gx * ratio, gy * ratio)
    _set(trials, 2, w_random, gx_random * ratio, gy_random * ratio)
    _set(trials, 3, w, gx_near, gy_near)
    _set(trials, 4, w + steps[0], gx, gy)
    _set(trials, 5, w + steps[1], gx_near, gy_near)


@njit(cache=True, inline="always")
def _set(trials, index, w, gx, gy):
    trials[index, 0] = w
    trials[index, 1] = gx
    trials[index, 2] = gy


@njit(cache=True, parallel=True, fastmath=True)
def sweep(reference, K, planes, costs, A, b, pixels, starts, sizes, offsets, w_range,
          sigma_color, seed, number, color):  # fmt: skip
    """Update the pixels of one colour of the checkerboard in place.

    Each pixel takes the best of its own plane, those of eight neighbouring regions,
    and random and perturbed ones, by the cost weighted over the sources.
    """
    height, width = reference.shape
    num_sources = A.shape[0]
    for y in prange(height):
        weights = np.empty(offsets.shape[1], np.float32)
        values = np.empty(offsets.shape[1], np.float32)
        states = np.empty((NUM_STATES, 3), np.float32)
        trials = np.empty((NUM_TRIALS, 3), np.float32)
        matrix = np.empty((NUM_STATES, num_sources), np.float32)
        view_weights = np.empty(num_sources, np.float32)
        for x in range((y + color) % 2, width, 2):
            mean, variance = reference_window(
                reference, x, y, offsets, sigma_color, weights, values
            )
            fx, fy = np.float32(x), np.float32(y)
            count = _gather_states(x, y, planes, costs, w_range, K, states)
            for i in range(count):
                for s in range(num_sources):
                    matrix[i, s] = plane_cost(
                        fx, fy, states[i, 0], states[i, 1], states[i, 2], A[s], b[s],
                        pixels[starts[s] :], sizes[s, 0], sizes[s, 1], offsets, weights,
                        values, mean, variance,
                    )  # fmt: skip
            weigh_views(matrix, count, number, view_weights)
            best, best_cost = count - 1, np.float32(1e9)
            for i in range(count - 1, -1, -1):  # its own plane first: it wins ties
                cost = np.float32(0)
                for s in range(num_sources):
                    cost += view_weights[s] * matrix[i, s]
                if cost < best_cost:
                    best, best_cost = i, cost
            plane = states[best]
            main = np.argmax(view_weights)
            w_per_px = inverse_depth_per_px(fx, fy, plane[0], A[main], b[main])
            state = seeded_state(seed, y * width + x, number)
            _make_trials(plane, fx, fy, K, w_range, w_per_px, state, trials)
            for i in range(NUM_TRIALS):
                if not w_range[0] <= trials[i, 0] <= w_range[1]:
                    continue
                cost = np.float32(0)
                for s in range(num_sources):
                    if view_weights[s] > np.float32(0.01) and cost < best_cost:
                        cost += view_weights[s] * plane_cost(
                            fx, fy, trials[i, 0], trials[i, 1], trials[i, 2], A[s],
                            b[s], pixels[starts[s] :], sizes[s, 0], sizes[s, 1],
                            offsets, weights, values, mean, variance,
                        )  # fmt: skip
                if cost < best_cost:
                    best_cost = cost
                    plane = trials[i]
            for i in range(3):
                planes[y, x, i] = plane[i]
            costs[y, x] = best_cost


@njit(cache=True, parallel=True, fastmath=True)
def normals_of(planes, K, normals):
    """Unit normals, towards the camera, of all planes."""
    height, width = planes.shape[:2]
    for y in prange(height):
        for x in range(width):
            n = plane_normal(planes[y, x, 0], planes[y, x, 1], planes[y, x, 2],
                        np.float32(x), np.float32(y), K)  # fmt: skip
            normals[y, x, 0], normals[y, x, 1], normals[y, x, 2] = n[0], n[1], n[2]
