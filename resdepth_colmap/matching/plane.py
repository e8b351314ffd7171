"""Slanted planes, the hypotheses of the PatchMatch. Compiled by numba.

A plane is what Bleyer et al. (PatchMatch Stereo, BMVC 2011, equation 1) give to each
pixel, in inverse depth instead of disparity: an affine function of the pixel.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit


class Plane(NamedTuple):
    """The plane of a pixel; in arrays the last axis holds these three.

    Attributes:
        w: Inverse depth at the pixel, in 1/unit.
        gx: Change of the inverse depth a pixel to the right, in 1/unit.
        gy: Likewise a pixel down.
    """

    w: np.float32
    gx: np.float32
    gy: np.float32


@njit(cache=True, inline="always")
def load_plane(values):
    """The plane of an array of shape (3,)."""
    return Plane(values[0], values[1], values[2])


@njit(cache=True, inline="always")
def store_plane(values, plane):
    """Write a plane into an array of shape (3,)."""
    values[0] = plane.w
    values[1] = plane.gx
    values[2] = plane.gy


@njit(cache=True, fastmath=True, inline="always")
def inverse_depth_beside(plane, dx, dy):
    """Inverse depth of a pixel's plane at another pixel, (dx, dy) away."""
    return plane.w + plane.gx * dx + plane.gy * dy


@njit(cache=True, fastmath=True, inline="always")
def viewing_ray(x, y, K):
    """The ray of a pixel, to depth 1, without its z."""
    return (x - K[0, 2]) / K[0, 0], (y - K[1, 2]) / K[1, 1]


@njit(cache=True, fastmath=True, inline="always")
def plane_through(w, normal, x, y, K):
    """The plane with that normal through the pixel at inverse depth w."""
    nx, ny, nz = normal
    along_ray = nx * (x - K[0, 2]) / K[0, 0] + ny * (y - K[1, 2]) / K[1, 1] + nz
    scale = w / along_ray
    return Plane(w, scale * nx / K[0, 0], scale * ny / K[1, 1])


@njit(cache=True, fastmath=True, inline="always")
def plane_normal(plane, x, y, K):
    """Unit normal of a pixel's plane, in the camera frame, towards the camera."""
    nx = -plane.gx * K[0, 0]
    ny = -plane.gy * K[1, 1]
    nz = -(plane.w + plane.gx * (K[0, 2] - x) + plane.gy * (K[1, 2] - y))
    norm = math.sqrt(nx * nx + ny * ny + nz * nz) + np.float32(1e-30)
    return nx / norm, ny / norm, nz / norm


@njit(cache=True, fastmath=True, inline="always")
def faces_camera(normal, x, y, K):
    """Whether a plane is seen at less than about 84 degrees from its normal."""
    rx, ry = viewing_ray(x, y, K)
    return -(normal[0] * rx + normal[1] * ry + normal[2]) > np.float32(0.1) * math.sqrt(
        rx * rx + ry * ry + np.float32(1.0)
    )
