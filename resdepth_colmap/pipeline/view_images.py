"""Grey images at the size of the maps, the last few of them kept."""

import collections

import cv2
import numpy as np

from resdepth_colmap.io.images import read_gray
from resdepth_colmap.io.workspace import Workspace
from resdepth_colmap.scene import Camera, GrayImage, View

Size = tuple[int, int]


class ViewImages:
    """Loads images resized to what is asked for; memory holds `capacity` of them.

    Attributes:
        workspace: Where the images lie.
        capacity: Number of images to keep.
    """

    def __init__(self, workspace: Workspace, capacity: int) -> None:
        """Keep nothing yet."""
        self.workspace = workspace
        self.capacity = capacity
        self._kept: collections.OrderedDict[tuple[str, Size], GrayImage] = (
            collections.OrderedDict()
        )

    def gray(self, view: View, camera: Camera) -> GrayImage:
        """Grey values of a view in 0..1, at the size of `camera`, float32.

        Raises:
            WorkspaceError: If the image is missing or cannot be read.
        """
        key = (view.name, (camera.width_px, camera.height_px))
        if key not in self._kept:
            while len(self._kept) >= self.capacity:
                self._kept.popitem(last=False)
            self._kept[key] = self._load(view, key[1])
        self._kept.move_to_end(key)
        return self._kept[key]

    def _load(self, view: View, size: Size) -> GrayImage:
        gray = read_gray(self.workspace.image_path(view.name))
        if gray.shape == size[::-1]:
            return gray
        # The area's mean, so that a smaller image shows no false patterns.
        return resized_gray(gray, size)


def resized_gray(gray: GrayImage, size: Size) -> GrayImage:
    """An image at another (width, height), each pixel the mean of what it covers."""
    result = cv2.resize(gray, size, interpolation=cv2.INTER_AREA)
    return np.asarray(result, dtype=np.float32)


def camera_at_scale(camera: Camera, scale: float) -> Camera:
    """The camera of the image at about that scale, in whole pixels."""
    width_px = max(1, round(camera.width_px * scale))
    height_px = max(1, round(camera.height_px * scale))
    return camera.resized(width_px, height_px)
