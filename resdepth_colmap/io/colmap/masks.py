"""Masks: where an image shows nothing that is wanted, in COLMAP's convention.

The mask of `images/a/b.jpg` is `MASKS/a/b.jpg.png`; its pixels of value 0 are left out.
"""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.files import safe_name
from resdepth_colmap.io.images import image_size, read_gray
from resdepth_colmap.scene import Camera

Wanted = npt.NDArray[np.bool_]
"""Whether a pixel is wanted, shape (H, W)."""


def mask_file(folder: Path, name: str) -> Path:
    """The mask of an image; it may not exist, and then all pixels are wanted."""
    return folder / f"{safe_name(name)}.png"


def check_masks(folder: Path, cameras: dict[str, Camera]) -> int:
    """Check that the masks of a folder fit their images.

    Args:
        folder: Where they lie.
        cameras: The camera of each image, by its name.

    Returns:
        How many of the images have a mask.

    Raises:
        WorkspaceError: If there is no such folder, or a mask is of another size than
            its image, or no image.
    """
    if not folder.is_dir():
        raise WorkspaceError(f"{folder}: no such folder of masks; check --mask-path.")
    paths = {name: mask_file(folder, name) for name in cameras}
    found = {name: path for name, path in paths.items() if path.is_file()}
    for name, path in found.items():
        _check_size(path, cameras[name])
    return len(found)


def read_mask(path: Path) -> Wanted:
    """Read a mask, at the size of its image.

    Raises:
        WorkspaceError: If the file is no image.
    """
    return np.asarray(read_gray(path) > 0)


def _check_size(path: Path, camera: Camera) -> None:
    width_px, height_px = image_size(path)
    if (width_px, height_px) != (camera.width_px, camera.height_px):
        raise WorkspaceError(
            f"{path}: the mask has {width_px} x {height_px} pixels, but its image "
            f"{camera.width_px} x {camera.height_px}; make a mask of the undistorted "
            "image."
        )
