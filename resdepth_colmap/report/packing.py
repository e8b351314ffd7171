"""Numbers as PNG files: small, exact, and decoded by the page.

16-bit values become an 8-bit grey PNG of twice the height, the high bytes above the low
ones: about a tenth smaller than a 16-bit PNG.
"""

import io
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import Image

from resdepth_colmap.geometry.resize import area_resized
from resdepth_colmap.io.png import encode_png
from resdepth_colmap.scene import ColorImage, DepthMap, FloatMap
from resdepth_colmap.viz.panels import fitted_size

MAX_VALUE = 65535
CONFIDENCE_LEVELS = 63
_JPEG_QUALITY = 80


class DepthCode(NamedTuple):
    """Depth as integers: depth = nearest * exp((value - 1) * step), 0 = none.

    Attributes:
        nearest: Depth of the value 1, in workspace units.
        step: Relative step of the values; the error is half of it.
    """

    nearest: float
    step: float

    @classmethod
    def of(cls, step: float, *maps: DepthMap | None) -> "DepthCode":
        """One code for several maps, so that equal depths have equal values."""
        least = [float(m[m > 0].min()) for m in maps if m is not None and (m > 0).any()]
        return cls(min(least, default=1.0), step)

    def packed(self, depth: DepthMap) -> bytes:
        """The PNG of a map, shape (2 H, W)."""
        present = depth > 0
        safe = np.where(present, depth, self.nearest).astype(np.float64)
        value = 1 + np.rint(np.log(safe / self.nearest) / self.step)
        value = np.where(present, np.clip(value, 1, MAX_VALUE), 0)
        return encode_png(byte_planes(value.astype(np.uint16)))


def packed_confidence(confidence: FloatMap) -> bytes:
    """The grey PNG of a confidence map: value / CONFIDENCE_LEVELS, shape (H, W)."""
    value = np.rint(np.clip(confidence, 0, 1) * CONFIDENCE_LEVELS)
    return encode_png(value.astype(np.uint8))


def packed_photo(rgb: ColorImage, long_side_px: int) -> bytes:
    """The JPEG of a photo with a bounded long side."""
    if max(rgb.shape[:2]) > long_side_px:
        rgb = area_resized(rgb, fitted_size(rgb.shape, long_side_px))
    memory = io.BytesIO()
    Image.fromarray(rgb).save(
        memory, format="JPEG", quality=_JPEG_QUALITY, optimize=True, progressive=True
    )
    return memory.getvalue()


def byte_planes(values: npt.NDArray[np.uint16]) -> npt.NDArray[np.uint8]:
    """High bytes above low bytes: shape (H, W) becomes (2 H, W)."""
    return np.vstack([values >> 8, values & 255]).astype(np.uint8)
