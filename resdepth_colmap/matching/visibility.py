"""What the depth maps of the sources say about a hypothesis. Compiled by numba."""

import math

import numpy as np
from numba import njit

from resdepth_colmap.matching.cost import OUTSIDE
from resdepth_colmap.matching.views import SMALL, ZERO, project

# A bad match says no more than that something hides the surface, or that it has no
# texture: beyond this cost no hypothesis is worse than another.
WORST_MATCH = np.float32(0.4)
# Unseen by a source: a little better than the best that chance finds elsewhere.
UNSEEN = np.float32(0.3)
CONSISTENT_PX = np.float32(1.5)
COST_PER_PX = np.float32(0.05)
CONTRADICTED = np.float32(0.3)
HIDDEN = np.float32(0.4)
WORST = np.float32(0.9)


@njit(cache=True, fastmath=True, inline="always")
def bounded_cost(cost, geometric):
    """The cost of a hypothesis in a source, as it is added up.

    Args:
        cost: 1 - NCC in 0..2 or, if `geometric`, a `geometric_cost`; or `OUTSIDE`.
        geometric: Whether the sources' depth maps count.
    """
    if cost == OUTSIDE:
        return UNSEEN
    return cost if geometric else min(cost, WORST_MATCH)


@njit(cache=True, fastmath=True, inline="always")
def geometric_cost(match_cost, x, y, w, sources, s):
    """The cost of a match, given the depth map of source s.

    As in Schoenberger et al. (ECCV 2016), "Geometric Consistency" (COLMAP,
    patch_match_cuda.cu, ComputeGeomConsistencyCost) and ACMM, the forward-backward
    reprojection error counts, here as the difference of the inverse depths times the
    pixels per unit, its first order. Beyond a few pixels it matters on which side the
    source's surface lies: a plane behind it may be hidden in that source, which costs
    little more than a bad match; a plane in front of it would be seen there (free
    space, Merrell et al., ICCV 2007).

    Args:
        match_cost: 1 - NCC, in 0..2, or `OUTSIDE`.
        x: Pixel of the reference.
        y: Likewise.
        w: Inverse depth of the hypothesis.
        sources: The source views, with `inverse_depths`.
        s: Index of the source.
    """
    if match_cost == OUTSIDE:
        return OUTSIDE
    cost = min(match_cost, WORST_MATCH)
    b = sources.b
    u2 = project(x, y, w, sources, s, 2)
    if u2 < SMALL:
        return cost
    xc = project(x, y, w, sources, s, 0) / u2
    yc = project(x, y, w, sources, s, 1) / u2
    column = np.int64(xc + np.float32(0.5))
    row = np.int64(yc + np.float32(0.5))
    seen = sources.inverse_depths[
        sources.starts[s] + row * sources.sizes[s, 0] + column
    ]
    if seen <= ZERO:
        return cost
    dx = (b[s, 0] - b[s, 2] * xc) / u2
    dy = (b[s, 1] - b[s, 2] * yc) / u2
    # The source's inverse depth, in terms of the reference, is seen * u2.
    nearer_px = (w - seen * u2) * math.sqrt(dx * dx + dy * dy)
    if abs(nearer_px) <= CONSISTENT_PX:
        return min(cost + COST_PER_PX * abs(nearer_px), WORST_MATCH)
    if nearer_px < ZERO:
        return min(cost + CONTRADICTED, HIDDEN)
    return min(cost + CONTRADICTED, WORST)
