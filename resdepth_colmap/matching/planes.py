"""Hypotheses of the PatchMatch: slanted planes, random numbers. Compiled by numba.

A hypothesis is a slanted plane. Seen from the reference camera, a plane's inverse
depth is an affine function of the pixel (Bleyer et al., PatchMatch Stereo, BMVC 2011),
so a hypothesis is three numbers: the inverse depth `w` at its pixel and its gradient
`(gx, gy)` in 1/unit per pixel. A pixel then lies in the source view at the homogeneous
position ``A (x, y, 1) + b w(x, y)`` with ``A = K_s R K_r^-1`` and ``b = K_s t``.
"""

import math

import numpy as np
from numba import njit

WIDE_RANGE = np.float32(20.0)


@njit(cache=True, inline="always")
def next_random(state):
    """One number in [0, 1) and the next state (Marsaglia's xorshift64)."""
    state ^= state << np.uint64(13)
    state ^= state >> np.uint64(7)
    state ^= state << np.uint64(17)
    return np.float32((state >> np.uint64(40)) * (1.0 / 16777216.0)), state


@njit(cache=True, inline="always")
def seeded_state(seed, pixel, sweep):
    """A state that depends on the pixel alone, not on the thread (splitmix64)."""
    state = (
        np.uint64(seed) * np.uint64(0x9E3779B97F4A7C15)
        + np.uint64(pixel) * np.uint64(0xBF58476D1CE4E5B9)
        + np.uint64(sweep + 1) * np.uint64(0x94D049BB133111EB)
    )
    state ^= state >> np.uint64(30)
    state *= np.uint64(0xBF58476D1CE4E5B9)
    state ^= state >> np.uint64(27)
    state *= np.uint64(0x94D049BB133111EB)
    state ^= state >> np.uint64(31)
    return state | np.uint64(1)


@njit(cache=True, fastmath=True)
def inverse_depth_at(share, w_range):
    """Inverse depth at a share in 0..1 of the range: uniform, as disparity is.

    A range known from the poses alone may span three powers of ten; then it is uniform
    in the logarithm, or all draws would fall on what is nearest.
    """
    low, high = w_range[0], w_range[1]
    if high > WIDE_RANGE * low:
        return low * np.float32(math.exp(share * np.float32(math.log(high / low))))
    return low + share * (high - low)


@njit(cache=True, fastmath=True, inline="always")
def plane_gradient(w, nx, ny, nz, x, y, K):
    """Gradient of the inverse depth of a plane with normal n, through depth 1/w."""
    along_ray = nx * (x - K[0, 2]) / K[0, 0] + ny * (y - K[1, 2]) / K[1, 1] + nz
    scale = w / along_ray
    return scale * nx / K[0, 0], scale * ny / K[1, 1]


@njit(cache=True, fastmath=True, inline="always")
def plane_normal(w, gx, gy, x, y, K):
    """Unit normal, towards the camera, of a plane given in inverse depth."""
    nx = -gx * K[0, 0]
    ny = -gy * K[1, 1]
    nz = -(w + gx * (K[0, 2] - x) + gy * (K[1, 2] - y))
    norm = math.sqrt(nx * nx + ny * ny + nz * nz) + np.float32(1e-30)
    return nx / norm, ny / norm, nz / norm


@njit(cache=True, fastmath=True, inline="always")
def faces_camera(nx, ny, nz, x, y, K):
    """Whether a plane is seen at less than about 84 degrees from its normal."""
    rx = (x - K[0, 2]) / K[0, 0]
    ry = (y - K[1, 2]) / K[1, 1]
    return -(nx * rx + ny * ry + nz) > np.float32(0.1) * math.sqrt(
        rx * rx + ry * ry + np.float32(1.0)
    )


@njit(cache=True, fastmath=True)
def random_gradient(w, x, y, K, state):
    """A plane with a random normal within about 75 degrees of the viewing ray."""
    rx = (x - K[0, 2]) / K[0, 0]
    ry = (y - K[1, 2]) / K[1, 1]
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
    if not faces_camera(nx, ny, nz, x, y, K):
        nx, ny, nz = np.float32(0), np.float32(0), np.float32(-1)
    gx, gy = plane_gradient(w, nx, ny, nz, x, y, K)
    return gx, gy, state


@njit(cache=True, fastmath=True, inline="always")
def inverse_depth_per_px(x, y, w, A, b, s):
    """Change of inverse depth that moves the pixel by one pixel in source s."""
    u0 = A[s, 0, 0] * x + A[s, 0, 1] * y + A[s, 0, 2] + b[s, 0] * w
    u1 = A[s, 1, 0] * x + A[s, 1, 1] * y + A[s, 1, 2] + b[s, 1] * w
    u2 = max(
        A[s, 2, 0] * x + A[s, 2, 1] * y + A[s, 2, 2] + b[s, 2] * w, np.float32(1e-3)
    )
    dx = (b[s, 0] - b[s, 2] * u0 / u2) / u2
    dy = (b[s, 1] - b[s, 2] * u1 / u2) / u2
    return np.float32(1.0) / (math.sqrt(dx * dx + dy * dy) + np.float32(1e-12))
