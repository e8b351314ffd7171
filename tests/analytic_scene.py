"""Two views of a plane or a sphere whose depth and colours are known exactly."""

import dataclasses

import numpy as np
import torch
from torch import Tensor

from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.scene import Camera, FloatMap, Matrix, View, cam_from_cam

Surface = tuple[str, Matrix]


def turned(x_rad: float, y_rad: float) -> Matrix:
    """A rotation about x, then y, shape (3, 3)."""
    cx, sx, cy, sy = np.cos(x_rad), np.sin(x_rad), np.cos(y_rad), np.sin(y_rad)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    return np.asarray(about_y @ about_x, dtype=np.float64)


def view_at(
    center: tuple[float, float, float],
    camera: Camera,
    rotation: Matrix | None = None,
    name: str = "view.png",
) -> View:
    """A view with that centre; `rotation` is that of cam_from_world, or none."""
    R = np.eye(3) if rotation is None else rotation
    pose = np.column_stack([R, -R @ np.array(center)])
    return View(image_id=1, name=name, camera=camera, cam_from_world=pose)


def colour(xyz: Matrix) -> FloatMap:
    """A smooth grey value in 0..1 of each point of the world, shape (..., )."""
    x, y, z = xyz[..., 0], xyz[..., 1], xyz[..., 2]
    waves = np.sin(3 * x + 1) + np.sin(4 * y) + np.sin(2 * (x + y) + z)
    return np.asarray(0.5 + waves / 6.5, dtype=np.float64)


def _rays(view: View) -> Matrix:
    """Rays in the world, by COLMAP's rule itself: no echo of `geometry.pixels`."""
    camera = view.camera
    x, y = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
    in_cam = np.stack(
        [
            (x + 0.5 - camera.cx) / camera.fx,
            (y + 0.5 - camera.cy) / camera.fy,
            np.ones_like(x),
        ],
        axis=-1,
    )
    return np.asarray(in_cam @ view.cam_from_world[:, :3])  # row times R: R^T ray


def depth_of_plane(view: View, normal: Matrix, offset: float) -> FloatMap:
    """Depth of the plane normal . xyz = offset, shape (H, W), float64."""
    rays = _rays(view)  # z of a ray in the camera is 1: its length is the depth
    return np.asarray((offset - view.center_in_world @ normal) / (rays @ normal))


def depth_of_sphere(view: View, center: Matrix, radius: float) -> FloatMap:
    """Depth of the near side of a sphere, shape (H, W), float64; 0 beside it."""
    rays, start = _rays(view), view.center_in_world - center
    a = (rays**2).sum(-1)
    b = rays @ start
    root = b**2 - a * (start @ start - radius**2)
    hit = root > 0
    return np.where(hit, (-b - np.sqrt(np.where(hit, root, 0))) / a, 0.0)


def image_of(view: View, depth: FloatMap) -> FloatMap:
    """Grey values of the surface at that depth, shape (H, W); 0 where no depth."""
    xyz = view.center_in_world + _rays(view) * depth[..., None]
    return np.where(depth > 0, colour(xyz), 0.0)


def normals_of_depth(view: View, normal: Matrix) -> Matrix:
    """The world normal in the camera frame."""
    return view.cam_from_world[:, :3] @ normal


@dataclasses.dataclass(frozen=True, kw_only=True)
class Pair:
    """Tensors of two views, each of batch size 1, double precision."""

    depth: Tensor
    reference_gray: Tensor
    source_gray: Tensor
    reference_K: Tensor  # noqa: N815
    source_K: Tensor  # noqa: N815
    source_from_reference: Tensor

    @property
    def inverse_depth(self) -> Tensor:
        """Inverse depth of the reference; 0 = no depth."""
        valid = self.depth > 0
        return torch.where(valid, 1 / torch.where(valid, self.depth, 1.0), 0.0)


def tensor(values: Matrix | FloatMap) -> Tensor:
    """Double, with a leading batch axis (and a channel axis for a map)."""
    return torch.from_numpy(np.array(values, dtype=np.float64))[None]


CAMERA = Camera(width_px=64, height_px=48, fx=60.0, fy=62.0, cx=31.0, cy=24.5)
PLANE_NORMAL = np.array([0.3, -0.2, -1.0])
PLANE_OFFSET = -4.0
SPHERE_CENTER = np.array([0.1, 0.0, 4.0])


def plane_pair(source_camera: Camera = CAMERA) -> Pair:
    """A slanted plane about 4 units away; the source turned and 0.5 units aside."""
    return _pair(
        lambda view: depth_of_plane(view, PLANE_NORMAL, PLANE_OFFSET), source_camera
    )


def sphere_pair() -> Pair:
    """A sphere that fills the middle of both images."""
    return _pair(lambda view: depth_of_sphere(view, SPHERE_CENTER, 1.2), CAMERA)


def two_views(source_camera: Camera = CAMERA) -> tuple[View, View]:
    """Reference at the origin, source aside and turned towards the scene."""
    reference = view_at((0.0, 0.0, 0.0), CAMERA, name="reference.png")
    source = view_at(
        (0.5, 0.1, -0.2), source_camera, turned(0.03, -0.1).T, name="source.png"
    )
    return reference, source


def _pair(depth_of, source_camera: Camera) -> Pair:  # type: ignore[no-untyped-def]
    reference, source = two_views(source_camera)
    depth = depth_of(reference)
    return Pair(
        depth=tensor(depth)[None],
        reference_gray=tensor(image_of(reference, depth))[None],
        source_gray=tensor(image_of(source, depth_of(source)))[None],
        reference_K=tensor(index_K(reference.camera)),
        source_K=tensor(index_K(source.camera)),
        source_from_reference=tensor(cam_from_cam(source, reference)),
    )
