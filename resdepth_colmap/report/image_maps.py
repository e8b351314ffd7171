"""The maps of one image in the report, and their reduced size."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from resdepth_colmap.evaluation.metrics.depth_metrics import DepthMetrics, depth_metrics
from resdepth_colmap.geometry.resize import nearest_resized
from resdepth_colmap.io.colmap.maps import read_depth_map
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.pipeline.pictures import check_equal_size, read_before_after
from resdepth_colmap.scene import FloatMap
from resdepth_colmap.viz.strips import BeforeAfter


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class ImageMaps(BeforeAfter):
    """Photo and maps of one image; the maps have one size, the photo may differ.

    Attributes:
        confidence: In 0..1, shape (H, W); None without.
    """

    confidence: FloatMap | None = None

    @property
    def errors(self) -> "ImageErrors | None":
        """Errors against ground truth, without a limit; None without ground truth."""
        if self.truth is None:
            return None
        before, after = (
            depth_metrics(depth, self.truth, max_residual=None)
            for depth in (self.before, self.after)
        )
        return ImageErrors(self.name, before, after)

    def sampled(self, num_pixels: float) -> "ImageMaps":
        """The maps with at most `num_pixels` pixels, sampled at the nearest pixels."""
        size_px = smaller_size(self.before.shape, num_pixels)[::-1]
        maps: dict[str, Any] = {
            name: nearest_resized(values, size_px)
            for name in ("before", "after", "confidence", "truth")
            if (values := getattr(self, name)) is not None
        }
        return dataclasses.replace(self, **maps)


class ImageErrors(NamedTuple):
    """Errors of the depth of one image, before and after the refinement."""

    name: str
    before: DepthMetrics
    after: DepthMetrics


def image_errors(
    output: OutputWorkspace, kinds: Mapping[str, str]
) -> list[ImageErrors]:
    """The errors of images with ground truth, by the kind of each one's initial map."""
    errors = (load_maps(output, name, kind).errors for name, kind in kinds.items())
    return [it for it in errors if it is not None]


def load_maps(output: OutputWorkspace, name: str, kind: str) -> ImageMaps:
    """Read photo and maps of an image; see `read_before_after`.

    Raises:
        WorkspaceError: If a file is missing or broken, or two maps differ in size.
    """
    shown = read_before_after(output, name, kind)
    path, confidence = output.confidence_map_path(name), None
    if path.is_file():
        confidence = read_depth_map(path)
        check_equal_size(path, confidence, "the depth map", shown.after)
    return ImageMaps(**vars(shown), confidence=confidence)


def smaller_size(shape: tuple[int, ...], num_pixels: float) -> tuple[int, int]:
    """Height and width of at most `num_pixels` pixels and at least 1 x 1."""
    height_px, width_px = shape[:2]
    scale = min(1.0, math.sqrt(num_pixels / (height_px * width_px)))
    return max(1, math.floor(height_px * scale)), max(1, math.floor(width_px * scale))
