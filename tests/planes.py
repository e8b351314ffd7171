"""An exact scene: five cameras before a slanted, textured plane, as a workspace."""

import dataclasses
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pycolmap
from PIL import Image

from resdepth_colmap.io.colmap.maps import write_depth_map, write_normal_map
from resdepth_colmap.scene import Camera, ColorImage, DepthMap, Matrix, NormalMap, View

# The plane: normal @ xyz_in_world = OFFSET; the normal points at the cameras.
NORMAL: Matrix = np.array([0.3, -0.2, -1.0]) / np.linalg.norm([0.3, -0.2, -1.0])
OFFSET = float(NORMAL @ [0.0, 0.0, 4.0])

# "file name" as a user might have it: sub-folders, blanks, non-ASCII.
NAMES = ("a/0.png", "a/1 b.png", "größe/2.png", "3.png", "4.png")


@dataclasses.dataclass(frozen=True, kw_only=True)
class PlaneView:
    """One view with all that is true of it."""

    view: View
    image: ColorImage
    depth: DepthMap
    normals: NormalMap


def plane_views(
    width_px: int = 80, height_px: int = 60, *, center_px: float = 0.5
) -> list[PlaneView]:
    """Five views of the plane.

    Args:
        width_px: Width of the images.
        height_px: Height of the images.
        center_px: A pixel's centre is at its index plus this: 0.5 by the truth of
            COLMAP's K, 0 as COLMAP's PatchMatch and fusion take it.
    """
    camera = Camera(
        width_px=width_px,
        height_px=height_px,
        fx=1.2 * width_px,
        fy=1.1 * width_px,
        cx=0.5 * width_px + 1.5,
        cy=0.5 * height_px - 0.75,
    )
    poses = [(0, 0, 0), (-0.5, 0, 0.05), (0.5, 0.1, -0.05), (0, -0.4, 0.1), (0, 0.4, 0)]
    return [
        _plane_view(index + 1, camera, np.array(center, dtype=np.float64), center_px)
        for index, center in enumerate(poses)
    ]


def write_plane_workspace(
    path: Path,
    *,
    kinds: tuple[str, ...] = ("geometric",),
    num_points: int = 200,
    binary: bool = True,
    size_px: tuple[int, int] = (80, 60),
    center_px: float = 0.5,
) -> list[PlaneView]:
    """Write a dense workspace of the plane.

    Args:
        path: Its folder.
        kinds: The kinds of exact depth and normal maps to write; () = no maps.
        num_points: Sparse points on the plane, with tracks; 0 = none.
        binary: Write the model as .bin, else as .txt.
        size_px: Width and height of the images.
        center_px: As in `plane_views`.

    Returns:
        What was written.
    """
    plane = plane_views(*size_px, center_px=center_px)
    for view in plane:
        name = view.view.name
        image_path = path / "images" / name
        image_path.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(view.image).save(image_path)
        for kind in kinds:
            file_name = f"{name}.{kind}.bin"
            write_depth_map(path / "stereo/depth_maps" / file_name, view.depth)
            write_normal_map(path / "stereo/normal_maps" / file_name, view.normals)
    write_model(path / "sparse", plane, num_points=num_points, binary=binary)
    names = [view.view.name for view in plane]
    (path / "stereo").mkdir(exist_ok=True)
    pairs = "".join(f"{name}\n__auto__, 20\n" for name in names)
    (path / "stereo/patch-match.cfg").write_text(pairs, encoding="utf-8")
    fusion = "".join(f"{name}\n" for name in names)
    (path / "stereo/fusion.cfg").write_text(fusion, encoding="utf-8")
    return plane


