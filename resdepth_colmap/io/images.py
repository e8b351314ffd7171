"""Photos, read as grey or colour values, and PNG files written.

PNG is only ever written through `io/png.py`: after `import pycolmap`, others may abort.
An EXIF orientation is not applied, because COLMAP's cameras do not apply it either.
"""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image, UnidentifiedImageError

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.files import write_whole
from resdepth_colmap.io.png import encode_png
from resdepth_colmap.scene import ColorImage, GrayImage, UnitColors

# Rec. 709, the weights of COLMAP's conversion to grey.
_LUMA = np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)


def read_gray(path: Path) -> GrayImage:
    """Read a photo as grey values in 0..1, shape (H, W), float32; alpha is dropped.

    8 or 16 bits a channel, grey or colour. WorkspaceError if it is no image.
    """
    values = _read_unit(path)
    return values if values.ndim == 2 else values @ _LUMA


def read_unit_colors(path: Path) -> UnitColors:
    """Read a photo as RGB in 0..1, shape (H, W, 3), float32; see `read_gray`."""
    values = _read_unit(path)
    return values if values.ndim == 3 else np.repeat(values[..., np.newaxis], 3, 2)


def read_rgb(path: Path) -> ColorImage:
    """Read a photo as RGB values, shape (H, W, 3), uint8; see `read_gray`."""
    return (read_unit_colors(path) * 255 + 0.5).astype(np.uint8)


def has_alpha(path: Path) -> bool:
    """Whether an image has an alpha channel, without decoding it.

    Raises:
        WorkspaceError: If the file is not there or no image.
    """
    with open_image(path) as image:
        return "A" in image.getbands() or "transparency" in image.info


def read_alpha(path: Path) -> npt.NDArray[np.uint8]:
    """Read the alpha channel of an image, shape (H, W); 255 where it has none.

    Raises:
        WorkspaceError: If the file is not there or no image.
    """
    with open_image(path) as image:
        return np.asarray(image.convert("RGBA").getchannel("A"))


def image_size(path: Path) -> tuple[int, int]:
    """Width and height of an image, in pixels; WorkspaceError if it is no image."""
    with open_image(path) as image:
        return image.size


def write_png(path: Path, rgb: ColorImage) -> None:
    """Write RGB values, shape (H, W, 3), uint8, as PNG; WorkspaceError if it fails."""
    if rgb.ndim != 3 or rgb.shape[2] != 3 or rgb.dtype != np.uint8:
        raise ValueError(f"{rgb.shape=}, {rgb.dtype=} but expected (H, W, 3), uint8.")
    write_whole(path, encode_png(rgb))


def _read_unit(path: Path) -> npt.NDArray[np.float32]:
    """Values in 0..1, shape (H, W) or (H, W, 3), float32."""
    with open_image(path) as image:
        if _is_16_bit_color(image):
            return _read_16_bit_color(path)
        if image.mode.startswith("I"):  # 16-bit grey
            return _unit(np.asarray(image), 65535)
        if image.mode == "F":
            return _unit(np.nan_to_num(np.asarray(image)), 1)
        is_gray = image.mode in ("1", "L", "LA")
        return _unit(np.asarray(image.convert("L" if is_gray else "RGB")), 255)


def _unit(values: npt.NDArray[Any], maximum: int) -> npt.NDArray[np.float32]:
    scaled: npt.NDArray[np.float32] = values.astype(np.float32) / np.float32(maximum)
    return np.clip(scaled, 0, 1)


def _is_16_bit_color(image: Image.Image) -> bool:
    # Pillow keeps 8 bits a channel; its raw mode ("RGB;16B") shows that there are 16.
    tiles = getattr(image, "tile", [])
    raw_modes = [tile[3] if isinstance(tile[3], str) else tile[3][0] for tile in tiles]
    return any(str(raw).startswith("RGB") and ";16" in str(raw) for raw in raw_modes)


def _read_16_bit_color(path: Path) -> npt.NDArray[np.float32]:
    # Not cv2.imread, which cannot open non-ASCII paths on Windows.
    data = np.fromfile(path, dtype=np.uint8)
    values = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    if values is None or values.ndim != 3 or values.dtype != np.uint16:
        raise WorkspaceError(f"{path}: cannot decode it as a 16-bit colour image.")
    return _unit(values[..., 2::-1], 65535)  # BGR(A) to RGB


@contextlib.contextmanager
def open_image(path: Path) -> Iterator[Image.Image]:
    """Open an image with Pillow; it is decoded when its pixels are read.

    Raises:
        WorkspaceError: If the file is not there or no image, now or when it is decoded.
    """
    try:
        with _without_pixel_limit(), Image.open(path) as image:
            yield image
    except WorkspaceError:
        raise
    except UnidentifiedImageError as error:
        raise WorkspaceError(f"{path}: not an image that can be read.") from error
    except (OSError, SyntaxError, ValueError) as error:  # what Pillow's decoders raise
        reason = getattr(error, "strerror", None) or error
        raise WorkspaceError(f"{path}: cannot read the image ({reason}).") from error


@contextlib.contextmanager
def _without_pixel_limit() -> Iterator[None]:
    # Aerial cameras have more pixels than Pillow's limit for images from the web.
    limit = Image.MAX_IMAGE_PIXELS
    Image.MAX_IMAGE_PIXELS = None
    try:
        yield
    finally:
        Image.MAX_IMAGE_PIXELS = limit
