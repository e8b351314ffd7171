"""The sweeps of the PatchMatch over the checkerboard. Compiled by numba.

The pixels of one colour are updated from those of the other, as in Gipuma and ACMM
(Xu & Tao, CVPR 2019; ACMM.cu, BlackPixelUpdate and RedPixelUpdate): propagation, view
selection, refinement.
"""

from typing import NamedTuple

import numpy as np
from numba import njit, prange

from resdepth_colmap.matching.compilation import choose_threading_layer
from resdepth_colmap.matching.cost import MAX_COST, plane_cost, reference_patch
from resdepth_colmap.matching.plane import load_plane, store_plane
from resdepth_colmap.matching.propagation import (
    NUM_PROPAGATED,
    earlier_twin,
    propagate_planes,
)
from resdepth_colmap.matching.random_planes import (
    NUM_PERTURBED,
    perturb_plane,
    seeded_state,
)
from resdepth_colmap.matching.smoothness import (
    NUM_NEIGHBORS,
    Neighbors,
    gather_neighbors,
    roughness,
)
from resdepth_colmap.matching.view_selection import select_views
from resdepth_colmap.matching.views import (
    ONE,
    FloatArray,
    finest_inverse_depth_per_px,
    inverse_depth_per_px,
)
from resdepth_colmap.matching.visibility import bounded_cost, geometric_cost

choose_threading_layer()

LEAST_WEIGHT = np.float32(0.01)  # of a source in which perturbed planes are matched
NO_COST = np.float32(1e9)  # above all costs


class Iteration(NamedTuple):
    """What the sweeps of one iteration have in common.

    Attributes:
        t: Its index, from 1; the geometric pass goes on counting.
        w_range: Least and greatest inverse depth, shape (2,).
        smoothness: Weight of the roughness; 0 = none.
        geometric: Whether the sources' depth maps count.
        seed: Seed of the random planes.
    """

    t: int
    w_range: FloatArray
    smoothness: np.float32
    geometric: bool
    seed: int


@njit(cache=True, parallel=True, fastmath=True)
def sweep(reference, sources, window, iteration, planes, costs, color, rows):
    """Update the pixels of one colour of the checkerboard in place.

    Each pixel takes the best of its own plane, those of eight neighbouring regions,
    and random and perturbed ones, by the cost weighted over the sources plus the
    roughness.

    Args:
        reference: The reference view.
        sources: The source views.
        window: Where windows are sampled.
        iteration: What the sweeps of the iteration have in common.
        planes: Shape (H, W, 3), updated.
        costs: Shape (H, W), updated.
        color: 0 or 1.
        rows: First row and the one after the last; the order of rows is free.
    """
    width = planes.shape[1]
    num_samples, num_sources = window.dx.shape[0], sources.A.shape[0]
    for index in prange(rows[1] - rows[0]):
        # An unsigned number and a signed one would make a float.
        y = rows[0] + np.int64(index)
        weights = np.empty(num_samples, np.float32)
        values = np.empty(num_samples, np.float32)
        propagated = np.empty((NUM_PROPAGATED, 3), np.float32)
        perturbed = np.empty((NUM_PERTURBED, 3), np.float32)
        cost_matrix = np.empty((NUM_PROPAGATED, num_sources), np.float32)
        view_weights = np.empty(num_sources, np.float32)
        neighbors = Neighbors(
            np.zeros(NUM_NEIGHBORS, np.float32), np.zeros(NUM_NEIGHBORS, np.float32)
        )
        for x in range((y + color) % 2, width, 2):
            patch = reference_patch(reference.levels, x, y, window, weights, values)
            if iteration.smoothness > 0:
                gather_neighbors(reference.levels[0], planes, x, y, neighbors)
            count = propagate_planes(
                x, y, planes, costs, iteration.w_range, reference.K, propagated
            )
            _fill_cost_matrix(
                propagated, count, patch, window, sources, iteration, neighbors,
                cost_matrix,
            )  # fmt: skip
            select_views(cost_matrix, count, iteration.t, view_weights)
            # Disparity is that in the source that counts most.
            main = np.argmax(view_weights)
            w = propagated[0, 0]
            w_per_px = inverse_depth_per_px(patch.x, patch.y, w, sources, main)
            best, cost = _best_propagated(
                propagated, count, cost_matrix, view_weights, iteration, neighbors,
                ONE / w_per_px,
            )  # fmt: skip
            plane = load_plane(propagated[best])
            w_per_px = inverse_depth_per_px(patch.x, patch.y, plane.w, sources, main)
            state = seeded_state(iteration.seed, y * width + x, iteration.t)
            perturb_plane(
                plane, patch.x, patch.y, reference.K, iteration.w_range, w_per_px,
                state, perturbed,
            )  # fmt: skip
            costs[y, x] = _store_best(
                plane, cost, perturbed, view_weights, patch, window, sources,
                iteration, neighbors, ONE / w_per_px, planes[y, x],
            )  # fmt: skip


