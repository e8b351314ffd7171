"""The depth maps of all methods of the compared views, read on demand."""

from collections.abc import Sequence

import numpy as np

from resdepth_colmap.evaluation.compare.methods import Method
from resdepth_colmap.evaluation.metrics.view_maps import ViewMaps
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.geometry.resize import nearest_resized
from resdepth_colmap.io.colmap.depth_map import read_depth_map
from resdepth_colmap.pipeline.fuse.views import MapFiles
from resdepth_colmap.pipeline.recent_cache import RecentCache
from resdepth_colmap.scene import DepthMap

MAX_NUM_BYTES = 512 << 20
"""Size of the cache of maps; each is compared with those of several views."""


class MethodMaps(Sequence[ViewMaps]):
    """The maps of the compared views; the latest stay in memory."""

    def __init__(self, methods: Sequence[Method], min_confidence: float = 0.0) -> None:
        """Read nothing yet; depth below that confidence counts as none."""
        self._methods = methods
        self._min_confidence = min_confidence
        self._cache = RecentCache(MAX_NUM_BYTES)

    def __len__(self) -> int:
        """The number of views."""
        return len(self._methods[0].files)

    def __getitem__(self, index: int) -> ViewMaps:  # type: ignore[override] # no slices
        """The maps of a view, resized to the largest of them.

        Raises:
            WorkspaceError: If a map cannot be read.
        """
        files = {method.name: method.files[index] for method in self._methods}
        depths = {name: self._depth(name, file) for name, file in files.items()}
        height_px, width_px = max(depth.shape for depth in depths.values())
        size_px = (width_px, height_px)
        view = self._methods[0].files[index].view
        return ViewMaps(
            view=view,
            K=index_K(view.camera.resized(width_px, height_px)),
            depths={name: nearest_resized(it, size_px) for name, it in depths.items()},
        )

    def _depth(self, method: str, file: MapFiles) -> DepthMap:
        return self._cache.get(
            (method, file.view.name),
            lambda: confident_depth(file, self._min_confidence),
        )


def confident_depth(file: MapFiles, min_confidence: float) -> DepthMap:
    """The depth map of a view without depth of low confidence.

    Args:
        file: The maps; without a confidence map, all depth is kept.
        min_confidence: Depth of a lower confidence becomes 0.

    Raises:
        WorkspaceError: If a map cannot be read.
    """
    depth = file.read_depth()
    path = file.confidence_path
    if min_confidence > 0 and path is not None and path.is_file():
        depth = np.where(read_depth_map(path) >= min_confidence, depth, np.float32(0))
    return depth
