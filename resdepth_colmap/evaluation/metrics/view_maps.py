"""The depth maps of all methods of one view, at one size."""

import dataclasses
from collections.abc import Mapping

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
