"""How well a plane explains the views: bilateral NCC. Compiled by numba.

All arrays are float32. Sources lie one after the other in one flat array, so that any
number of images of any size is one argument.
"""

import math

import numpy as np
from numba import njit

MAX_COST = np.float32(2.0)  # COLMAP's kMaxCost: 1 - NCC of perfectly opposite patches
MIN_VARIANCE = np.float32(1e-5)  # COLMAP: below it a patch has no texture
ZERO, ONE, SMALL = np.float32(0), np.float32(1), np.float32(1e-3)


@njit(cache=True, fastmath=True)
def reference_window(reference, x, y, offsets, sigma_color, weights, values):
    """Bilateral weights of a window (COLMAP, patch_match_cuda.cu), summing to 1.

    Returns:
        Weighted mean and variance of the reference's grey values.
    """
    height, width = reference.shape
    center = reference[y, x]
    color_factor = np.float32(-0.5) / (sigma_color * sigma_color)
    total = np.float32(0)
    mean = np.float32(0)
    square = np.float32(0)
    for k in range(offsets.shape[1]):
        xs = min(max(x + np.int64(offsets[0, k]), 0), width - 1)
        ys = min(max(y + np.int64(offsets[1, k]), 0), height - 1)
        value = reference[ys, xs]
        delta = value - center
        weight = math.exp(offsets[2, k] + delta * delta * color_factor)
        weights[k] = weight
        values[k] = value
        total += weight
        mean += weight * value
        square += weight * value * value
    for k in range(offsets.shape[1]):
        weights[k] /= total
    mean /= total
    return mean, max(square / total - mean * mean, np.float32(0))


@njit(cache=True, fastmath=True)
def plane_cost(x, y, w, gx, gy, A, b, pixels, width, height, offsets, weights, values,
                mean, variance):  # fmt: skip
    """1 - NCC of the reference's window and the source's, in 0..2."""
    u0 = A[0, 0] * x + A[0, 1] * y + A[0, 2] + b[0] * w
    u1 = A[1, 0] * x + A[1, 1] * y + A[1, 2] + b[1] * w
    u2 = A[2, 0] * x + A[2, 1] * y + A[2, 2] + b[2] * w
    if u2 < np.float32(1e-3):
        return MAX_COST
    xc, yc = u0 / u2, u1 / u2
    if xc < 0 or yc < 0 or xc > width - 1 or yc > height - 1:
        return MAX_COST
    ux0, ux1, ux2 = A[0, 0] + b[0] * gx, A[1, 0] + b[1] * gx, A[2, 0] + b[2] * gx
    uy0, uy1, uy2 = A[0, 1] + b[0] * gy, A[1, 1] + b[1] * gy, A[2, 1] + b[2] * gy
    x_last = np.float32(width) - np.float32(1.001)
    y_last = np.float32(height) - np.float32(1.001)
    row = np.int32(width)
    source_mean = np.float32(0)
    source_square = np.float32(0)
    product = np.float32(0)
    # Selects instead of min and max, and unsigned 32-bit indices, which need no test
    # for negative ones: LLVM then vectorises the loop with gathers (twice as fast).
    for k in range(offsets.shape[1]):
        dx, dy = offsets[0, k], offsets[1, k]
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
        upper = np.uint64(np.uint32(y0 * row + x0))
        lower = np.uint64(np.uint32(y0 * row + x0 + row))
        top = pixels[upper]
        top += ax * (pixels[upper + np.uint64(1)] - top)
        low = pixels[lower]
        low += ax * (pixels[lower + np.uint64(1)] - low)
        value = top + ay * (low - top)
        weighted = weights[k] * value
        source_mean += weighted
        source_square += weighted * value
        product += weighted * values[k]
    source_variance = source_square - source_mean * source_mean
    if variance < MIN_VARIANCE or source_variance < MIN_VARIANCE:
        return MAX_COST
    ncc = (product - mean * source_mean) / math.sqrt(variance * source_variance)
    return min(max(np.float32(1.0) - np.float32(ncc), np.float32(0)), MAX_COST)


@njit(cache=True, fastmath=True)
def weigh_views(costs, num_states, sweep, weights):
    """Weights of the sources (ACMM, section 3.2: multi-hypothesis view selection).

    A source counts when at least two hypotheses match well in it and few badly; the
    bar for "well" drops with the sweeps. Where none counts, the best half does.
    """
    num_sources = costs.shape[1]
    bar = np.float32(0.8) * math.exp(-np.float32(sweep * sweep) / np.float32(90.0))
    total = np.float32(0)
    for s in range(num_sources):
        good, bad, weight = 0, 0, np.float32(0)
        for i in range(num_states):
            cost = costs[i, s]
            if cost < bar:
                good += 1
                weight += math.exp(-cost * cost / np.float32(0.18))
            elif cost > np.float32(1.2):
                bad += 1
        weights[s] = weight / good if good >= 2 and bad < 4 else np.float32(0)
        total += weights[s]
    if total > 0:
        for s in range(num_sources):
            weights[s] /= total
        return
    for s in range(num_sources):
        best = np.float32(3.0)
        for i in range(num_states):
            best = min(best, costs[i, s])
        weights[s] = math.exp(-best * best / np.float32(0.18)) + np.float32(1e-6)
        total += weights[s]
    for s in range(num_sources):
        weights[s] /= total
