"""The depth maps of all arms of a view, at one size, read when they are asked for."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from resdepth_colmap.evaluation.compare.methods import Method
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.geometry.resize import nearest_resized
from resdepth_colmap.io.colmap.depth_map import read_depth_map
from resdepth_colmap.pipeline.fuse.views import MapFiles
from resdepth_colmap.pipeline.view_images import ArrayCache
from resdepth_colmap.scene import DepthMap, Matrix, View

MAX_NUM_BYTES = 512 << 20
"""Of maps that are kept, because several views are compared with them."""


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class ViewMaps:
    """The depth of one view in every arm.

    Attributes:
        view: The view.
        K: K for index coordinates at the size of the maps, shape (3, 3).
        depths: By the name of the arm, each of shape (H, W), in units; 0 = no depth.
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
        """Where every arm has a depth, shape (H, W)."""
        covered = [depth > 0 for depth in self.depths.values()]
        return np.asarray(np.logical_and.reduce(covered))


class MethodMaps(Sequence[ViewMaps]):
    """The compared views; the latest of their maps stay in memory."""

    def __init__(self, methods: Sequence[Method], min_confidence: float = 0.0) -> None:
        """Read nothing yet; depth of less than that confidence counts as none."""
        self._methods = methods
        self._min_confidence = min_confidence
        self._cache = ArrayCache(MAX_NUM_BYTES)

    def __len__(self) -> int:
        """The number of views."""
        return len(self._methods[0].files)

    def __getitem__(self, index: int) -> ViewMaps:  # type: ignore[override] # no slices
        """The maps of a view, a smaller one at the size of the largest.

        Raises:
            WorkspaceError: If a map cannot be read.
        """
        files = {method.name: method.files[index] for method in self._methods}
        depths = {name: self._depth(name, file) for name, file in files.items()}
        height_px, width_px = max(depth.shape for depth in depths.values())
        size = (width_px, height_px)
        view = self._methods[0].files[index].view
        return ViewMaps(
            view=view,
            K=index_K(view.camera.resized(width_px, height_px)),
            depths={
                name: nearest_resized(depth, size) for name, depth in depths.items()
            },
        )

    def _depth(self, method: str, file: MapFiles) -> DepthMap:
        return self._cache.get(
            (method, file.view.name),
            lambda: confident_depth(file, self._min_confidence),
        )


def confident_depth(file: MapFiles, min_confidence: float) -> DepthMap:
    """The depth map of a view without what it is not confident of.

    Args:
        file: The maps; without a confidence map, all depth is kept.
        min_confidence: Depth of less is none.

    Raises:
        WorkspaceError: If a map cannot be read.
    """
    depth = read_depth_map(file.depth_path)
    path = file.confidence_path
    if min_confidence > 0 and path is not None and path.is_file():
        depth = np.where(read_depth_map(path) >= min_confidence, depth, np.float32(0))
    return depth
