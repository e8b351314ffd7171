"""Views whose images are distorted: any of COLMAP's camera models."""

import copy
import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.reconstruction import open_reconstruction
from resdepth_colmap.scene import Matrix


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class DistortedView:
    """One image as the camera took it.

    Attributes:
        name: Image name as in the model.
        camera: Its pycolmap.Camera.
        cam_from_world: Pose, shape (3, 4), float64.
    """

    name: str
    camera: Any
    cam_from_world: Matrix

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        return int(self.camera.width), int(self.camera.height)

    def rays(self, xy: Matrix) -> Matrix:
        """Rays through places of the image, in the camera frame, with z = 1.

        Args:
            xy: COLMAP's coordinates, in pixels, shape (N, 2), float64.

        Returns:
            Shape (N, 3), float64; NaN where the distortion cannot be undone.
        """
        on_plane = self.camera.cam_from_img(xy)
        return np.column_stack([on_plane, np.ones(len(on_plane))])


def read_distorted_views(path: Path) -> dict[str, DistortedView]:
    """Read the views of a model by the last part of their names.

    Args:
        path: Folder of the model.

    Raises:
        WorkspaceError: If the model is missing, broken, or two images share a name.
    """
    model = open_reconstruction(path)
    views = {}
    for image_id in sorted(model.reg_image_ids()):
        image = model.images[image_id]
        key = image.name.rpartition("/")[2]
        if key in views:
            raise WorkspaceError(f"{path}: the model names {key} more than once.")
        views[key] = DistortedView(
            name=image.name,
            # A copy: the model owns the one it hands out, and is about to go.
            camera=copy.deepcopy(image.camera),
            cam_from_world=np.array(image.cam_from_world().matrix(), np.float64),
        )
    return views
