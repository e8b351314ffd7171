"""Which sources count at a pixel. Compiled by numba.

Multi-hypothesis joint view selection (Xu & Tao, ACMM, CVPR 2019; ACMM.cu,
CheckerboardPropagation), with its constants, but weights instead of sampled views and
no prior from the neighbours' choice.
"""

import math

import numpy as np
from numba import njit

from resdepth_colmap.matching.cost import OUTSIDE

GOOD = np.float32(0.8)  # below it a cost is good, in the first iteration
DECAY = np.float32(90.0)  # of that threshold, in squared iterations
BAD = np.float32(1.2)
SPREAD = np.float32(0.18)  # twice the square of 0.3, the spread of a good cost


@njit(cache=True, fastmath=True)
def select_views(costs, num_planes, iteration, weights):
    """Weight the sources by the costs of all hypotheses of a pixel.

    A source counts when at least two hypotheses match well in it and few badly; the
    threshold for "well" drops with the iterations, 0.8 exp(-t^2 / 90). Where no source
    counts, each counts by its best hypothesis.

    Args:
        costs: Shape (num_planes or more, S).
        num_planes: Hypotheses of this pixel.
        iteration: Of the sweeps, from 1.
        weights: Shape (S,), written; they sum to 1.
    """
    num_sources = costs.shape[1]
    threshold = GOOD * math.exp(-np.float32(iteration * iteration) / DECAY)
    total = np.float32(0)
    for s in range(num_sources):
        num_good, num_bad, weight = 0, 0, np.float32(0)
        for i in range(num_planes):
            cost = costs[i, s]
            if cost < threshold:
                num_good += 1
                weight += math.exp(-cost * cost / SPREAD)
            elif cost > BAD or cost == OUTSIDE:
                num_bad += 1
        counts = num_good >= 2 and num_bad < 4
        weights[s] = weight / num_good if counts else np.float32(0)
        total += weights[s]
    if total == 0:
        for s in range(num_sources):
            best = np.float32(3.0)
            for i in range(num_planes):
                best = min(best, costs[i, s])
            weights[s] = math.exp(-best * best / SPREAD) + np.float32(1e-6)
            total += weights[s]
    for s in range(num_sources):
        weights[s] /= total
