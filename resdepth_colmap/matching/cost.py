"""How well a plane explains a source view: bilaterally weighted NCC. Compiled by numba.

Schoenberger et al. (ECCV 2016), "Photometric Consistency"; COLMAP, patch_match_cuda.cu,
PhotoConsistencyCostComputer, and gpu_mat_ref_image.h, BilateralWeightComputer.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.matching.views import ONE, SMALL, ZERO, FloatArray, project

MAX_COST = np.float32(2.0)  # COLMAP's kMaxCost: 1 - NCC of perfectly opposite patches
OUTSIDE = np.float32(1.0)  # the source does not see the plane: neither good nor bad
MIN_VARIANCE = np.float32(1e-5)  # COLMAP: below it a patch has no texture


class Window(NamedTuple):
    """Where a window is sampled.

    Attributes:
        dx: Offsets in pixels, shape (N,); N is a multiple of 8, as loops are vectors.
        dy: Likewise.
        spatial: Spatial weight of each sample, (N,); 0 = a filler.
        sigma_color: Spread of the bilateral weight in grey values.
    """

    dx: FloatArray
    dy: FloatArray
    spatial: FloatArray
    sigma_color: np.float32


class Patch(NamedTuple):
    """What the reference shows in the window about a pixel.

    Attributes:
        x: The pixel.
        y: Likewise.
        level: Level of blur; the window is ``2**level`` times its size.
        mean: Weighted mean of the grey values.
        variance: Weighted variance of the grey values.
        weights: Bilateral weights, shape (N,); they sum to 1.
        values: Grey values, shape (N,).
    """

    x: np.float32
    y: np.float32
    level: int
    mean: np.float32
    variance: np.float32
    weights: FloatArray
    values: FloatArray


def make_window(config: StereoConfig) -> Window:
    """The window's samples, filled up to a multiple of 8."""
    radius = config.window_radius
    steps = np.arange(-radius, radius + 1, config.window_step, dtype=np.float32)
    dx, dy = (grid.ravel() for grid in np.meshgrid(steps, steps))
    # COLMAP: sigma_spatial is the window's radius.
    spatial = np.exp(-(dx**2 + dy**2) / (2.0 * radius**2))
    fill = (0, -len(dx) % 8)
    return Window(
        dx=np.pad(dx, fill),
        dy=np.pad(dy, fill),
        spatial=np.pad(spatial, fill).astype(np.float32),
        sigma_color=np.float32(config.sigma_color),
    )


@njit(cache=True, fastmath=True, inline="always")
def reference_patch(levels, x, y, window, weights, values):
    """The patch of the reference at the first level of blur that has texture.

    Where a window shows nothing, one of twice the size on a blurred image may: what the
    coarse scales of ACMM (Xu & Tao, CVPR 2019) are for, pixel by pixel.

    Args:
        levels: Grey values of the reference, shape (NUM_LEVELS, H, W).
        x: The pixel.
        y: Likewise.
        window: Where the window is sampled.
        weights: Memory for the weights of the patch, shape (N,).
        values: Likewise for its grey values.
    """
    level, mean, variance = _weighted_window(levels, x, y, window, weights, values)
    return Patch(np.float32(x), np.float32(y), level, mean, variance, weights, values)


@njit(cache=True, fastmath=True)
def _weighted_window(levels, x, y, window, weights, values):
    """Fill weights and values.

    Returns:
        The level, and weighted mean and variance of the reference's grey values.
    """
    level = 0
    mean, variance = _window_at(levels[0], x, y, ONE, window, weights, values)
    while variance < MIN_VARIANCE and level < levels.shape[0] - 1:
        level += 1
        scale = np.float32(1 << level)
        mean, variance = _window_at(levels[level], x, y, scale, window, weights, values)
    return level, mean, variance


