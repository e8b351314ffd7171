"""Laws of the masks."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.masks import (
    Masks,
    check_masks,
    find_mask_folder,
    is_same_shape,
    mask_file,
    read_mask,
)
from resdepth_colmap.scene import Camera

CAMERA = Camera(width_px=8, height_px=6, fx=9.0, fy=9.0, cx=4.0, cy=3.0)


def write(folder: Path, name: str, values: npt.NDArray[np.uint8]) -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(values).save(path)
    return path


def test_what_is_not_black_is_wanted(tmp_path: Path) -> None:
    values = np.zeros((6, 8), np.uint8)
    values[1:3, 2:5] = (1, 128, 255)
    path = write(tmp_path, "a/b.jpg.png", values)
    assert mask_file(tmp_path, "a/b.jpg") == path
    assert np.array_equal(read_mask(path), values > 0)


def test_the_name_of_the_image_comes_before_its_stem(tmp_path: Path) -> None:
    path = write(tmp_path, "a/b.c.png", np.zeros((6, 8), np.uint8))
    assert mask_file(tmp_path, "a/b.c.jpg") == path
    assert mask_file(tmp_path, "a/b.jpg") is None
    path = write(tmp_path, "a/b.c.jpg.png", np.zeros((6, 8), np.uint8))
    assert mask_file(tmp_path, "a/b.c.jpg") == path


def test_a_mask_of_another_shape_names_both_sizes_and_the_way_out(
    tmp_path: Path,
) -> None:
    write(tmp_path, "a.jpg.png", np.zeros((6, 9), np.uint8))
    said = r"a\.jpg\.png.* 9 x 6 .* 8 x 6.*--no-masks"
    cameras = {"a.jpg": CAMERA, "b.jpg": CAMERA}
    with pytest.raises(WorkspaceError, match=said):
        check_masks(Masks(folder=tmp_path), cameras)
    with pytest.raises(WorkspaceError, match=said):
        Masks(folder=tmp_path).read("a.jpg", (8, 6))


def test_shapes_are_the_same_but_for_whole_pixels() -> None:
    assert is_same_shape((640, 480), (320, 240))
    assert is_same_shape((3000, 2001), (1000, 667))
    assert is_same_shape((101, 67), (1003, 665))
    assert not is_same_shape((640, 480), (480, 640))
    assert not is_same_shape((6048, 4032), (6201, 4150))
    assert not is_same_shape((640, 480), (640, 481))


def test_images_without_a_mask_are_no_mistake_but_no_match_and_no_folder_are(
    tmp_path: Path,
) -> None:
    write(tmp_path, "b.jpg.png", np.zeros((3, 4), np.uint8))
    cameras = {"a.jpg": CAMERA, "b.jpg": CAMERA}
    assert check_masks(Masks(folder=tmp_path), cameras) == ("a.jpg",)
    with pytest.raises(WorkspaceError, match=r"no mask of any .*a\.jpg\.png or a\.png"):
        check_masks(Masks(folder=tmp_path), {"a.jpg": CAMERA})
    with pytest.raises(WorkspaceError, match=r"none: no such folder of masks"):
        check_masks(Masks(folder=tmp_path / "none"), cameras)
    assert check_masks(Masks(), cameras) == ()


def test_a_folder_is_found_if_anything_is_in_it(tmp_path: Path) -> None:
    assert find_mask_folder(tmp_path) is None
    (tmp_path / "masks").mkdir()
    assert find_mask_folder(tmp_path) is None
    write(tmp_path, "masks/a.png", np.zeros((6, 8), np.uint8))
    assert find_mask_folder(tmp_path) == tmp_path / "masks"


@pytest.mark.parametrize("mode", ["RGBA", "LA", "P"])
def test_alpha_is_a_mask_and_both_count(tmp_path: Path, mode: str) -> None:
    rgba = np.full((6, 8, 4), 200, np.uint8)
    rgba[:3, :, 3] = 0
    image = Image.fromarray(rgba)
    if mode == "P":
        image = Image.fromarray((rgba[..., 3] > 0).astype(np.uint8)).convert("P")
        image.info["transparency"] = 0
    (tmp_path / "images").mkdir()
    image = image if mode == "P" else image.convert(mode)
    image.save(tmp_path / "images/a.png")
    Image.fromarray(rgba[..., :3]).save(tmp_path / "images/b.png")
    values = np.zeros((6, 8), np.uint8)
    values[:, 4:] = 255
    write(tmp_path, "masks/a.png", values)
    masks = Masks(folder=tmp_path / "masks", alpha_folder=tmp_path / "images")
    black, transparent = masks.read("a.png", (8, 6))
    assert np.array_equal(black, values > 0)
    assert np.array_equal(transparent, rgba[..., 3] > 0)
    assert masks.read("b.png", (8, 6)) == ()
    cameras = {"a.png": CAMERA, "b.png": CAMERA}
    assert check_masks(masks, cameras) == ("b.png",)
    alone = Masks(alpha_folder=tmp_path / "images")
    with pytest.raises(WorkspaceError, match=r"images.*alpha.*--alpha-masks"):
        check_masks(alone, {"b.png": CAMERA})
