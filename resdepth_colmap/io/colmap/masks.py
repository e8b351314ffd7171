"""Masks: which pixels of an image are wanted, in COLMAP's convention.

The mask of `images/a/b.jpg` is `MASKS/a/b.jpg.png` or `MASKS/a/b.png`, of any size but
of the shape of the image; its pixels of value 0 are left out. An alpha channel of the
image itself is the same to us: pixels of alpha 0 are left out.
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path, PurePosixPath

import numpy as np

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.files import safe_name
from resdepth_colmap.io.images import has_alpha, image_size, read_alpha, read_gray
from resdepth_colmap.scene import Camera, Wanted

FOLDER_NAME = "masks"
"""Beside `images/`: where masks are found without being named."""

_WITHOUT = "leave masks out with --no-masks"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Masks:
    """The masks of a workspace's images.

    Attributes:
        folder: Where mask files lie; None = nowhere.
        alpha_folder: Folder of the images, if their alpha channels are masks.
    """

    folder: Path | None = None
    alpha_folder: Path | None = None

    @property
    def are_used(self) -> bool:
        """Whether any image may have a mask."""
        return self.folder is not None or self.alpha_folder is not None

    def files(self, name: str) -> tuple[Path, ...]:
        """The files that make the mask of an image; () = all its pixels are wanted."""
        files = (self._mask_file(name), self._alpha_file(name))
        return tuple(path for path in files if path is not None)

    def read(self, name: str, size_px: tuple[int, int]) -> tuple[Wanted, ...]:
        """The masks of an image, each at its own size; () = all pixels are wanted.

        Args:
            name: Name of the image.
            size_px: Width and height of what they are for, the image or a map of it.

        Raises:
            WorkspaceError: If a mask is no image, or of another shape than that.
        """
        masks = []
        if (path := self._mask_file(name)) is not None:
            masks.append(_checked(path, read_mask(path), size_px))
        if (path := self._alpha_file(name)) is not None:
            masks.append(_checked(path, read_alpha(path) > 0, size_px))
        return tuple(masks)

    def _mask_file(self, name: str) -> Path | None:
        return None if self.folder is None else mask_file(self.folder, name)

    def _alpha_file(self, name: str) -> Path | None:
        if self.alpha_folder is None:
            return None
        path = self.alpha_folder / safe_name(name)
        return path if path.is_file() and has_alpha(path) else None


def mask_file(folder: Path, name: str) -> Path | None:
    """The mask file of an image; None: it has none."""
    for path in _candidates(folder, name):
        if path.is_file():
            return path
    return None


def find_mask_folder(workspace_path: Path) -> Path | None:
    """The folder `masks/` in a workspace; None if there is none, or an empty one."""
    folder = workspace_path / FOLDER_NAME
    return folder if folder.is_dir() and any(folder.iterdir()) else None


def check_masks(masks: Masks, cameras: Mapping[str, Camera]) -> tuple[str, ...]:
    """Check that the masks are there and fit their images.

    Args:
        masks: Where they lie.
        cameras: The camera of each image, by its name.

    Returns:
        The images without a mask.

    Raises:
        WorkspaceError: If the folder is not there or has no mask of any of these
            images, a mask is no image or of another shape than its image, or alpha
            channels are asked for and no image has one.
    """
    if not masks.are_used:
        return ()
    masked = {name for name in cameras if masks.files(name)}
    if masks.folder is not None:
        _check_folder(masks.folder, cameras)
    if masks.alpha_folder is not None:
        with_alpha = (Masks(alpha_folder=masks.alpha_folder).files(n) for n in cameras)
        if not any(with_alpha):
            raise WorkspaceError(
                f"{masks.alpha_folder}: none of the {len(cameras)} images has an alpha "
                "channel; leave out --alpha-masks."
            )
    return tuple(name for name in cameras if name not in masked)


def read_mask(path: Path) -> Wanted:
    """Read a mask, at its own size.

    Raises:
        WorkspaceError: If the file is no image.
    """
    return np.asarray(read_gray(path) > 0)


def _candidates(folder: Path, name: str) -> tuple[Path, Path]:
    stem = str(PurePosixPath(safe_name(name)).with_suffix(""))
    return folder / f"{safe_name(name)}.png", folder / f"{stem}.png"


def _check_folder(folder: Path, cameras: Mapping[str, Camera]) -> None:
    if not folder.is_dir():
        raise WorkspaceError(
            f"{folder}: no such folder of masks; check --mask-path, or {_WITHOUT}."
        )
    found = {name: mask_file(folder, name) for name in cameras}
    if not any(found.values()):
        tried = [path.relative_to(folder) for path in _candidates(folder, min(cameras))]
        raise WorkspaceError(
            f"{folder}: no mask of any of the {len(cameras)} images; name them as "
            f"{tried[0]} or {tried[1]}, or {_WITHOUT}."
        )
    for name, path in found.items():
        if path is not None:
            camera = cameras[name]
            _check_shape(path, image_size(path), (camera.width_px, camera.height_px))


def _checked(path: Path, wanted: Wanted, size_px: tuple[int, int]) -> Wanted:
    _check_shape(path, (wanted.shape[1], wanted.shape[0]), size_px)
    return wanted


def _check_shape(path: Path, size_px: tuple[int, int], of_px: tuple[int, int]) -> None:
    if not is_same_shape(size_px, of_px):
        raise WorkspaceError(
            f"{path}: the mask has {size_px[0]} x {size_px[1]} pixels, but its image "
            f"{of_px[0]} x {of_px[1]}, which is of another shape; make a mask of the "
            f"undistorted image, or {_WITHOUT}."
        )


def is_same_shape(first_px: tuple[int, int], second_px: tuple[int, int]) -> bool:
    """Whether two (width, height) are of one picture, but for whole pixels."""
    small, large = sorted((first_px, second_px))
    if (small[0] == large[0]) != (small[1] == large[1]):
        return False
    scale_x, scale_y = small[0] / large[0], small[1] / large[1]
    return abs(scale_x - scale_y) <= 1.0 / large[0] + 1.0 / large[1]