# The steps of a sweep are inlined: handing so many arrays to a call takes a tenth of
# the time (a trial), and a step that is compiled by itself may round differently.


@njit(cache=True, fastmath=True, inline="always")
def _fill_cost_matrix(propagated, count, patch, window, sources, iteration, neighbors,
                      cost_matrix):  # fmt: skip
    """Match each propagated plane with each source: the cost matrix of ACMM.

    Args:
        propagated: Planes of the pixel, its own first, shape (count or more, 3).
        count: How many there are.
        patch: What the reference shows at the pixel.
        window: Where the window is sampled.
        sources: The source views.
        iteration: What the sweeps of the iteration have in common.
        neighbors: Of the pixel.
        cost_matrix: Shape (count or more, S), written.
    """
    num_sources = sources.A.shape[0]
    w = propagated[0, 0]
    px_per_w = ONE / finest_inverse_depth_per_px(patch.x, patch.y, w, sources)
    best_cost = NO_COST
    for i in range(count):
        plane = load_plane(propagated[i])
        # A single source has all the weight: what is rough needs no match.
        if num_sources == 1 and best_cost <= iteration.smoothness * roughness(
            plane, px_per_w, neighbors
        ):
            cost_matrix[i, 0] = MAX_COST
            continue
        twin = earlier_twin(propagated, i, px_per_w)
        for s in range(num_sources):
            if twin >= 0:
                cost_matrix[i, s] = cost_matrix[twin, s]
            else:
                cost_matrix[i, s] = _view_cost(
                    plane, patch, window, sources, s, iteration.geometric
                )
        if num_sources == 1:
            cost = bounded_cost(cost_matrix[i, 0], iteration.geometric)
            cost += iteration.smoothness * roughness(plane, px_per_w, neighbors)
            best_cost = min(best_cost, cost)


@njit(cache=True, fastmath=True, inline="always")
def _best_propagated(propagated, count, cost_matrix, view_weights, iteration, neighbors,
                     px_per_w):  # fmt: skip
    """The propagated plane of the least cost; the pixel's own wins ties.

    Args:
        propagated: Planes of the pixel, its own first, shape (count or more, 3).
        count: How many there are.
        cost_matrix: Cost of each in each source, shape (count or more, S).
        view_weights: Weights of the sources, shape (S,).
        iteration: What the sweeps of the iteration have in common.
        neighbors: Of the pixel.
        px_per_w: Pixels of disparity per unit of inverse depth.

    Returns:
        Its index and its cost.
    """
    best, best_cost = 0, NO_COST
    for i in range(count):
        cost = iteration.smoothness * roughness(
            load_plane(propagated[i]), px_per_w, neighbors
        )
        for s in range(view_weights.shape[0]):
            match = bounded_cost(cost_matrix[i, s], iteration.geometric)
            cost += view_weights[s] * match
        if cost < best_cost:
            best, best_cost = i, cost
    return best, best_cost


@njit(cache=True, fastmath=True, inline="always")
def _store_best(plane, cost, perturbed, view_weights, patch, window, sources, iteration,
                neighbors, px_per_w, result):  # fmt: skip
    """Store the best of a plane and its perturbed ones.

    Args:
        plane: The best plane so far.
        cost: Its cost.
        perturbed: Shape (NUM_PERTURBED, 3).
        view_weights: Weights of the sources, shape (S,).
        patch: What the reference shows at the pixel.
        window: Where the window is sampled.
        sources: The source views.
        iteration: What the sweeps of the iteration have in common.
        neighbors: Of the pixel.
        px_per_w: Pixels of disparity per unit of inverse depth.
        result: Shape (3,), the best plane, written.

    Returns:
        The cost of the best plane.
    """
    w_range = iteration.w_range
    for i in range(NUM_PERTURBED):
        other = load_plane(perturbed[i])
        if not w_range[0] <= other.w <= w_range[1]:
            continue
        other_cost = iteration.smoothness * roughness(other, px_per_w, neighbors)
        for s in range(view_weights.shape[0]):
            # What is dear already is not matched with more sources.
            if view_weights[s] > LEAST_WEIGHT and other_cost < cost:
                match = _view_cost(
                    other, patch, window, sources, s, iteration.geometric
                )
                other_cost += view_weights[s] * bounded_cost(match, iteration.geometric)
        if other_cost < cost:
            plane, cost = other, other_cost
    store_plane(result, plane)
    return cost


@njit(cache=True, fastmath=True)
def _view_cost(plane, patch, window, sources, s, geometric):
    """The cost of a plane in a source, `OUTSIDE` where that does not see it."""
    cost = plane_cost(plane, patch, window, sources, s)
    if geometric:
        return geometric_cost(cost, patch.x, patch.y, plane.w, sources, s)
    return cost
