"""ETH3D's high-resolution multi-view scenes, as they are distributed.

The archives `<scene>_dslr_undistorted.7z`, `_dslr_jpg.7z` and `_dslr_depth.7z` of
www.eth3d.net, unpacked into one folder (Schoeps et al., CVPR 2017). The depth is made
by `GroundTruthCreator` of ETH3D/dataset-pipeline; the masks are described there.
"""

import copy
import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.reconstruction import open_reconstruction
from resdepth_colmap.io.files import safe_name
from resdepth_colmap.io.images import image_size
from resdepth_colmap.scene import DepthMap, Matrix

DOWNLOADS = "https://www.eth3d.net/datasets"
UNDISTORTED = "dslr_calibration_undistorted"
DISTORTED = "dslr_calibration_jpg"
TRUTH = "ground_truth_depth/dslr_images"
_MARKS = (UNDISTORTED, DISTORTED, "ground_truth_depth")

NOT_EVALUATED = 2
"""Bit of a mask: the scan does not show what the image shows, so the pixel is not
evaluated. Bit 1 (not used to align images) does not concern the depth."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Eth3dScene:
    """Paths of the scene in a folder."""

    path: Path

    @property
    def name(self) -> str:
        """What ETH3D calls it."""
        return self.path.name

    @property
    def undistorted_model_path(self) -> Path:
        """The model of the undistorted images: PINHOLE."""
        return self.path / UNDISTORTED

    @property
    def distorted_model_path(self) -> Path:
        """The model of the images as taken: THIN_PRISM_FISHEYE."""
        return self.path / DISTORTED

    @property
    def images_path(self) -> Path:
        """What the names in the models are relative to."""
        return self.path / "images"

    def image_path(self, name: str) -> Path:
        """The image of that name in a model; WorkspaceError if it leads out."""
        return self.images_path / safe_name(name)

    def truth_path(self, file_name: str) -> Path:
        """The depth of the distorted image of that file name: raw, in spite of .JPG."""
        return self.path / TRUTH / safe_name(file_name)

    def mask_paths(self, file_name: str) -> tuple[Path, Path]:
        """The masks of an image and of its camera; they need not exist."""
        image = Path(safe_name(file_name)).with_suffix(".png")
        return (
            self.path / "masks_for_images" / "dslr_images" / image,
            self.path / "masks_for_cameras" / "dslr_images.png",
        )

    def check_parts(self) -> None:
        """WorkspaceError, naming folder and archive, if one was not unpacked here."""
        parts = {
            UNDISTORTED: "dslr_undistorted",
            "images": "dslr_undistorted",
            DISTORTED: "dslr_jpg",
            TRUTH: "dslr_depth",
        }
        for folder, archive in parts.items():
            if not (self.path / folder).is_dir():
                raise WorkspaceError(
                    f"{self.path}: no {folder}/ in it; unpack "
                    f"{self.name}_{archive}.7z, from {DOWNLOADS}, there."
                )


def find_eth3d_scenes(root: Path) -> tuple[Eth3dScene, ...]:
    """The scenes in a folder, by name.

    Raises:
        WorkspaceError: If there is none; if the folder is a scene itself, or its
            scenes lie deeper, the message names the right folder.
    """
    if not root.is_dir():
        raise WorkspaceError(
            f"{root}: no such folder; point at the one that the archives of ETH3D were "
            f"unpacked into ({DOWNLOADS})."
        )
    found = [child for child in _folders(root) if _is_scene(child)]
    if found:
        return tuple(Eth3dScene(path=path) for path in found)
    raise WorkspaceError(f"{root}: {_where_instead(root)}.")


def read_raw_depth(path: Path, width_px: int, height_px: int) -> DepthMap:
    """Read the true depth of a distorted image: float32 without a header, +inf = none.

    Returns:
        Depth along the optical axis, shape (H, W), in metres; 0 = not known.

    Raises:
        WorkspaceError: If the file is not there or of another size.
    """
    if not path.is_file():
        raise WorkspaceError(f"{path}: no such file; this image has no true depth.")
    num_expected, num_found = 4 * width_px * height_px, path.stat().st_size
    if num_found != num_expected:
        raise WorkspaceError(
            f"{path}: expected {num_expected} bytes ({width_px} x {height_px} pixels "
            f"of 4), found {num_found}; it is truncated or belongs to another "
            "calibration, unpack it again."
        )
    depth: DepthMap = np.fromfile(path, dtype="<f4").reshape(height_px, width_px)
    known = np.isfinite(depth) & (depth > 0)
    return np.where(known, depth, np.float32(0))


def read_evaluated(path: Path, width_px: int, height_px: int) -> npt.NDArray[np.bool_]:
    """Read a mask: which pixels may be compared with the truth, shape (H, W), bool.

    Raises:
        WorkspaceError: If the file is no image, or of another size than that.
    """
    size = image_size(path)
    if size != (width_px, height_px):
        raise WorkspaceError(
            f"{path}: the mask has {size[0]} x {size[1]} pixels, but its image "
            f"{width_px} x {height_px}; unpack it again."
        )
    with Image.open(path) as image:
        # A palette's indices are the values; colours would not be.
        values = np.asarray(image if image.mode in ("L", "P") else image.convert("L"))
    return np.asarray((values & NOT_EVALUATED) == 0)


def _is_scene(path: Path) -> bool:
    return any((path / mark).is_dir() for mark in _MARKS)


def _where_instead(root: Path) -> str:
    if _is_scene(root):
        above = root.absolute().parent
        return f"is a scene itself; point at the folder above it, {above}"
    scenes = [parent for parent in root.absolute().parents if _is_scene(parent)]
    if scenes:
        return f"is a folder of a scene; point at {scenes[-1].parent}"
    for folder in _folders(root):
        for candidate in (folder, *_folders(folder)):
            if any(_is_scene(child) for child in _folders(candidate)):
                return f"no scene in it, but in a folder of it; point at {candidate}"
    return (
        f"no ETH3D scene in it (a folder with {UNDISTORTED}/); unpack the archives "
        f"of {DOWNLOADS} there"
    )


def _folders(path: Path) -> list[Path]:
    return sorted(child for child in path.iterdir() if child.is_dir())


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
        """Rays in the camera frame, with z = 1, shape (N, 3), float64.

        NaN where the distortion cannot be undone. `xy` are COLMAP's coordinates, in
        pixels, shape (N, 2), float64.
        """
        on_plane = self.camera.cam_from_img(xy)
        return np.column_stack([on_plane, np.ones(len(on_plane))])


def read_distorted_views(path: Path) -> dict[str, DistortedView]:
    """Read the views of a model by the last part of their names.

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
            # A copy, because the model owns its camera and is freed at the end.
            camera=copy.deepcopy(image.camera),
            cam_from_world=np.array(image.cam_from_world().matrix(), np.float64),
        )
    return views
