"""A rendered scene in ETH3D's formats: a slanted wall and a ball, exact everywhere.

Depth is cast through the distorted camera itself, pixel by pixel; that of the
undistorted camera, which nothing is computed from, is cast through that one.
"""

import dataclasses
import shutil
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pycolmap
from analytic_scene import turned
from PIL import Image

from resdepth_colmap.scene import Camera, DepthMap, FloatMap, Matrix

IMAGES = ("DSC_0001.JPG", "DSC_0002.JPG", "DSC_0003.JPG")
WIDTH_PX, HEIGHT_PX = 240, 160
MISSING_SHARE = 0.1
"""Share of the true depth that the scan lacks, here and there."""

BALL_CENTER, BALL_RADIUS = np.array([0.25, 0.1, 3.2]), 0.55
WALL_NORMAL, WALL_OFFSET = np.array([0.25, -0.15, -1.0]), -4.5

_LENS = (0.21047, 0.21102, -5.4e-06, 5.2e-04, -0.158, 0.407, -8.5e-05, 8.6e-04)
_CENTERS = ((0.0, 0.0, 0.0), (0.35, 0.02, 0.03), (-0.4, -0.03, 0.0))
_WRONG = np.s_[20:40, 30:60]
"""What the mask says is not to be evaluated: the depth there is wrong."""


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class RenderedEth3d:
    """What was written.

    Attributes:
        path: Folder of the scene.
        undistorted: The pinhole camera of all undistorted images.
        poses: cam_from_world of each image.
    """

    path: Path
    undistorted: pycolmap.Camera
    poses: tuple[Matrix, ...]

    def depth(self, index: int, camera: Camera) -> DepthMap:
        """Exact depth of an undistorted image at that size."""
        x, y = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
        rays = np.stack(
            [
                (x + 0.5 - camera.cx) / camera.fx,
                (y + 0.5 - camera.cy) / camera.fy,
                np.ones(x.shape),
            ],
            axis=-1,
        )
        return cast(rays, self.poses[index])[0].astype(np.float32)

    def camera(self, width_px: int) -> Camera:
        """The undistorted camera, at the size that is compared at."""
        full = self.undistorted
        fx, fy, cx, cy = full.params
        size = {"width_px": full.width, "height_px": full.height}
        camera = Camera(**size, fx=fx, fy=fy, cx=cx, cy=cy)
        scale = width_px / full.width
        return camera.resized(round(full.width * scale), round(full.height * scale))


def write_eth3d_scene(path: Path) -> RenderedEth3d:
    """Write a scene as the archives of ETH3D unpack it."""
    lens = [0.565 * WIDTH_PX, 0.564 * WIDTH_PX, 0.503 * WIDTH_PX, 0.499 * HEIGHT_PX]
    size = {"width": WIDTH_PX, "height": HEIGHT_PX, "camera_id": 1}
    distorted = pycolmap.Camera(
        model="THIN_PRISM_FISHEYE", params=[*lens, *_LENS], **size
    )
    undistorted = pycolmap.undistort_camera(
        pycolmap.UndistortCameraOptions(), distorted
    )
    undistorted.camera_id = 1
    poses = tuple(
        np.column_stack([rotation, -rotation @ np.array(center)])
        for rotation, center in zip(
            (turned(0.01 * i, -0.03 * i) for i in range(3)), _CENTERS, strict=True
        )
    )
    for index, name in enumerate(IMAGES):
        rng = np.random.default_rng(index)
        depth, gray = cast(rays_of(distorted), poses[index])
        _save_jpeg(path / "images/dslr_images" / name, gray)
        _save_truth(path / "ground_truth_depth/dslr_images" / name, depth, rng)
        _save_mask(path / "masks_for_images/dslr_images" / f"{Path(name).stem}.png")
        _, gray = cast(rays_of(undistorted), poses[index])
        _save_jpeg(path / "images/dslr_images_undistorted" / name, gray)
    _write_model(path / "dslr_calibration_jpg", distorted, poses, "dslr_images")
    _write_model(
        path / "dslr_calibration_undistorted",
        undistorted,
        poses,
        "dslr_images_undistorted",
    )
    _write_scan(path / "dslr_scan_eval", distorted)
    return RenderedEth3d(path=path, undistorted=undistorted, poses=poses)


def copied(scene: RenderedEth3d, path: Path) -> Path:
    """A copy of the scene to break; its folder."""
    return Path(shutil.copytree(scene.path, path))


def rays_of(camera: pycolmap.Camera) -> Matrix:
    """Rays through the centres of a camera's pixels, z = 1, shape (H, W, 3)."""
    x, y = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    xy = np.stack([x, y], axis=-1).reshape(-1, 2) + 0.5
    rays: Matrix = np.ones((len(xy), 3))
    rays[:, :2] = camera.cam_from_img(xy)
    return rays.reshape(camera.height, camera.width, 3)


