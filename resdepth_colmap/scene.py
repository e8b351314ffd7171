"""What a scene is: cameras, views, and what the views share. No files, no torch."""

import dataclasses
from typing import Protocol

import numpy as np
import numpy.typing as npt

DepthMap = npt.NDArray[np.float32]
"""Depth along the optical axis, in workspace units, shape (H, W); 0 = no depth."""

NormalMap = npt.NDArray[np.float32]
"""Unit normals in the camera frame, towards it (nz < 0), shape (H, W, 3); 0 = none."""

GrayImage = npt.NDArray[np.float32]
"""Grey values in 0..1, shape (H, W)."""

ColorImage = npt.NDArray[np.uint8]
"""RGB values, shape (H, W, 3)."""

UnitColors = npt.NDArray[np.float32]
"""RGB values in 0..1, shape (H, W, 3)."""

Wanted = npt.NDArray[np.bool_]
"""Whether a pixel is wanted, by the mask of its image, shape (H, W)."""

FloatMap = npt.NDArray[np.float32]
"""Any other value a pixel, shape (H, W)."""

Matrix = npt.NDArray[np.float64]
"""A matrix or vector of geometry: K (3, 3), cam_from_world (3, 4), points (N, 3)."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Camera:
    """A pinhole camera, in COLMAP's convention: a pixel's centre is its index + 0.5.

    Attributes:
        width_px: Image width.
        height_px: Image height.
        fx: Focal length along x, in pixels.
        fy: Focal length along y, in pixels.
        cx: Principal point along x, in pixels.
        cy: Principal point along y, in pixels.
    """

    width_px: int
    height_px: int
    fx: float
    fy: float
    cx: float
    cy: float

    def resized(self, width_px: int, height_px: int) -> "Camera":
        """The same camera for a map or image of another size.

        COLMAP scales K by (w / W, h / H); with centres at +0.5 that is exact.
        """
        scale_x = width_px / self.width_px
        scale_y = height_px / self.height_px
        return Camera(
            width_px=width_px,
            height_px=height_px,
            fx=self.fx * scale_x,
            fy=self.fy * scale_y,
            cx=self.cx * scale_x,
            cy=self.cy * scale_y,
        )


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """One image of a scene, with its camera and pose.

    Attributes:
        image_id: COLMAP's image id.
        name: Image name as in the model, with "/" between sub-folders.
        camera: The camera of the undistorted image.
        cam_from_world: Pose, shape (3, 4), float64: xyz_in_cam = R xyz_in_world + t.
    """

    image_id: int
    name: str
    camera: Camera
    cam_from_world: Matrix

    @property
    def center_in_world(self) -> Matrix:
        """The camera's projection centre, shape (3,), in workspace units."""
        return projection_center(self.cam_from_world)


class Posed(Protocol):
    """Anything with a camera pose."""

    @property
    def cam_from_world(self) -> Matrix:
        """Pose, shape (3, 4), float64: xyz_in_cam = R xyz_in_world + t."""


def projection_center(cam_from_world: Matrix) -> Matrix:
    """The projection centre of a pose (3, 4), in the frame it maps from, shape (3,)."""
    return -cam_from_world[:, :3].T @ cam_from_world[:, 3]


def cam_from_cam(target: Posed, source: Posed) -> Matrix:
    """The relative pose target_from_source, shape (3, 4), float64."""
    rotation = target.cam_from_world[:, :3] @ source.cam_from_world[:, :3].T
    translation = target.cam_from_world[:, 3] - rotation @ source.cam_from_world[:, 3]
    return np.column_stack([rotation, translation])


def baseline(first: View, second: View) -> float:
    """Distance of two projection centres, in workspace units."""
    return float(np.linalg.norm(first.center_in_world - second.center_in_world))


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """The views of a workspace, and the statistics of its sparse points.

    Without sparse points the three statistics are None (COLMAP cannot choose
    neighbours or depth ranges then either).

    Attributes:
        views: All views, in the order of COLMAP's MVSModel (image ids ascending).
        num_points: Number of sparse points.
        num_shared_points: Points seen by both views, shape (V, V), int64, symmetric.
        triangulation_angle_deg: 75th percentile of the angle at the shared points,
            shape (V, V), float64; 0 where no point is shared.
        depth_range: Near and far depth of each view by COLMAP's rule (1 % and 99 %
            of its sparse depths, stretched by 25 %), shape (V, 2), float64; a row is
            (0, 0) for a view without points.
        origin_in_world: What all coordinates here are relative to, shape (3,), float64,
            in units of the model; not 0 only for a model far from its own origin (UTM,
            ECEF), whose coordinates single precision could not hold.
    """

    views: tuple[View, ...]
    origin_in_world: Matrix = dataclasses.field(default_factory=lambda: np.zeros(3))
    num_points: int = 0
    num_shared_points: npt.NDArray[np.int64] | None = None
    triangulation_angle_deg: Matrix | None = None
    depth_range: Matrix | None = None

    def index(self, name: str) -> int:
        """Position in `views` of the view of that name; -1 if there is none."""
        for index, view in enumerate(self.views):
            if view.name == name:
                return index
        return -1
