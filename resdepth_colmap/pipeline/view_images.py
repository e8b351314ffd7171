"""Images and depth maps at the size that is matched at, the last few of them kept."""

from pathlib import Path

import numpy as np

from resdepth_colmap.geometry.resize import area_resized, nearest_resized
from resdepth_colmap.io.colmap.depth_map import read_depth_map
from resdepth_colmap.io.colmap.workspace import Workspace, original_map_path
from resdepth_colmap.io.images import read_gray, read_unit_colors
from resdepth_colmap.pipeline.masks import wanted_pixels
from resdepth_colmap.pipeline.recent_cache import RecentCache
from resdepth_colmap.scene import (
    Camera,
    DepthMap,
    GrayImage,
    UnitColors,
    View,
    Wanted,
)

Size = tuple[int, int]


class ViewImages:
    """Loads images and depth maps resized to what is asked for, through a cache.

    Attributes:
        workspace: Where they lie.
        cache: What was loaded last.
    """

    def __init__(self, workspace: Workspace, max_num_bytes: int) -> None:
        """Keep nothing yet, and up to that many bytes later."""
        self.workspace = workspace
        self.cache = RecentCache(max_num_bytes)

    def gray(self, view: View, camera: Camera) -> GrayImage:
        """Grey values of a view in 0..1, at the size of `camera`, float32.

        Raises:
            WorkspaceError: If the image is missing or cannot be read.
        """
        size = (camera.width_px, camera.height_px)
        return self.cache.get((view.name, size), lambda: self._load_gray(view, size))

    def colors(self, view: View, camera: Camera) -> UnitColors:
        """RGB values of a view in 0..1, at the size of `camera`, float32.

        Not kept: a view is looked at in colour once, as the reference.

        Raises:
            WorkspaceError: If the image is missing or cannot be read.
        """
        colors = read_unit_colors(self.workspace.image_path(view.name))
        return area_resized(colors, (camera.width_px, camera.height_px))

    def depth(self, view: View, camera: Camera, kind: str) -> DepthMap:
        """A depth map of a view, at the size of `camera`, float32; 0 = no depth.

        A map of another size is sampled at the nearest pixels; where there is no file,
        no pixel has a depth.

        Raises:
            WorkspaceError: If the map cannot be read.
        """
        size = (camera.width_px, camera.height_px)
        key = (view.name, size, kind)
        return self.cache.get(key, lambda: self._load_depth(view, size, kind))

    def wanted(self, view: View, camera: Camera) -> Wanted | None:
        """The mask of a view at the size of `camera`; None = all pixels are wanted.

        Raises:
            WorkspaceError: If the mask cannot be read, or is of another shape.
        """
        masks = self.workspace.masks
        if not masks.files(view.name):
            return None
        size = (camera.width_px, camera.height_px)

        def load() -> Wanted:
            wanted = wanted_pixels(masks, view.name, size)
            return np.ones(size[::-1], np.bool_) if wanted is None else wanted

        return self.cache.get((view.name, size, "mask"), load)

    def whole_map(self, path: Path) -> DepthMap:
        """The depth map of a file, as it was before any run in place; 0 = no depth.

        Raises:
            WorkspaceError: If the map cannot be read.
        """
        original = original_map_path(path) or path  # replaced since it was planned?
        return self.cache.get(original, lambda: read_depth_map(original))

    def _load_gray(self, view: View, size: Size) -> GrayImage:
        gray = read_gray(self.workspace.image_path(view.name))
        return area_resized(gray, size)

    def _load_depth(self, view: View, size: Size, kind: str) -> DepthMap:
        path = self.workspace.depth_map_path(view.name, kind)
        if not path.is_file():
            return np.zeros(size[::-1], np.float32)
        return nearest_resized(read_depth_map(path), size)


def camera_at_scale(camera: Camera, scale: float) -> Camera:
    """The camera of the image at about that scale, in whole pixels."""
    width_px = max(1, round(camera.width_px * scale))
    height_px = max(1, round(camera.height_px * scale))
    return camera.resized(width_px, height_px)


def camera_of_size(view: View, max_image_size: int) -> Camera:
    """The camera of an image that is no larger than that; -1 = as it is."""
    longest_px = max(view.camera.width_px, view.camera.height_px)
    is_smaller = 0 < max_image_size < longest_px
    return camera_at_scale(
        view.camera, max_image_size / longest_px if is_smaller else 1.0
    )