def cast(rays: Matrix, cam_from_world: Matrix) -> tuple[FloatMap, FloatMap]:
    """Depth along the optical axis and grey value of what rays (z = 1) meet."""
    rotation = cam_from_world[:, :3]
    center = -rotation.T @ cam_from_world[:, 3]
    in_world = rays @ rotation
    depth = (WALL_OFFSET - center @ WALL_NORMAL) / (in_world @ WALL_NORMAL)
    start = center - BALL_CENTER
    a, b = (in_world**2).sum(axis=-1), in_world @ start
    root = b**2 - a * (start @ start - BALL_RADIUS**2)
    hit = root > 0
    near = (-b - np.sqrt(np.where(hit, root, 0))) / a
    depth = np.where(hit, near, depth)
    return depth, _texture(center + in_world * depth[..., np.newaxis])


def _texture(xyz: Matrix) -> FloatMap:
    """Waves of many lengths in 0..1."""
    rng = np.random.default_rng(5)
    value = np.zeros(xyz.shape[:-1])
    for _ in range(16):
        value += np.sin(xyz @ rng.normal(0, 9, 3) + rng.uniform(0, 6))
    return np.clip(0.5 + 0.1 * value, 0, 1)


def _save_jpeg(path: Path, gray: FloatMap) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.rint(255 * gray).astype(np.uint8)).save(path, quality=98)


def _save_truth(path: Path, depth: FloatMap, rng: np.random.Generator) -> None:
    """Raw float32 under a name of an image, +inf where nothing is known."""
    given = depth.astype("<f4")
    given[rng.random(depth.shape) < MISSING_SHARE] = np.inf
    given[_WRONG] = 1.5 * depth[_WRONG]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(given.tobytes())


def _save_mask(path: Path) -> None:
    """2: not evaluated; 1: only not used to align the images."""
    values: npt.NDArray[np.uint8] = np.zeros((HEIGHT_PX, WIDTH_PX), np.uint8)
    values[60:100] = 1
    values[_WRONG] = 2
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(values).save(path)


def _write_model(
    path: Path, camera: pycolmap.Camera, poses: tuple[Matrix, ...], folder: str
) -> None:
    """A text model as COLMAP wrote them in 2017, with points that all images see."""
    model = pycolmap.Reconstruction()
    model.add_camera_with_trivial_rig(camera)
    rays = np.random.default_rng(1).uniform(-0.5, 0.5, (60, 3))
    rays[:, 2] = 1
    points = rays * cast(rays, poses[0])[0][:, np.newaxis]  # view 0 is the world
    for index, (name, pose) in enumerate(zip(IMAGES, poses, strict=True)):
        image = pycolmap.Image(
            name=f"{folder}/{name}",
            camera_id=1,
            image_id=index + 1,
            keypoints=camera.img_from_cam(points @ pose[:, :3].T + pose[:, 3]),
        )
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(pose))
    for index, point in enumerate(points):
        track = pycolmap.Track()
        for image_id in range(1, len(IMAGES) + 1):
            track.add_element(image_id, index)
        model.add_point3D(point, track, np.array([128, 128, 128], dtype=np.uint8))
    path.mkdir(parents=True)
    model.write_text(str(path))
    for name in ("rigs.txt", "frames.txt"):
        (path / name).unlink()


def _write_scan(path: Path, camera: pycolmap.Camera) -> None:
    """A laser scan in the frame of its scanner, and where that stood."""
    world_from_scan = np.eye(4)
    world_from_scan[:3, :3] = turned(0.3, -0.2)
    world_from_scan[:3, 3] = (0.1, 0.2, -0.3)
    depth, _ = cast(rays_of(camera), np.eye(3, 4))
    xyz_in_world = (rays_of(camera) * depth[..., np.newaxis]).reshape(-1, 3)
    xyz = (xyz_in_world - world_from_scan[:3, 3]) @ world_from_scan[:3, :3]
    path.mkdir(parents=True)
    header = "".join(
        f"{line}\n"
        for line in (
            "ply",
            "format binary_little_endian 1.0",
            f"element vertex {len(xyz)}",
            *(f"property float {axis}" for axis in "xyz"),
            "end_header",
        )
    )
    (path / "scan1.ply").write_bytes(header.encode() + xyz.astype("<f4").tobytes())
    rows = "\n".join(" ".join(f"{v:.9g}" for v in row) for row in world_from_scan)
    (path / "scan_alignment.mlp").write_text(
        "<!DOCTYPE MeshLabDocument>\n<MeshLabProject>\n <MeshGroup>\n"
        '  <MLMesh label="scan1.ply" filename="scan1.ply">\n'
        f"   <MLMatrix44>\n{rows}\n</MLMatrix44>\n  </MLMesh>\n"
        " </MeshGroup>\n</MeshLabProject>\n"
    )
