"""The inner loops of the PatchMatch, compiled by numba.

A hypothesis is a slanted plane. Seen from the reference camera, a plane's inverse
depth is an affine function of the pixel (Bleyer et al., PatchMatch Stereo, BMVC 2011),
so a hypothesis is three numbers: the inverse depth `w` at its pixel and its gradient
`(gx, gy)` in 1/unit per pixel. A pixel then lies in the source view at the homogeneous
position ``A (x, y, 1) + b w(x, y)`` with ``A = K_s R K_r^-1`` and ``b = K_s t``.

All arrays are float32. Sources lie one after the other in one flat array, so that any
number of images of any size is one argument.
"""

import math

import numpy as np
from numba import njit, prange

MAX_COST = np.float32(2.0)  # COLMAP's kMaxCost: 1 - NCC of perfectly opposite patches
MIN_VARIANCE = np.float32(1e-5)  # COLMAP: below it a patch has no texture
ZERO, ONE, SMALL = np.float32(0), np.float32(1), np.float32(1e-3)
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


@njit(cache=True, inline="always")
def _random(state):
    """One number in [0, 1) and the next state (Marsaglia's xorshift64)."""
    state ^= state << np.uint64(13)
    state ^= state >> np.uint64(7)
    state ^= state << np.uint64(17)
    return np.float32((state >> np.uint64(40)) * (1.0 / 16777216.0)), state


@njit(cache=True, inline="always")
def _seeded(seed, pixel, sweep):
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


@njit(cache=True, fastmath=True, inline="always")
def _gradient(w, nx, ny, nz, x, y, K):
    """Gradient of the inverse depth of a plane with normal n, through depth 1/w."""
    along_ray = nx * (x - K[0, 2]) / K[0, 0] + ny * (y - K[1, 2]) / K[1, 1] + nz
    scale = w / along_ray
    return scale * nx / K[0, 0], scale * ny / K[1, 1]


@njit(cache=True, fastmath=True, inline="always")
def _normal(w, gx, gy, x, y, K):
    """Unit normal, towards the camera, of a plane given in inverse depth."""
    nx = -gx * K[0, 0]
    ny = -gy * K[1, 1]
    nz = -(w + gx * (K[0, 2] - x) + gy * (K[1, 2] - y))
    norm = math.sqrt(nx * nx + ny * ny + nz * nz) + np.float32(1e-30)
    return nx / norm, ny / norm, nz / norm


@njit(cache=True, fastmath=True, inline="always")
def _faces_camera(nx, ny, nz, x, y, K):
    """Whether a plane is seen at less than about 84 degrees from its normal."""
    rx = (x - K[0, 2]) / K[0, 0]
    ry = (y - K[1, 2]) / K[1, 1]
    return -(nx * rx + ny * ry + nz) > np.float32(0.1) * math.sqrt(
        rx * rx + ry * ry + np.float32(1.0)
    )


@njit(cache=True, fastmath=True)
def _random_gradient(w, x, y, K, state):
    """A plane with a random normal within about 75 degrees of the viewing ray."""
    rx = (x - K[0, 2]) / K[0, 0]
    ry = (y - K[1, 2]) / K[1, 1]
    nx, ny, nz = np.float32(0), np.float32(0), np.float32(-1)
    for _ in range(8):
        u, state = _random(state)
        v, state = _random(state)
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
    if not _faces_camera(nx, ny, nz, x, y, K):
        nx, ny, nz = np.float32(0), np.float32(0), np.float32(-1)
    gx, gy = _gradient(w, nx, ny, nz, x, y, K)
    return gx, gy, state