def write_model(
    path: Path, plane: list[PlaneView], *, num_points: int, binary: bool = True
) -> None:
    """Write the sparse model of these views."""
    model = pycolmap.Reconstruction()
    camera = plane[0].view.camera
    model.add_camera_with_trivial_rig(
        pycolmap.Camera(
            camera_id=1,
            model="PINHOLE",
            width=camera.width_px,
            height=camera.height_px,
            params=[camera.fx, camera.fy, camera.cx, camera.cy],
        )
    )
    points = points_on_plane(num_points)
    for plane_view in plane:
        view = plane_view.view
        image = pycolmap.Image(
            name=view.name,
            camera_id=1,
            image_id=view.image_id,
            keypoints=_project(points, view),
        )
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(view.cam_from_world))
    for index, point in enumerate(points):
        track = pycolmap.Track()
        for plane_view in plane:
            track.add_element(plane_view.view.image_id, index)
        model.add_point3D(point, track, np.array([200, 100, 50], dtype=np.uint8))
    path.mkdir(parents=True, exist_ok=True)
    if binary:
        model.write_binary(path)
    else:
        model.write_text(path)


def points_on_plane(num_points: int) -> Matrix:
    """Points of the plane that all views see, shape (N, 3), in the world frame."""
    rng = np.random.default_rng(0)
    points = np.zeros((num_points, 3))
    points[:, :2] = rng.uniform(-0.6, 0.6, (num_points, 2))
    points[:, 2] = (OFFSET - points[:, :2] @ NORMAL[:2]) / NORMAL[2]
    return points


def _plane_view(
    image_id: int, camera: Camera, center: Matrix, center_px: float
) -> PlaneView:
    rotation = _rotation(0.06 * (image_id - 3), 0.04 * (image_id - 2))
    view = View(
        image_id=image_id,
        name=NAMES[image_id - 1],
        camera=camera,
        cam_from_world=np.column_stack([rotation, -rotation @ center]),
    )
    rays = (
        _rays(camera, center_px) @ rotation
    )  # in the world frame; z in the camera is 1
    depth = (OFFSET - NORMAL @ center) / (rays @ NORMAL)
    xyz_in_world = center + depth[..., np.newaxis] * rays
    normals = np.broadcast_to(rotation @ NORMAL, (*depth.shape, 3))
    return PlaneView(
        view=view,
        image=_texture(xyz_in_world),
        depth=depth.astype(np.float32),
        normals=normals.astype(np.float32),
    )


def _rotation(yaw: float, pitch: float) -> Matrix:
    cos_y, sin_y, cos_p, sin_p = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
    about_y = np.array([[cos_y, 0, sin_y], [0, 1, 0], [-sin_y, 0, cos_y]])
    about_x = np.array([[1, 0, 0], [0, cos_p, -sin_p], [0, sin_p, cos_p]])
    rotation: Matrix = about_x @ about_y
    return rotation


def _rays(camera: Camera, center_px: float) -> Matrix:
    x = (np.arange(camera.width_px) + center_px - camera.cx) / camera.fx
    y = (np.arange(camera.height_px) + center_px - camera.cy) / camera.fy
    grid_x, grid_y = np.meshgrid(x, y)
    return np.stack([grid_x, grid_y, np.ones_like(grid_x)], axis=2)


def _project(xyz_in_world: Matrix, view: View) -> Matrix:
    xyz = xyz_in_world @ view.cam_from_world[:, :3].T + view.cam_from_world[:, 3]
    camera = view.camera
    x = camera.fx * xyz[:, 0] / xyz[:, 2] + camera.cx
    y = camera.fy * xyz[:, 1] / xyz[:, 2] + camera.cy
    return np.column_stack([x, y])


def _texture(xyz_in_world: Matrix) -> npt.NDArray[np.uint8]:
    """Smooth waves of many lengths, each channel its own."""
    rng = np.random.default_rng(1)
    value = np.zeros(xyz_in_world.shape)
    for _ in range(12):
        wave = rng.normal(0, 6, (3, 3))
        value += np.sin(xyz_in_world @ wave + rng.uniform(0, 6, 3))
    return np.clip(127 + 25 * value, 0, 255).astype(np.uint8)
