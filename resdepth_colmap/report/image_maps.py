"""The maps of one image in the report, and their reduced size."""

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.evaluation.metrics.depth_metrics import DepthMetrics, depth_metrics
from resdepth_colmap.geometry.resize import nearest_resized
from resdepth_colmap.io.colmap.depth_map import read_depth_map
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.images import read_rgb
from resdepth_colmap.pipeline.initial_map import map_path
from resdepth_colmap.pipeline.masks import masked_depth
from resdepth_colmap.scene import ColorImage, DepthMap, FloatMap


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class ImageMaps:
    """Photo and maps of one image; the maps have one size, the photo may differ.

    Attributes:
        name: Image name.
        rgb: The photo, shape (h, w, 3).
        before: Initial depth, shape (H, W), in workspace units; 0 = no depth.
        after: Refined depth, likewise.
        confidence: In 0..1, shape (H, W); None without.
        truth: True depth, shape (H, W), 0 = unknown; None without ground truth.
    """

    name: str
    rgb: ColorImage
    before: DepthMap
    after: DepthMap
    confidence: FloatMap | None = None
    truth: DepthMap | None = None

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
        height_px, width_px = smaller_size(self.before.shape, num_pixels)
        size = (width_px, height_px)
        return dataclasses.replace(
            self,
            before=nearest_resized(self.before, size),
            after=nearest_resized(self.after, size),
            confidence=_resized_or_none(self.confidence, size),
            truth=_resized_or_none(self.truth, size),
        )


class ImageErrors(NamedTuple):
    """Errors of the depth of one image, before and after the refinement."""

    name: str
    before: DepthMetrics
    after: DepthMetrics


def image_errors(
    output: OutputWorkspace, kinds: Mapping[str, str]
) -> list[ImageErrors]:
    """The errors of the images with ground truth.

    Args:
        output: Has the refined maps; its source has `ground_truth/`.
        kinds: The kind of the initial map, by image name.

    Raises:
        WorkspaceError: If a file is missing or broken, or two maps differ in size.
    """
    errors = (load_maps(output, name, kind).errors for name, kind in kinds.items())
    return [it for it in errors if it is not None]


def load_maps(output: OutputWorkspace, name: str, kind: str) -> ImageMaps:
    """Read the maps of one image, without what its mask leaves out.

    Args:
        output: Has the refined maps; its source the photo, the initial map and maybe
            ground truth, which is resized to the maps.
        name: Image name.
        kind: The kind of the initial map.

    Raises:
        WorkspaceError: If a file is missing or broken, or two maps differ in size.
    """
    source = output.source
    after_path = output.depth_map_path(name)
    after = masked_depth(source.masks, name, read_depth_map(after_path))
    before = read_depth_map(map_path(source, name, kind))
    before = masked_depth(source.masks, name, before)
    _check_size(after_path, after, "the initial map", before)
    confidence_path = output.confidence_map_path(name)
    confidence = _read_if_present(confidence_path)
    if confidence is not None:
        _check_size(confidence_path, confidence, "the depth map", after)
    truth = _read_if_present(source.truth_path(name))
    if truth is not None:
        truth = nearest_resized(truth, (after.shape[1], after.shape[0]))
        truth = masked_depth(source.masks, name, truth)
    return ImageMaps(
        name=name,
        rgb=read_rgb(source.image_path(name)),
        before=before,
        after=after,
        confidence=confidence,
        truth=truth,
    )


def smaller_size(shape: tuple[int, ...], num_pixels: float) -> tuple[int, int]:
    """Height and width of at most `num_pixels` pixels and at least 1 x 1."""
    height_px, width_px = shape[:2]
    scale = min(1.0, math.sqrt(num_pixels / (height_px * width_px)))
    return max(1, math.floor(height_px * scale)), max(1, math.floor(width_px * scale))


def _resized_or_none(
    values: FloatMap | None, size_px: tuple[int, int]
) -> FloatMap | None:
    return None if values is None else nearest_resized(values, size_px)


def _read_if_present(path: Path) -> FloatMap | None:
    return read_depth_map(path) if path.is_file() else None


def _check_size(path: Path, values: FloatMap, other_name: str, other: FloatMap) -> None:
    if values.shape != other.shape:
        sizes = [f"{it.shape[1]} x {it.shape[0]}" for it in (values, other)]
        raise WorkspaceError(
            f"{path}: {sizes[0]} px, but {other_name} has {sizes[1]}; refine it again "
            "with --overwrite."
        )