@njit(cache=True, fastmath=True)
def _window_at(reference, x, y, scale, window, weights, values):
    """Bilateral weights of a window (COLMAP, BilateralWeightComputer), summing to 1.

    The weight of a grey value, exp(-a), is taken as (1 - a / 8)^8, which needs no call
    and so lets the loop be vectorised.

    Returns:
        Weighted mean and variance of the reference's grey values.
    """
    height, width = reference.shape
    pixels = reference.reshape(-1)
    row = np.int32(width)
    x_last, y_last = np.float32(width - 1), np.float32(height - 1)
    fx, fy = np.float32(x), np.float32(y)
    center = reference[y, x]
    color_factor = np.float32(-0.0625) / (window.sigma_color * window.sigma_color)
    total, mean, square = ZERO, ZERO, ZERO
    for k in range(window.dx.shape[0]):
        xs = fx + scale * window.dx[k]
        ys = fy + scale * window.dy[k]
        xs = xs if xs > ZERO else ZERO
        ys = ys if ys > ZERO else ZERO
        xs = xs if xs < x_last else x_last
        ys = ys if ys < y_last else y_last
        value = pixels[np.uint64(np.uint32(np.int32(ys) * row + np.int32(xs)))]
        delta = value - center
        weight = ONE + delta * delta * color_factor
        weight = weight if weight > ZERO else ZERO
        weight *= weight
        weight *= weight
        weight = window.spatial[k] * weight * weight
        weights[k] = weight
        values[k] = value
        total += weight
        mean += weight * value
        square += weight * value * value
    inverse = ONE / (total + np.float32(1e-12))  # the centre may be no sample
    for k in range(window.dx.shape[0]):
        weights[k] *= inverse
    mean *= inverse
    return mean, max(square * inverse - mean * mean, ZERO)


@njit(cache=True, fastmath=True, inline="always")
def plane_cost(plane, patch, window, sources, s):
    """1 - NCC of the reference's patch and that of source s, in 0..2.

    The source's patch is where the plane takes the window: slanted, as in Bleyer et al.
    (PatchMatch Stereo, BMVC 2011).

    Returns:
        `OUTSIDE` where the plane's centre is behind the source or out of its image,
        `MAX_COST` where there is no texture.
    """
    A, b, pixels = sources.A, sources.b, sources.pixels[patch.level]
    scale = np.float32(1 << patch.level)
    width, height = sources.sizes[s, 0], sources.sizes[s, 1]
    start = np.uint64(sources.starts[s])
    u0 = project(patch.x, patch.y, plane.w, sources, s, 0)
    u1 = project(patch.x, patch.y, plane.w, sources, s, 1)
    u2 = project(patch.x, patch.y, plane.w, sources, s, 2)
    if u2 < SMALL:
        return OUTSIDE
    xc, yc = u0 / u2, u1 / u2
    if not (xc >= 0 and yc >= 0 and xc <= width - 1 and yc <= height - 1):
        return OUTSIDE
    gx, gy = plane.gx, plane.gy
    ux0, uy0 = A[s, 0, 0] + b[s, 0] * gx, A[s, 0, 1] + b[s, 0] * gy
    ux1, uy1 = A[s, 1, 0] + b[s, 1] * gx, A[s, 1, 1] + b[s, 1] * gy
    ux2, uy2 = A[s, 2, 0] + b[s, 2] * gx, A[s, 2, 1] + b[s, 2] * gy
    x_last = np.float32(width) - np.float32(1.001)
    y_last = np.float32(height) - np.float32(1.001)
    row = np.int32(width)
    source_mean, source_square, product = ZERO, ZERO, ZERO
    # Selects instead of min and max, and unsigned 32-bit indices, which need no test
    # for negative ones: LLVM then vectorises the loop with gathers (twice as fast).
    for k in range(window.dx.shape[0]):
        dx, dy = scale * window.dx[k], scale * window.dy[k]
        z = u2 + ux2 * dx + uy2 * dy
        z = z if z > SMALL else SMALL
        inverse = ONE / z
        xs = (u0 + ux0 * dx + uy0 * dy) * inverse
        ys = (u1 + ux1 * dx + uy1 * dy) * inverse
        xs = xs if xs > ZERO else ZERO
        ys = ys if ys > ZERO else ZERO
        xs = xs if xs < x_last else x_last
        ys = ys if ys < y_last else y_last
        x0, y0 = np.int32(xs), np.int32(ys)
        ax, ay = xs - np.float32(x0), ys - np.float32(y0)
        upper = start + np.uint64(np.uint32(y0 * row + x0))
        lower = start + np.uint64(np.uint32(y0 * row + x0 + row))
        top = pixels[upper]
        top += ax * (pixels[upper + np.uint64(1)] - top)
        low = pixels[lower]
        low += ax * (pixels[lower + np.uint64(1)] - low)
        value = top + ay * (low - top)
        weighted = patch.weights[k] * value
        source_mean += weighted
        source_square += weighted * value
        product += weighted * patch.values[k]
    source_variance = source_square - source_mean * source_mean
    if patch.variance < MIN_VARIANCE or source_variance < MIN_VARIANCE:
        return MAX_COST
    ncc = (product - patch.mean * source_mean) / math.sqrt(
        patch.variance * source_variance
    )
    cost = min(max(ONE - np.float32(ncc), ZERO), MAX_COST)
    # Exactly OUTSIDE would be taken for a plane out of sight.
    return cost if cost != OUTSIDE else np.float32(0.9999999)
