"""The maps of one image as the report needs them, and the same made smaller."""

import dataclasses
import math

import numpy as np
import numpy.typing as npt

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.geometry.resize import nearest_resized
from resdepth_colmap.io.colmap.depth_map import read_depth_map
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.images import read_rgb
from resdepth_colmap.pipeline.initial_map import map_path
from resdepth_colmap.scene import ColorImage, DepthMap, FloatMap


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class ImageMaps:
    """What is known of one image; all maps have one size, the photo may be larger.

    Attributes:
        name: Image name.
        rgb: The photo, shape (h, w, 3).
        before: Initial depth, shape (H, W), in workspace units; 0 = no depth.
        after: Refined depth, likewise.
        confidence: In 0..1, shape (H, W); None where the network gave none.
        truth: True depth, shape (H, W), 0 = not known; None where it is not known.
    """

    name: str
    rgb: ColorImage
    before: DepthMap
    after: DepthMap
    confidence: FloatMap | None = None
    truth: DepthMap | None = None

    def sampled(self, num_pixels: float) -> "ImageMaps":
        """The maps with at most so many pixels; each is one of the full map's."""
        height_px, width_px = smaller_size(self.before.shape, num_pixels)
        size = (width_px, height_px)
        return dataclasses.replace(
            self,
            before=nearest_resized(self.before, size),
            after=nearest_resized(self.after, size),
            confidence=_resized_or_none(self.confidence, size),
            truth=_resized_or_none(self.truth, size),
        )


def load_maps(output: OutputWorkspace, name: str, kind: str) -> ImageMaps:
    """Read the maps of one image.

    Args:
        output: Where the refined maps are; its source has photo, initial map and, where
            it is known, the truth (taken at the size of the maps).
        name: Image name.
        kind: The kind of map that was refined.

    Raises:
        WorkspaceError: If a file is missing or broken, or two maps differ in size.
    """
    source = output.source
    after_path = output.depth_map_path(name)
    after = read_depth_map(after_path)
    before_path = map_path(source, name, kind)
    before = read_depth_map(before_path)
    if before.shape != after.shape:
        raise WorkspaceError(
            f"{after_path}: {_size(after)} px, but the map that it was refined from "
            f"has {_size(before)}; refine it again with --overwrite."
        )
    confidence = None
    confidence_path = output.confidence_map_path(name)
    if confidence_path.is_file():
        confidence = read_depth_map(confidence_path)  # the same format
        if confidence.shape != after.shape:
            raise WorkspaceError(
                f"{confidence_path}: {_size(confidence)} px, but the depth map has "
                f"{_size(after)}; refine it again with --overwrite."
            )
    truth = None
    truth_path = source.truth_path(name)
    if truth_path.is_file():
        truth = nearest_resized(read_depth_map(truth_path), after.shape[::-1])
    return ImageMaps(
        name=name,
        rgb=read_rgb(source.image_path(name)),
        before=before,
        after=after,
        confidence=confidence,
        truth=truth,
    )


def smaller_size(shape: tuple[int, ...], num_pixels: float) -> tuple[int, int]:
    """Height and width of that form with at most so many pixels, at least 1 x 1."""
    height_px, width_px = shape[:2]
    scale = min(1.0, math.sqrt(num_pixels / (height_px * width_px)))
    return max(1, math.floor(height_px * scale)), max(1, math.floor(width_px * scale))


def _resized_or_none(
    values: FloatMap | None, size_px: tuple[int, int]
) -> FloatMap | None:
    return None if values is None else nearest_resized(values, size_px)


def _size(values: npt.NDArray[np.float32]) -> str:
    return f"{values.shape[1]} x {values.shape[0]}"
