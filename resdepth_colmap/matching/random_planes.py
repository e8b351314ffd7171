"""Planes at random, to start from and to improve on. Compiled by numba.

Bleyer et al. (PatchMatch Stereo, BMVC 2011) call the two steps random initialization
and plane refinement.
"""

import math

import numpy as np
from numba import njit

from resdepth_colmap.matching.plane import (
    Plane,
    faces_camera,
    plane_normal,
    plane_through,
    store_plane,
    viewing_ray,
)

NUM_PERTURBED = 6
WIDE_RANGE = np.float32(20.0)


@njit(cache=True, inline="always")
def next_random(state):
    """One number in [0, 1) and the next state (Marsaglia's xorshift64)."""
    state ^= state << np.uint64(13)
    state ^= state >> np.uint64(7)
    state ^= state << np.uint64(17)
    return np.float32((state >> np.uint64(40)) * (1.0 / 16777216.0)), state


@njit(cache=True, inline="always")
def seeded_state(seed, pixel, iteration):
    """A state that depends on the pixel alone, not on the thread (splitmix64)."""
    state = (
        np.uint64(seed) * np.uint64(0x9E3779B97F4A7C15)
        + np.uint64(pixel) * np.uint64(0xBF58476D1CE4E5B9)
        + np.uint64(iteration + 1) * np.uint64(0x94D049BB133111EB)
    )
    state ^= state >> np.uint64(30)
    state *= np.uint64(0xBF58476D1CE4E5B9)
    state ^= state >> np.uint64(27)
    state *= np.uint64(0x94D049BB133111EB)
    state ^= state >> np.uint64(31)
    return state | np.uint64(1)


@njit(cache=True, fastmath=True)
def inverse_depth_within(w_range, share):
    """Inverse depth at a share in 0..1 of the range: uniform, as disparity is.

    A range known from the poses alone may span three powers of ten; then it is uniform
    in the logarithm, or all draws would fall on what is nearest.
    """
    low, high = w_range[0], w_range[1]
    if high > WIDE_RANGE * low:
        return low * np.float32(math.exp(share * np.float32(math.log(high / low))))
    return low + share * (high - low)


@njit(cache=True, fastmath=True)
def random_plane(w, x, y, K, state):
    """A plane with a random normal within about 75 degrees of the viewing ray.

    Returns:
        The plane through the pixel at inverse depth w, and the next state.
    """
    rx, ry = viewing_ray(x, y, K)
    nx, ny, nz = np.float32(0), np.float32(0), np.float32(-1)
    for _ in range(8):
        u, state = next_random(state)
        v, state = next_random(state)
        cos = np.float32(0.25) + np.float32(0.75) * u
        sin = math.sqrt(np.float32(1.0) - cos * cos)
        phi = np.float32(2.0 * math.pi) * v
        nx, ny, nz = (
            np.float32(sin * math.cos(phi)),
            np.float32(sin * math.sin(phi)),
            -cos,
        )
        if -(nx * rx + ny * ry + nz) > np.float32(0.25):
            break
    if not faces_camera((nx, ny, nz), x, y, K):
        nx, ny, nz = np.float32(0), np.float32(0), np.float32(-1)
    return plane_through(w, (nx, ny, nz), x, y, K), state


@njit(cache=True, fastmath=True, inline="always")
def perturbed_normal(plane, x, y, K, state):
    """The plane with its normal turned a little, log-uniformly from 0.5 to 0.01.

    The plane itself where the turned one does not face the camera (COLMAP,
    patch_match_cuda.cu, PerturbNormal, tries a smaller perturbation first).

    Returns:
        The plane, and the next state.
    """
    nx, ny, nz = plane_normal(plane, x, y, K)
    u, state = next_random(state)
    size = np.float32(0.5) * np.float32(math.exp(np.float32(-4.0) * u))
    dx, state = next_random(state)
    dy, state = next_random(state)
    dz, state = next_random(state)
    nx += size * (np.float32(2) * dx - np.float32(1))
    ny += size * (np.float32(2) * dy - np.float32(1))
    nz += size * (np.float32(2) * dz - np.float32(1))
    turned = plane
    if faces_camera((nx, ny, nz), x, y, K):
        turned = plane_through(plane.w, (nx, ny, nz), x, y, K)
    return turned, state


@njit(cache=True, fastmath=True, inline="always")
def random_step(w_per_px, state):
    """A step of inverse depth, log-uniformly from 3 px down to 0.02 px of disparity.

    Returns:
        The step, of either sign, and the next state.
    """
    u, state = next_random(state)
    sign, state = next_random(state)
    step = np.float32(3.0) * np.float32(math.exp(np.float32(-5.0) * u)) * w_per_px
    if sign < np.float32(0.5):
        step = -step
    return step, state


@njit(cache=True, fastmath=True)
def perturb_plane(plane, x, y, K, w_range, w_per_px, state, perturbed):
    """The hypotheses of the refinement: random and perturbed depths and normals.

    The five combinations of COLMAP (patch_match_cuda.cu, SweepFromTopToBottom) and
    ACMM (ACMM.cu, PlaneHypothesisRefinement), and a sixth with both perturbed. Steps
    are log-uniform, so that each sweep searches both widely and finely.

    Args:
        plane: The best plane so far.
        x: The pixel.
        y: Likewise.
        K: Intrinsics of the reference.
        w_range: Least and greatest inverse depth; steps may lead out of it.
        w_per_px: Inverse depth for a pixel of disparity.
        state: State of the random numbers.
        perturbed: Shape (NUM_PERTURBED, 3), written.
    """
    w, gx, gy = plane
    u, state = next_random(state)
    w_random = inverse_depth_within(w_range, u)
    random, state = random_plane(w, x, y, K, state)
    turned, state = perturbed_normal(plane, x, y, K, state)
    first_step, state = random_step(w_per_px, state)
    second_step, state = random_step(w_per_px, state)
    ratio = w_random / w  # keeps the normal
    store_plane(perturbed[0], random)
    store_plane(perturbed[1], Plane(w_random, gx * ratio, gy * ratio))
    store_plane(perturbed[2], Plane(w_random, random.gx * ratio, random.gy * ratio))
    store_plane(perturbed[3], turned)
    store_plane(perturbed[4], Plane(w + first_step, gx, gy))
    store_plane(perturbed[5], Plane(w + second_step, turned.gx, turned.gy))
