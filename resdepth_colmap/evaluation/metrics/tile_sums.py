"""What was measured at the pixels of a view, summed over square tiles."""

import dataclasses
from typing import Self

import numpy as np
import numpy.typing as npt

from resdepth_colmap.scene import Matrix

TILE_PX = 64


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class TileSums:
    """Sums over the tiles of a view, from which means follow.

    Attributes:
        sums: Of the values, shape (T,).
        counts: How many values each tile has, shape (T,).
    """

    sums: Matrix
    counts: Matrix

    @classmethod
    def of(cls, sums: npt.ArrayLike, counts: npt.ArrayLike) -> Self:
        """Sum maps over tiles of 64 pixels; those at the far borders are smaller.

        Args:
            sums: Sum of the values at each pixel, shape (H, W).
            counts: Number of the values at each pixel, shape (H, W); where it is 0,
                the sum is not looked at.
        """
        number = np.asarray(counts, np.float64)
        values = np.where(number > 0, np.asarray(sums, np.float64), 0.0)
        return cls(sums=_tiled(values), counts=_tiled(number))

    @property
    def mean(self) -> float:
        """Mean of the values of all tiles; NaN without any."""
        total = self.counts.sum()
        return float(self.sums.sum() / total) if total else float("nan")

    @property
    def means(self) -> Matrix:
        """Mean of each tile, shape (T,); NaN where a tile has no value."""
        known = self.counts > 0
        return np.where(known, self.sums / np.where(known, self.counts, 1), np.nan)


def _tiled(values: Matrix) -> Matrix:
    height_px, width_px = values.shape
    rows = np.add.reduceat(values, np.arange(0, height_px, TILE_PX), axis=0)
    return np.add.reduceat(rows, np.arange(0, width_px, TILE_PX), axis=1).ravel()
