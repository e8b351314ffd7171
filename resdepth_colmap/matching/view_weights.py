"""Which sources count at a pixel. Compiled by numba."""

import math

import numpy as np
from numba import njit

from resdepth_colmap.matching.cost import OUTSIDE

BAD = np.float32(1.2)
SPREAD = np.float32(0.18)  # twice the square of 0.3, the spread of a good cost


@njit(cache=True, fastmath=True)
def weigh_views(costs, num_states, sweep, weights):
    """Weights of the sources (ACMM, section 3.2: multi-hypothesis view selection).

    A source counts when at least two hypotheses match well in it and few badly; the
    bar for "well" drops with the sweeps. Where none counts, each counts by its best.

    Args:
        costs: Shape (num_states or more, S).
        num_states: Hypotheses of this pixel.
        sweep: Number of the sweep, from 1.
        weights: Shape (S,), written; they sum to 1.
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
                weight += math.exp(-cost * cost / SPREAD)
            elif cost > BAD or cost == OUTSIDE:
                bad += 1
        weights[s] = weight / good if good >= 2 and bad < 4 else np.float32(0)
        total += weights[s]
    if total == 0:
        for s in range(num_sources):
            best = np.float32(3.0)
            for i in range(num_states):
                best = min(best, costs[i, s])
            weights[s] = math.exp(-best * best / SPREAD) + np.float32(1e-6)
            total += weights[s]
    for s in range(num_sources):
        weights[s] /= total
