"""The content of the page: facts for JSON, and blocks of pictures and clouds."""

import base64
import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from resdepth_colmap.io.point_cloud import PointCloud
from resdepth_colmap.report.budget import Budget
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

CONFIDENCE_COLORS = "viridis"


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
    """Photo and maps of one image.

    Args:
        index: Index of the image among those shown.
        maps: Its maps, of any size.
        facts: Its facts.
        budget: Sizes of the maps.
    """
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
        "confidence": CONFIDENCE_COLORS,
    }
    tables = {
        key: base64.b64encode(color_table(name).tobytes()).decode("ascii")
        for key, name in names.items()
    }
    return {
        "tables": tables,
        "errorRange": list(ERROR_RANGE),
        "confidenceLevels": CONFIDENCE_LEVELS,
    }
