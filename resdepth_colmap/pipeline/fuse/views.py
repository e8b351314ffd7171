"""The maps of the views to fuse, read when they are asked for."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import overload

import numpy as np
import numpy.typing as npt

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.geometry.normals import normals_from_depth
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.geometry.resize import area_resized
from resdepth_colmap.io.colmap.depth_map import read_depth_map
from resdepth_colmap.io.colmap.masks import Masks
from resdepth_colmap.io.colmap.normal_map import read_normal_map
from resdepth_colmap.io.images import read_rgb
from resdepth_colmap.pipeline.masks import masked_depth
from resdepth_colmap.pipeline.recent_cache import RecentCache
from resdepth_colmap.scene import (
    ColorImage,
    DepthMap,
    FloatMap,
    Matrix,
    NormalMap,
    View,
)

Indices = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class FuseView:
    """The maps of one view.

    Attributes:
        name: Image name.
        K: K for index coordinates (`geometry.pixels.index_K`) of the map, (3, 3).
        cam_from_world: Pose, shape (3, 4).
        depth: Shape (H, W), in workspace units; 0 = no depth.
        normals: Camera frame, shape (H, W, 3); (0, 0, 0) = none, which agrees with any.
        rgb: Colours, shape (H, W, 3).
        confidence: In 0..1, shape (H, W); None = 1 everywhere.
    """

    name: str
    K: Matrix
    cam_from_world: Matrix
    depth: DepthMap
    normals: NormalMap
    rgb: ColorImage
    confidence: FloatMap | None = None

    @property
    def nbytes(self) -> int:
        """Memory of the maps."""
        maps = (self.depth, self.normals, self.rgb, self.confidence)
        return sum(values.nbytes for values in maps if values is not None)

    def is_trusted(self, pixels: Indices, min_confidence: float) -> Flags:
        """Whether these pixels have a depth, and at least that confidence."""
        trusted: Flags = self.depth.ravel()[pixels] > 0
        if self.confidence is not None and min_confidence > 0:
            trusted &= self.confidence.ravel()[pixels] >= min_confidence
        return trusted


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class MapFiles:
    """Where the maps of one view lie.

    Attributes:
        view: The view.
        image_path: Its image.
        depth_path: Its depth map, which may be smaller than the image.
        depth_scale: What its depths are multiplied with.
        normal_path: Its normal map; None, or no file there = computed from the depth.
        confidence_path: Its confidence; None, or no file there = 1 everywhere.
        masks: Those of the images: where the view's mask is 0, there is no depth.
    """

    view: View
    image_path: Path
    depth_path: Path
    depth_scale: float = 1.0
    normal_path: Path | None = None
    confidence_path: Path | None = None
    masks: Masks = Masks()  # noqa: RUF009 (it is frozen)

    def read_depth(self) -> DepthMap:
        """Read the depth map, scaled, with 0 where the mask is 0.

        Raises:
            WorkspaceError: If a file is broken, or the mask of another shape.
        """
        depth = read_depth_map(self.depth_path)
        if self.depth_scale != 1.0:
            depth = np.float32(self.depth_scale) * depth
        return masked_depth(self.masks, self.view.name, depth)

    def read(self) -> FuseView:
        """Read them all.

        Raises:
            WorkspaceError: If a file is broken, or two maps differ in size.
        """
        depth = self.read_depth()
        height_px, width_px = depth.shape
        K = index_K(self.view.camera.resized(width_px, height_px))
        return FuseView(
            name=self.view.name,
            K=K,
            cam_from_world=self.view.cam_from_world,
            depth=depth,
            normals=self._normals(depth, K),
            rgb=area_resized(read_rgb(self.image_path), (width_px, height_px)),
            confidence=self._confidence(depth),
        )

    def _normals(self, depth: DepthMap, K: Matrix) -> NormalMap:
        if self.normal_path is None or not self.normal_path.is_file():
            return normals_from_depth(depth, K)
        normals = read_normal_map(self.normal_path)
        _check_size(self.normal_path, normals.shape, self.depth_path, depth.shape)
        return normals

    def _confidence(self, depth: DepthMap) -> FloatMap | None:
        path = self.confidence_path
        if path is None or not path.is_file():
            return None
        confidence = read_depth_map(path)  # same format, same meaning of 0
        _check_size(path, confidence.shape, self.depth_path, depth.shape)
        return confidence


class LazyViews(Sequence[FuseView]):
    """Views that are read when asked for; the latest stay in memory."""

    def __init__(self, files: Sequence[MapFiles], max_num_bytes: int) -> None:
        """Keep views up to that many bytes in all, but at least one."""
        self._files = files
        self._cache = RecentCache(max_num_bytes)

    def __len__(self) -> int:
        """The number of views, read or not."""
        return len(self._files)

    @overload
    def __getitem__(self, index: int) -> FuseView: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[FuseView]: ...
    def __getitem__(self, index: int | slice) -> FuseView | Sequence[FuseView]:
        """A view; WorkspaceError if it cannot be read."""
        if isinstance(index, slice):
            return LazyViews(self._files[index], self._cache.max_num_bytes)
        return self._cache.get(index, self._files[index].read)


def _check_size(
    path: Path, shape: tuple[int, ...], depth_path: Path, expected: tuple[int, ...]
) -> None:
    if shape[:2] != expected:
        raise WorkspaceError(
            f"{path}: {shape[1]} x {shape[0]} px but {depth_path.name} has "
            f"{expected[1]} x {expected[0]}; delete both and compute them again."
        )