@njit(cache=True, fastmath=True)
def _window(reference, x, y, offsets, sigma_color, weights, values):
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
def _plane_cost(x, y, w, gx, gy, A, b, pixels, width, height, offsets, weights, values,
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
def _view_weights(costs, num_states, sweep, weights):
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


@njit(cache=True, parallel=True, fastmath=True)
def start(reference, K, planes, costs, A, b, pixels, starts, sizes, offsets, w_range,
          sigma_color, seed):  # fmt: skip
    """Random planes, uniform in inverse depth, and their mean cost over the sources."""
    height, width = reference.shape
    for y in prange(height):
        weights = np.empty(offsets.shape[1], np.float32)
        values = np.empty(offsets.shape[1], np.float32)
        for x in range(width):
            mean, variance = _window(
                reference, x, y, offsets, sigma_color, weights, values
            )
            state = _seeded(seed, y * width + x, 0)
            u, state = _random(state)
            w = w_range[0] + u * (w_range[1] - w_range[0])
            fx, fy = np.float32(x), np.float32(y)
            gx, gy, state = _random_gradient(w, fx, fy, K, state)
            cost = np.float32(0)
            for s in range(A.shape[0]):
                cost += _plane_cost(
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
            n = _normal(w, gx, gy, np.float32(x), np.float32(y), K)
            if _faces_camera(n[0], n[1], n[2], np.float32(x), np.float32(y), K):
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
    u, state = _random(state)
    w_random = w_range[0] + u * (w_range[1] - w_range[0])
    gx_random, gy_random, state = _random_gradient(w, x, y, K, state)
    nx, ny, nz = _normal(w, gx, gy, x, y, K)
    u, state = _random(state)
    size = np.float32(0.5) * np.float32(math.exp(np.float32(-4.0) * u))
    dx, state = _random(state)
    dy, state = _random(state)
    dz, state = _random(state)
    nx += size * (np.float32(2) * dx - np.float32(1))
    ny += size * (np.float32(2) * dy - np.float32(1))
    nz += size * (np.float32(2) * dz - np.float32(1))
    gx_near, gy_near = gx, gy
    if _faces_camera(nx, ny, nz, x, y, K):
        gx_near, gy_near = _gradient(w, nx, ny, nz, x, y, K)
    steps = (np.float32(0), np.float32(0))
    for i in range(2):
        u, state = _random(state)
        sign, state = _random(state)
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


@njit(cache=True, fastmath=True, inline="always")
def _inverse_depth_per_px(x, y, w, A, b):
    """Change of inverse depth that moves the pixel by one pixel in the source."""
    u0 = A[0, 0] * x + A[0, 1] * y + A[0, 2] + b[0] * w
    u1 = A[1, 0] * x + A[1, 1] * y + A[1, 2] + b[1] * w
    u2 = max(A[2, 0] * x + A[2, 1] * y + A[2, 2] + b[2] * w, np.float32(1e-3))
    dx = (b[0] - b[2] * u0 / u2) / u2
    dy = (b[1] - b[2] * u1 / u2) / u2
    return np.float32(1.0) / (math.sqrt(dx * dx + dy * dy) + np.float32(1e-12))


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
            mean, variance = _window(
                reference, x, y, offsets, sigma_color, weights, values
            )
            fx, fy = np.float32(x), np.float32(y)
            count = _gather_states(x, y, planes, costs, w_range, K, states)
            for i in range(count):
                for s in range(num_sources):
                    matrix[i, s] = _plane_cost(
                        fx, fy, states[i, 0], states[i, 1], states[i, 2], A[s], b[s],
                        pixels[starts[s] :], sizes[s, 0], sizes[s, 1], offsets, weights,
                        values, mean, variance,
                    )  # fmt: skip
            _view_weights(matrix, count, number, view_weights)
            best, best_cost = count - 1, np.float32(1e9)
            for i in range(count - 1, -1, -1):  # its own plane first: it wins ties
                cost = np.float32(0)
                for s in range(num_sources):
                    cost += view_weights[s] * matrix[i, s]
                if cost < best_cost:
                    best, best_cost = i, cost
            plane = states[best]
            main = np.argmax(view_weights)
            w_per_px = _inverse_depth_per_px(fx, fy, plane[0], A[main], b[main])
            state = _seeded(seed, y * width + x, number)
            _make_trials(plane, fx, fy, K, w_range, w_per_px, state, trials)
            for i in range(NUM_TRIALS):
                if not w_range[0] <= trials[i, 0] <= w_range[1]:
                    continue
                cost = np.float32(0)
                for s in range(num_sources):
                    if view_weights[s] > np.float32(0.01) and cost < best_cost:
                        cost += view_weights[s] * _plane_cost(
                            fx, fy, trials[i, 0], trials[i, 1], trials[i, 2], A[s], b[s],
                            pixels[starts[s] :], sizes[s, 0], sizes[s, 1], offsets,
                            weights, values, mean, variance,
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
            n = _normal(planes[y, x, 0], planes[y, x, 1], planes[y, x, 2],
                        np.float32(x), np.float32(y), K)  # fmt: skip
            normals[y, x, 0], normals[y, x, 1], normals[y, x, 2] = n[0], n[1], n[2]
