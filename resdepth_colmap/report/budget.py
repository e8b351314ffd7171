"""How large pictures and cloud may be, so that the page stays under its limit."""

import dataclasses
from typing import Self

MOST_BYTES = 10_000_000
"""The page in all."""

MOST_IMAGES = 300
"""Images that are shown; of more, evenly chosen ones."""

_MOST_MAP_PIXELS = 640 * 480.0
_FEW_IMAGES = 40
_SAFETY = 0.93
_LEAST_SHRINKING = 0.9
_PHOTO_SIDES = (1280, 1.6)  # px; of the map's long side


@dataclasses.dataclass(frozen=True, kw_only=True)
class Budget:
    """Sizes of what is shown.

    Attributes:
        map_pixels: Pixels of each map, at most.
        depth_step: Relative step of depth values.
        num_points: Points of each cloud, at most.
    """

    map_pixels: float
    depth_step: float
    num_points: int

    @classmethod
    def of(cls, num_images: int) -> Self:
        """What a page of so many images may have at best; few have finer values."""
        is_small = num_images <= _FEW_IMAGES
        return cls(
            map_pixels=_MOST_MAP_PIXELS,
            depth_step=0.0005 if is_small else 0.002,
            num_points=130_000 if is_small else 70_000,
        )

    def shrunk(self, num_bytes: float, available: float) -> "Budget":
        """A budget by which pictures of so many bytes would fit into those available.

        A small map needs more bytes a pixel than a large one; the safety margin covers
        the step of one trial, not of many.
        """
        factor = min(_LEAST_SHRINKING, _SAFETY * available / max(num_bytes, 1.0))
        return dataclasses.replace(self, map_pixels=self.map_pixels * max(factor, 1e-3))

    def photo_side_px(self, map_shape: tuple[int, ...]) -> int:
        """Long side of the photo that goes with a map."""
        most_px, ratio = _PHOTO_SIDES
        return int(min(most_px, max(64.0, ratio * max(map_shape[:2]))))
