"""Sizes of pictures and clouds that keep the page below its limit."""

import dataclasses
from typing import Self

MOST_BYTES = 10_000_000
"""Largest size of the page."""

MOST_IMAGES = 300
"""Largest number of images; of more, evenly spaced ones are shown."""

_MOST_MAP_PIXELS = 640 * 480.0
_FEW_IMAGES = 40
_SAFETY = 0.93
_LEAST_SHRINKING = 0.9
_PHOTO_SIDES = (1280, 1.6)  # in pixels; relative to the long side of the map


@dataclasses.dataclass(frozen=True, kw_only=True)
class Budget:
    """Sizes of maps and clouds in the page.

    Attributes:
        map_pixels: Largest number of pixels of a map.
        depth_step: Relative step of depth values.
        num_points: Largest number of points of a cloud.
    """

    map_pixels: float
    depth_step: float
    num_points: int

    @classmethod
    def of(cls, num_images: int) -> Self:
        """The largest sizes for a number of images; finer values for few images."""
        is_small = num_images <= _FEW_IMAGES
        return cls(
            map_pixels=_MOST_MAP_PIXELS,
            depth_step=0.0005 if is_small else 0.002,
            num_points=130_000 if is_small else 70_000,
        )

    def shrunk(self, num_bytes: float, available: float) -> "Budget":
        """A budget that shrinks pictures of `num_bytes` to the available bytes.

        A small map needs more bytes per pixel than a large one; the safety margin
        covers one such step.
        """
        factor = min(_LEAST_SHRINKING, _SAFETY * available / max(num_bytes, 1.0))
        return dataclasses.replace(self, map_pixels=self.map_pixels * max(factor, 1e-3))

    def photo_side_px(self, map_shape: tuple[int, ...]) -> int:
        """Long side of the photo of a map."""
        most_px, ratio = _PHOTO_SIDES
        return int(min(most_px, max(64.0, ratio * max(map_shape[:2]))))
