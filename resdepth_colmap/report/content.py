"""The content of the page: facts for JSON, pictures and clouds, and their sizes."""

import base64
import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, Self

from resdepth_colmap.io.point_cloud import PointCloud
from resdepth_colmap.report.cloud_data import (
    SIZE,
    CloudBox,
    camera_outline,
    first_look,
    packed_cloud,
    point_spacing,
)
from resdepth_colmap.report.image_maps import ImageMaps
from resdepth_colmap.report.packing import (
    CONFIDENCE_LEVELS,
    DepthCode,
    packed_confidence,
    packed_photo,
)
from resdepth_colmap.scene import View
from resdepth_colmap.viz.colormaps import (
    DEPTH_COLORS,
    DIFFERENCE_COLORS,
    ERROR_COLORS,
    ERROR_RANGE,
    color_table,
)

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
        """A budget that shrinks pictures of `num_bytes` to the available bytes."""
        # A small map needs more bytes per pixel than a large one: hence the margin.
        factor = min(_LEAST_SHRINKING, _SAFETY * available / max(num_bytes, 1.0))
        return dataclasses.replace(self, map_pixels=self.map_pixels * max(factor, 1e-3))

    def photo_side_px(self, map_shape: tuple[int, ...]) -> int:
        """Long side of the photo of a map."""
        most_px, ratio = _PHOTO_SIDES
        return int(min(most_px, max(64.0, ratio * max(map_shape[:2]))))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Content:
    """A part of the page.

    Attributes:
        facts: Plain values for the page's JSON.
        blocks: Binary data by id.
    """

    facts: Mapping[str, Any]
    blocks: Mapping[str, bytes]

    @property
    def num_bytes(self) -> int:
        """Bytes of the blocks in the page."""
        return sum(4 * (len(block) + 2) // 3 + 60 for block in self.blocks.values())


def image_content(
    index: int, maps: ImageMaps, facts: Mapping[str, Any], budget: Budget
) -> Content:
    """Photo and maps of the image with that index among those shown."""
    small = maps.sampled(budget.map_pixels)
    code = DepthCode.of(budget.depth_step, small.before, small.after, small.truth)
    height_px, width_px = small.before.shape
    blocks = {
        "photo": packed_photo(maps.rgb, budget.photo_side_px(small.before.shape)),
        "before": code.packed(small.before),
        "after": code.packed(small.after),
    }
    if small.confidence is not None:
        blocks["confidence"] = packed_confidence(small.confidence)
    if small.truth is not None:
        blocks["truth"] = code.packed(small.truth)
    shown = {
        "mapWidth": width_px,
        "mapHeight": height_px,
        "code": {"nearest": code.nearest, "step": code.step},
        "blocks": list(blocks),
    }
    return Content(
        facts={**facts, **shown},
        blocks={f"image-{index}-{name}": block for name, block in blocks.items()},
    )


def cloud_content(
    after: PointCloud, before: PointCloud | None, views: Sequence[View], budget: Budget
) -> Content:
    """Both clouds, the cameras, and the first view."""
    clouds = {"after": after, "before": before}
    known = {name: c for name, c in clouds.items() if c is not None and len(c)}
    box = CloudBox.of(*known.values())
    facts: dict[str, Any] = {
        "size": SIZE,
        "spacing": point_spacing(after, box, budget.num_points),
        "look": first_look(views, after.points, box),
        "cameras": [camera_outline(view, box) for view in views],
        "clouds": {},
    }
    blocks = {}
    for name, cloud in known.items():
        packed = packed_cloud(cloud, box, budget.num_points)
        if packed is None:
            continue
        facts["clouds"][name] = {"shown": packed.num_points}
        blocks[f"cloud-{name}-points"] = packed.points
        blocks[f"cloud-{name}-colors"] = packed.colors
    return Content(facts=facts, blocks=blocks)


def color_tables() -> dict[str, Any]:
    """The colour maps of all pictures of this package, 256 RGB values each."""
    names = {
        "depth": DEPTH_COLORS,
        "difference": DIFFERENCE_COLORS,
        "error": ERROR_COLORS,
        "confidence": "viridis",
    }
    return {
        "tables": {
            key: base64.b64encode(color_table(name).tobytes()).decode("ascii")
            for key, name in names.items()
        },
        "errorRange": list(ERROR_RANGE),
        "confidenceLevels": CONFIDENCE_LEVELS,
    }
