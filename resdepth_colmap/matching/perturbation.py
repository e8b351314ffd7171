"""Planes that a pixel tries by chance. Compiled by numba."""

import math

import numpy as np
from numba import njit

from resdepth_colmap.matching.planes import (
    faces_camera,
    inverse_depth_at,
    next_random,
    plane_gradient,
    plane_normal,
    random_gradient,
)

NUM_TRIALS = 6


@njit(cache=True, fastmath=True)
def make_trials(plane, x, y, K, w_range, w_per_px, state, trials):
    """Random and perturbed planes (COLMAP: five combinations; here a sixth).

    Perturbations are log-uniform from 3 px down to 0.02 px of disparity, so that each
    sweep searches both widely and finely.

    Args:
        plane: The best plane so far, (3,).
        x: The pixel.
        y: Likewise.
        K: Intrinsics of the reference.
        w_range: Least and greatest inverse depth.
        w_per_px: Inverse depth for a pixel of disparity.
        state: State of the random numbers.
        trials: Shape (NUM_TRIALS, 3), written.
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
