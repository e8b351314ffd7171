"""What several depth maps agree on, as one cloud: the mathematics of the fusion.

Every pixel with a depth is lifted into space and looked for in the neighbouring views.
A neighbour agrees if its own depth there says the same: within a relative error of
depth, within some pixels when its point is projected back, and within an angle of the
normals. These are the three tests of COLMAP's `stereo_fusion` (Schoenberger et al.,
ECCV 2016, section 4.4); unlike it, we count views, not pixels, and need no sparse
points to know which views are neighbours.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from resdepth_colmap.config import FuseConfig
from resdepth_colmap.geometry.projection import (
    lift,
    look_up,
    pixel_xy,
    project,
    transform,
)
from resdepth_colmap.io.point_cloud import PointCloud
from resdepth_colmap.pipeline.fuse.views import Flags, FuseView, Indices
from resdepth_colmap.scene import FloatMap, NormalMap, cam_from_cam

_PIXELS_AT_ONCE = 1 << 19  # bounds the memory of what is computed for each pixel


@dataclasses.dataclass(frozen=True, kw_only=True)
class FuseStatistics:
    """What became of the pixels.

    Each pixel with a trusted depth is counted under exactly one of the last five.

    Attributes:
        num_views: Views with maps.
        num_views_needed: Views that had to agree, `min_num_views` or all there are.
        num_pixels: Pixels with a depth of sufficient confidence, over all views.
        num_points: Pixels that became points.
        num_explained: Pixels that a point of an earlier view stands for.
        num_unseen: Pixels that too few neighbours have any depth for.
        num_depth_disagrees: Pixels whose depth too few neighbours confirm.
        num_normal_disagrees: Pixels that fail by the normals alone.
    """

    num_views: int
    num_views_needed: int
    num_pixels: int = 0
    num_points: int = 0
    num_explained: int = 0
    num_unseen: int = 0
    num_depth_disagrees: int = 0
    num_normal_disagrees: int = 0

    def plus(self, **counts: int) -> Self:
        """The same with these counts added."""
        sums = {name: getattr(self, name) + count for name, count in counts.items()}
        return dataclasses.replace(self, **sums)


class Consistent(NamedTuple):
    """A cloud of agreeing pixels, and what became of the others."""

    cloud: PointCloud
    statistics: FuseStatistics


def fuse_views(
    views: Sequence[FuseView],
    neighbours: Sequence[Sequence[int]],
    config: FuseConfig,
    on_view: Callable[[float], None] | None = None,
) -> Consistent:
    """Fuse what the views agree on.

    A point is the mean of the points of all views that agree on it, with their mean
    normal and the colour of the view it was first met in. A pixel that stands for a
    point of an earlier view makes no second one. Where there are fewer views than
    `config.min_num_views`, all of them have to agree.

    Args:
        views: The maps; a lazy sequence may load them when asked for (each view is
            asked for once, and once more for each view it is a neighbour of).
        neighbours: Of each view the indices of those it is compared with.
        config: Thresholds; `fuser`, `voxel_size` and `remove_outliers` are not used.
        on_view: Called with 1 after each view.

    Returns:
        The cloud in world coordinates, which may be empty, and the statistics.
    """
    needed = min(config.min_num_views, len(views))
    statistics = FuseStatistics(num_views=len(views), num_views_needed=needed)
    explained = _Explained(len(views))
    parts: list[_Part] = []
    for index in range(len(views)):
        reference = views[index]
        present = np.flatnonzero(reference.depth > 0)
        present = present[reference.is_trusted(present, config.min_confidence)]
        pending = present[~explained.of(index, reference.depth.size)[present]]
        statistics = statistics.plus(
            num_pixels=present.size, num_explained=present.size - pending.size
        )
        for start in range(0, pending.size, _PIXELS_AT_ONCE):
            chunk = _Chunk(reference, pending[start : start + _PIXELS_AT_ONCE], config)
            for other in neighbours[index]:
                chunk.compare(other, views[other])
            kept = chunk.num_agreeing >= needed
            for other, pixels in chunk.pixels_of_agreeing(kept):
                explained.add(other, views[other].depth.size, pixels)
            parts.append(chunk.part(kept))
            statistics = statistics.plus(**chunk.counts(kept, needed))
        if on_view:
            on_view(1.0)
    return Consistent(_cloud(parts), statistics)


class _Part(NamedTuple):
    xyz: npt.NDArray[np.float64]
    normals: npt.NDArray[np.float32]
    rgb: npt.NDArray[np.uint8]


class _Chunk:
    """Some pixels of a reference view, and who agrees with them.

    All is computed in the reference's camera frame: single precision is enough there,
    however far from the world's origin the scene lies.
    """

    def __init__(
        self, reference: FuseView, pixels: Indices, config: FuseConfig
    ) -> None:
        self.reference = reference
        self.pixels = pixels
        self.config = config
        self.xy = pixel_xy(pixels, reference.depth.shape[1])
        self.xyz = lift(pixels, reference.depth, reference.K)
        self.normals = reference.normals.reshape(-1, 3)[pixels]
        self.sum_xyz: FloatMap = self.xyz.copy()
        self.sum_normals = self.normals.copy()
        self.num_seen = np.ones(pixels.size, np.int32)
        self.num_depth_agrees = np.ones(pixels.size, np.int32)
        self.num_agreeing = np.ones(pixels.size, np.int32)
        self._agreeing: list[tuple[int, Indices, Indices]] = []

    def compare(self, index: int, other: FuseView) -> None:
        """Look for the pixels in another view."""
        other_from_here = cam_from_cam(other, self.reference).astype(np.float32)
        seen, there = self._look_up(other, other_from_here)
        self.num_seen[seen] += 1
        xyz = lift(there, other.depth, other.K)
        depth = xyz[:, 2]
        z_expected = self.xyz[seen] @ other_from_here[2, :3] + other_from_here[2, 3]
        agrees = np.abs(z_expected - depth) <= self.config.max_depth_error * depth
        rotation = other_from_here[:, :3]
        back = np.asarray((xyz - other_from_here[:, 3]) @ rotation, np.float32)
        agrees &= self._reprojects(seen, back)
        seen, there, back = seen[agrees], there[agrees], back[agrees]
        self.num_depth_agrees[seen] += 1
        normals = other.normals.reshape(-1, 3)[there] @ rotation
        agrees = self._normals_agree(self.normals[seen], normals)
        seen, there = seen[agrees], there[agrees]
        self.num_agreeing[seen] += 1
        self.sum_xyz[seen] += back[agrees]
        self.sum_normals[seen] += normals[agrees]
        self._agreeing.append((index, seen, there))

    def pixels_of_agreeing(self, kept: Flags) -> list[tuple[int, Indices]]:
        """Of each view compared with, the pixels that agree with a kept one."""
        return [(index, there[kept[here]]) for index, here, there in self._agreeing]

    def part(self, kept: Flags) -> _Part:
        """The kept pixels as points of the world."""
        rotation = self.reference.cam_from_world[:, :3]
        mean = self.sum_xyz[kept] / self.num_agreeing[kept, np.newaxis]
        xyz = (mean - self.reference.cam_from_world[:, 3]) @ rotation
        length = np.linalg.norm(self.sum_normals[kept], axis=1, keepdims=True)
        normals = self.sum_normals[kept] / np.where(length > 0, length, 1.0)
        rgb = self.reference.rgb.reshape(-1, 3)[self.pixels[kept]]
        return _Part(xyz, (normals @ rotation).astype(np.float32), rgb)

    def counts(self, kept: Flags, needed: int) -> dict[str, int]:
        """What became of the pixels, for the statistics."""
        unseen = self.num_seen < needed
        depth_disagrees = ~unseen & (self.num_depth_agrees < needed)
        return {
            "num_points": int(kept.sum()),
            "num_unseen": int(unseen.sum()),
            "num_depth_disagrees": int(depth_disagrees.sum()),
            "num_normal_disagrees": int((~kept & ~unseen & ~depth_disagrees).sum()),
        }

    def _look_up(
        self, other: FuseView, other_from_here: FloatMap
    ) -> tuple[Indices, Indices]:
        """Which of the pixels fall on one with a depth, and on which."""
        xyz = transform(other_from_here, self.xyz)
        seen, there = look_up(xyz, other.K, other.depth.shape)
        trusted = other.is_trusted(there, self.config.min_confidence)
        return seen[trusted], there[trusted]

    def _reprojects(self, seen: Indices, back: FloatMap) -> Flags:
        xy, z = project(back, self.reference.K)
        error = ((xy - self.xy[seen]) ** 2).sum(axis=1)
        near: Flags = (z > 0) & (error <= self.config.max_reproj_error**2)
        return near

    def _normals_agree(self, first: NormalMap, second: NormalMap) -> Flags:
        cosine = (first * second).sum(axis=1)
        either_is_none = ~(first.any(axis=1) & second.any(axis=1))
        least = np.cos(np.radians(self.config.max_normal_error_deg))
        agree: Flags = (cosine >= least) | either_is_none
        return agree


class _Explained:
    """The pixels that a point stands for already, one bit each."""

    def __init__(self, num_views: int) -> None:
        self._bits: list[npt.NDArray[np.uint8] | None] = [None] * num_views

    def of(self, index: int, num_pixels: int) -> Flags:
        bits = self._bits[index]
        if bits is None:
            return np.zeros(num_pixels, np.bool_)
        return np.unpackbits(bits, count=num_pixels).view(np.bool_)

    def add(self, index: int, num_pixels: int, pixels: Indices) -> None:
        flags = self.of(index, num_pixels)
        flags[pixels] = True
        self._bits[index] = np.packbits(flags)


def _cloud(parts: Sequence[_Part]) -> PointCloud:
    if not parts:
        parts = [_Part(np.zeros((0, 3)), np.zeros((0, 3), np.float32), _NO_COLOURS)]
    points, normals, colors = zip(*parts, strict=True)
    return PointCloud(
        points=np.concatenate(points).astype(np.float32),
        normals=np.concatenate(normals),
        colors=np.concatenate(colors),
    )


_NO_COLOURS = np.zeros((0, 3), np.uint8)
