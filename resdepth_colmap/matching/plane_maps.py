"""Planes, normals and costs of all pixels of the reference. Compiled by numba."""

import numpy as np
from numba import njit, prange

from resdepth_colmap.matching.compilation import choose_threading_layer
from resdepth_colmap.matching.cost import plane_cost, reference_patch
from resdepth_colmap.matching.plane import (
    load_plane,
    plane_normal,
    plane_through,
    store_plane,
)
from resdepth_colmap.matching.random_planes import (
    inverse_depth_within,
    next_random,
    random_plane,
    seeded_state,
)
from resdepth_colmap.matching.views import ONE

choose_threading_layer()


@njit(cache=True, parallel=True, fastmath=True)
def random_planes(planes, K, w_range, seed):
    """Fill planes (H, W, 3) at random, uniformly in inverse depth.

    Random initialization of Bleyer et al. (PatchMatch Stereo, BMVC 2011).
    """
    height, width = planes.shape[:2]
    for y in prange(height):
        for x in range(width):
            state = seeded_state(seed, y * width + x, 0)
            u, state = next_random(state)
            w = inverse_depth_within(w_range, u)
            plane, state = random_plane(w, np.float32(x), np.float32(y), K, state)
            store_plane(planes[y, x], plane)


@njit(cache=True, parallel=True, fastmath=True)
def planes_of(depth, normals, K, w_range, planes):
    """Fill planes (H, W, 3) from depth (H, W) and normals (H, W, 3).

    A pixel without depth is as far as can be, one without normal fronto-parallel.
    """
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
                plane = plane_through(
                    w, (n[0], n[1], n[2]), np.float32(x), np.float32(y), K
                )
                store_plane(planes[y, x], plane)


@njit(cache=True, parallel=True, fastmath=True)
def normals_of(planes, K, normals):
    """Fill normals (H, W, 3), towards the camera, of all planes."""
    height, width = planes.shape[:2]
    for y in prange(height):
        for x in range(width):
            plane = load_plane(planes[y, x])
            n = plane_normal(plane, np.float32(x), np.float32(y), K)
            normals[y, x, 0], normals[y, x, 1], normals[y, x, 2] = n


@njit(cache=True, parallel=True, fastmath=True)
def costs_of(planes, reference, sources, window, costs):
    """Fill costs (S, H, W): 1 - NCC of each pixel's plane in each source, in 0..2."""
    height, width = planes.shape[:2]
    for index in prange(height):
        y = np.int64(index)  # as in `sweep`, so that kernels are compiled once
        weights = np.empty(window.dx.shape[0], np.float32)
        values = np.empty(window.dx.shape[0], np.float32)
        for x in range(width):
            patch = reference_patch(reference.levels, x, y, window, weights, values)
            plane = load_plane(planes[y, x])
            for s in range(costs.shape[0]):
                costs[s, y, x] = plane_cost(plane, patch, window, sources, s)
