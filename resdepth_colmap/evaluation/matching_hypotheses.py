"""What the photographs say of two depths of a pixel: the least cost near each of them.

A depth map tells no normal, or one of another program, and a cost changes within half
a per cent of the depth. So each depth is given its best chance, all by the same means:
planes through it with several normals, then small random changes that better it.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from numba import njit

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.matching import patch_match
from resdepth_colmap.matching.cost import plane_cost, reference_window
from resdepth_colmap.matching.patch_match import MatchView
from resdepth_colmap.matching.planes import plane_gradient
from resdepth_colmap.scene import Matrix

NUM_TRIALS = 24
LARGEST_TURN = 0.5
"""Change of each coordinate of a unit normal, at most."""

LARGEST_SHIFT = 0.005
"""Change of the inverse depth relative to the hypothesis, at most."""

LEAST_CHANGE = 0.02
"""Of the largest one: changes are log-uniform, so that they search finely, too."""

FACING = -0.1
"""z of a normal is at most that: planes seen from the side match nothing."""

Numbers = npt.NDArray[np.float64]
Places = npt.NDArray[np.int64]


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Hypotheses:
    """A depth of each pixel that counts, and normals that its plane may have.

    Attributes:
        depth: Shape (N,), > 0, in units.
        normals: Unit normals in the camera frame, towards it, one array (N, 3) for each
            way to tell them.
    """

    depth: Numbers
    normals: Sequence[Matrix]


class PhotoCost:
    """The matching cost of planes at some pixels of a view, in each of its sources."""

    def __init__(
        self,
        reference: MatchView,
        sources: Sequence[MatchView],
        config: StereoConfig,
        *,
        widens: bool = True,
    ) -> None:
        """Prepare images.

        Args:
            reference: The view.
            sources: At least one other view.
            config: Its window and `sigma_color`.
            widens: Whether windows without texture are doubled, as our matcher does.
        """
        levels = patch_match._blurred(reference.gray)
        self.levels = levels if widens else levels[:1]
        self.K = reference.K
        self.sources = patch_match._flat_sources(reference, sources, None)
        self.window = patch_match._window(config)

    def of_planes(
        self, pixels: Places, inverse_depth: Numbers, normals: Matrix
    ) -> Numbers:
        """1 - NCC in each source, in 0..2; 1 where it does not see the plane.

        Args:
            pixels: Column and row of each, shape (N, 2).
            inverse_depth: Shape (N,), > 0.
            normals: Shape (N, 3).

        Returns:
            Shape (N, S).
        """
        x, y = pixels.T.astype(np.float64)
        nx, ny, nz = normals.T
        # The function behind the kernel takes arrays, too.
        gx, gy = plane_gradient.py_func(inverse_depth, nx, ny, nz, x, y, self.K)
        planes = np.column_stack([inverse_depth, gx, gy]).astype(np.float32)
        costs = np.zeros((len(pixels), len(self.sources.starts)), np.float32)
        _costs_at(self.levels, pixels, planes, self.sources, self.window, costs)
        return costs.astype(np.float64)

    def least(
        self, pixels: Places, hypotheses: Hypotheses, rng: np.random.Generator
    ) -> Numbers:
        """The least cost of a plane near each hypothesis, (N,): see `best_half`."""
        inverse = 1.0 / hypotheses.depth
        best = np.full(len(pixels), np.inf)
        kept_w, kept_normals = inverse.copy(), np.zeros((len(pixels), 3))

        def try_planes(w: Numbers, normals: Matrix) -> None:
            cost = best_half(self.of_planes(pixels, w, normals))
            better = cost < best
            best[better] = cost[better]
            kept_w[better], kept_normals[better] = w[better], normals[better]

        for normals in hypotheses.normals:
            try_planes(inverse, _facing(normals))
        for _ in range(NUM_TRIALS):
            size = LEAST_CHANGE ** rng.random((len(pixels), 1))
            turn = size * rng.uniform(-LARGEST_TURN, LARGEST_TURN, (len(pixels), 3))
            shift = size[:, 0] * rng.uniform(-LARGEST_SHIFT, LARGEST_SHIFT, len(pixels))
            # Never farther from the hypothesis, however often it is bettered.
            w = np.clip(
                kept_w + shift * inverse,
                inverse * (1 - LARGEST_SHIFT),
                inverse * (1 + LARGEST_SHIFT),
            )
            try_planes(w, _facing(kept_normals + turn))
        return best


def best_half(costs: Numbers) -> Numbers:
    """Mean cost of the better half of the sources, (N,): what is hidden is left out.

    Args:
        costs: Shape (N, S).
    """
    half = (costs.shape[1] + 1) // 2
    return np.asarray(np.sort(costs, axis=1)[:, :half].mean(axis=1))


def _facing(normals: Matrix) -> Matrix:
    """Unit normals that look at the camera."""
    turned = normals / np.linalg.norm(normals, axis=1, keepdims=True).clip(1e-9)
    turned[:, 2] = np.minimum(turned[:, 2], FACING)
    return np.asarray(turned / np.linalg.norm(turned, axis=1, keepdims=True))


@njit(cache=True, fastmath=True)
def _costs_at(levels, pixels, planes, sources, window, costs):
    weights = np.empty(window.dx.shape[0], np.float32)
    values = np.empty(window.dx.shape[0], np.float32)
    for i in range(pixels.shape[0]):
        x, y = pixels[i, 0], pixels[i, 1]
        level, mean, variance = reference_window(levels, x, y, window, weights, values)
        for s in range(costs.shape[1]):
            costs[i, s] = plane_cost(
                np.float32(x), np.float32(y), planes[i, 0], planes[i, 1], planes[i, 2],
                sources, s, level, window, weights, values, mean, variance,
            )  # fmt: skip
