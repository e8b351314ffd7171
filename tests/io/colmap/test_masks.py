"""Laws of the masks."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.masks import check_masks, mask_file, read_mask
from resdepth_colmap.scene import Camera

CAMERA = Camera(width_px=8, height_px=6, fx=9.0, fy=9.0, cx=4.0, cy=3.0)


def write(
    folder: Path, name: str, values: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]
) -> None:
    path = mask_file(folder, name)
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(values).save(path)


def test_what_is_not_black_is_wanted(tmp_path: Path) -> None:
    values = np.zeros((6, 8), np.uint8)
    values[1:3, 2:5] = (1, 128, 255)
    write(tmp_path, "a/b.jpg", values)
    assert mask_file(tmp_path, "a/b.jpg") == tmp_path / "a" / "b.jpg.png"
    wanted = read_mask(tmp_path / "a" / "b.jpg.png")
    assert np.array_equal(wanted, values > 0)


def test_a_mask_of_another_size_names_both_sizes(tmp_path: Path) -> None:
    write(tmp_path, "a.jpg", np.zeros((6, 9), np.uint8))
    cameras = {"a.jpg": CAMERA, "b.jpg": CAMERA}
    with pytest.raises(WorkspaceError, match=r"a\.jpg\.png.* 9 x 6 .* 8 x 6"):
        check_masks(tmp_path, cameras)


def test_images_without_a_mask_are_no_mistake_but_a_missing_folder_is(
    tmp_path: Path,
) -> None:
    write(tmp_path, "b.jpg", np.zeros((6, 8), np.uint8))
    assert check_masks(tmp_path, {"a.jpg": CAMERA, "b.jpg": CAMERA}) == 1
    with pytest.raises(WorkspaceError, match=r"none: no such folder"):
        check_masks(tmp_path / "none", {"a.jpg": CAMERA})
