from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.images import image_size, read_gray, read_rgb, write_png
from resdepth_colmap.scene import ColorImage


def _rgb(seed: int = 0) -> ColorImage:
    rng = np.random.default_rng(seed)
    return rng.integers(0, 256, (7, 9, 3), dtype=np.uint8)


def test_what_is_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a b" / "größe.png"
    write_png(path, _rgb())
    np.testing.assert_array_equal(read_rgb(path), _rgb())
    assert image_size(path) == (9, 7)


@pytest.mark.parametrize("mode", ["1", "L", "LA", "P", "RGB", "RGBA", "CMYK", "I;16"])
def test_each_kind_of_image_is_read_at_its_size_in_range(
    tmp_path: Path, mode: str
) -> None:
    path = tmp_path / f"image.{'tif' if mode == 'CMYK' else 'png'}"
    image = Image.fromarray(_rgb())
    if mode == "I;16":
        image = Image.fromarray(_rgb()[..., 0].astype(np.uint16) * 257)
    else:
        image = image.convert(mode)
    image.save(path)
    gray = read_gray(path)
    assert gray.dtype == np.float32
    assert gray.shape == (7, 9)
    assert 0 <= gray.min() < gray.max() <= 1
    assert read_rgb(path).shape == (7, 9, 3)


def test_alpha_is_dropped_not_blended(tmp_path: Path) -> None:
    rgba = np.concatenate([_rgb(), np.zeros((7, 9, 1), np.uint8)], axis=2)
    Image.fromarray(rgba).save(tmp_path / "a.png")
    np.testing.assert_array_equal(read_rgb(tmp_path / "a.png"), _rgb())


def test_white_is_one_and_black_is_zero_at_8_and_16_bits(tmp_path: Path) -> None:
    types: list[Any] = [np.uint8, np.uint16]
    for dtype in types:
        values = np.array([[0, np.iinfo(dtype).max]], dtype=dtype)
        Image.fromarray(values).save(tmp_path / "a.png")
        np.testing.assert_array_equal(read_gray(tmp_path / "a.png"), [[0, 1]])


def test_all_16_bits_of_a_colour_image_are_read(tmp_path: Path) -> None:
    # A dark image of a 12-bit camera: with 8 bits of it, next to nothing remains.
    bgr = np.random.default_rng(0).integers(0, 4096, (5, 6, 3)).astype(np.uint16)
    data = cv2.imencode(".png", bgr)[1]
    path = tmp_path / "dunkel ü.png"
    path.write_bytes(data.tobytes())
    luma = bgr[..., ::-1].astype(np.float64) @ [0.2126, 0.7152, 0.0722] / 65535
    np.testing.assert_allclose(read_gray(path), luma, atol=1e-6)
    rgb = np.round(bgr[..., ::-1] / 65535 * 255)
    np.testing.assert_allclose(read_rgb(path), rgb, atol=1)


def test_the_orientation_of_exif_is_not_applied(tmp_path: Path) -> None:
    image = Image.fromarray(_rgb())
    exif = image.getexif()
    exif[0x0112] = 6  # turned by a quarter
    image.save(tmp_path / "a.jpg", exif=exif)
    assert image_size(tmp_path / "a.jpg") == (9, 7)
    assert read_gray(tmp_path / "a.jpg").shape == (7, 9)


def test_what_is_no_image_is_named(tmp_path: Path) -> None:
    write_png(tmp_path / "whole.png", np.repeat(_rgb(), 50, axis=0))
    data = (tmp_path / "whole.png").read_bytes()
    (tmp_path / "broken.png").write_bytes(data[: len(data) // 2])
    (tmp_path / "text.png").write_text("no image")
    for name in ("broken.png", "text.png", "gone.png"):
        with pytest.raises(WorkspaceError, match=name):
            read_gray(tmp_path / name)


def test_a_picture_of_wrong_type_is_a_bug_of_the_caller(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected"):
        write_png(tmp_path / "a.png", np.zeros((2, 2), np.uint8))
