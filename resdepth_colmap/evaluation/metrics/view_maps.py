"""The maps and measures of one view: depth by each method, sums over square tiles."""

import dataclasses
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from resdepth_colmap.scene import DepthMap, Matrix, View


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class ViewMaps:
    """The depth of one view by each method.

    Attributes:
        view: The view.
        K: K for index coordinates at the size of the maps, shape (3, 3).
        depths: By method, each of shape (H, W), in units; 0 = no depth.
    """

    view: View
    K: Matrix
    depths: Mapping[str, DepthMap]

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the maps, in pixels."""
        height_px, width_px = next(iter(self.depths.values())).shape
        return height_px, width_px

    @property
    def common(self) -> npt.NDArray[np.bool_]:
        """Where every method has a depth, shape (H, W)."""
        covered = [depth > 0 for depth in self.depths.values()]
        return np.asarray(np.logical_and.reduce(covered))


TILE_PX = 64


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class TileSums:
    """Sums over the tiles of a view, and the means of these.

    Attributes:
        sums: Sum of the values of each tile, shape (T,).
        counts: Number of values of each tile, shape (T,).
    """

    sums: Matrix
    counts: Matrix

    @classmethod
    def of(cls, sums: npt.ArrayLike, counts: npt.ArrayLike) -> Self:
        """Sum maps over tiles of 64 x 64 pixels; those at the far borders are smaller.

        Args:
            sums: Sum of the values at each pixel, shape (H, W).
            counts: Number of values at each pixel, shape (H, W); where it is 0, the
                sum is ignored.
        """
        num_values = np.asarray(counts, np.float64)
        values = np.where(num_values > 0, np.asarray(sums, np.float64), 0.0)
        return cls(sums=_tiled(values), counts=_tiled(num_values))

    @property
    def mean(self) -> float:
        """Mean of all values; NaN without any."""
        total = self.counts.sum()
        return float(self.sums.sum() / total) if total else float("nan")

    @property
    def means(self) -> Matrix:
        """Mean of each tile, shape (T,); NaN in a tile without values."""
        known = self.counts > 0
        return np.where(known, self.sums / np.where(known, self.counts, 1), np.nan)


def with_common(name: str, totals: npt.NDArray[Any]) -> dict[str, TileSums]:
    """A measure over the pixels of a method, and over those of all methods.

    Args:
        name: Of the measure.
        totals: Sums and counts at each pixel, then both where every method covers it,
            shape (4, H, W).
    """
    return {
        name: TileSums.of(totals[0], totals[1]),
        f"{name}_common": TileSums.of(totals[2], totals[3]),
    }


def _tiled(values: Matrix) -> Matrix:
    height_px, width_px = values.shape
    rows = np.add.reduceat(values, np.arange(0, height_px, TILE_PX), axis=0)
    return np.add.reduceat(rows, np.arange(0, width_px, TILE_PX), axis=1).ravel()


MEASURES = {
    "coverage": "share of pixels with a depth",
    "points_even": "sparse points with even ids within 1 % of the map; a hole is not",
    "points_odd": "sparse points with odd ids, the other half",
    "points_even_common": "even ids, where every method has a depth",
    "points_odd_common": "odd ids, where every method has a depth",
    "agreement": "pixels within 1 % of the map of a neighbour that has a depth there",
    "agreement_common": "the same where every method has a depth in both views",
    "consistent": "pixels that the map of at least one neighbour agrees with",
    "photo": "correlation (NCC, 7 x 7) of the image with the warped neighbours",
    "photo_common": "the same where every method has a depth",
    "right_1": "pixels within 1 % of the true depth, where known; a hole is not",
    "right_2": "pixels within 2 % of the true depth, where known; a hole is not",
    "right_1_common": "within 1 % of the true depth, where every method has a depth",
    "right_2_common": "within 2 % of the true depth, where every method has a depth",
}
"""Each is one number per view, and more is better. "common": over the same pixels for
all methods."""
