"""Sparse points of a rendered scene, as structure from motion finds them."""

import dataclasses
from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from resdepth_colmap.geometry.projection import transform
from resdepth_colmap.scene import ColorImage, DepthMap, Matrix, View
from resdepth_colmap.synthetic.textures import Rng

_SAME_SURFACE = 0.01  # relative difference of depth
_NOISE_OF_DEPTH = 0.0005
_NOISE_PX = 0.3


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class SparsePoints:
    """Points and their observations.

    Attributes:
        xyz: World coordinates, shape (N, 3), metres.
        rgb: Colours, shape (N, 3), uint8.
        visible: Whether a view sees a point, shape (V, N).
        xy: Its keypoint there, shape (V, N, 2), pixels with centres at index + 0.5.
    """

    xyz: Matrix
    rgb: npt.NDArray[np.uint8]
    visible: npt.NDArray[np.bool_]
    xy: Matrix


def sample_points(
    rng: Rng,
    views: Sequence[View],
    images: Sequence[ColorImage],
    depths: Sequence[DepthMap],
) -> SparsePoints:
    """Points at corners of the images that at least two views see.

    Args:
        rng: Source of randomness.
        views: The cameras.
        images: Their images, each (H, W, 3).
        depths: Their exact depth maps, each (H, W); 0 = none.
    """
    wanted = int(rng.integers(300, 801))
    count = 2 * wanted // len(views) + 1
    found = [
        _corners(rng, view, image, depth, count)
        for view, image, depth in zip(views, images, depths, strict=True)
    ]
    xyz, rgb = (np.concatenate(parts) for parts in zip(*found, strict=True))
    seen = [_observe(v, depth, xyz) for v, depth in zip(views, depths, strict=True)]
    visible, xy = (np.stack(parts) for parts in zip(*seen, strict=True))
    kept = np.flatnonzero(visible.sum(axis=0) >= 2)
    kept = rng.permutation(kept)[:wanted]
    noise = rng.normal(0, _NOISE_PX, (len(views), len(kept), 2))
    return SparsePoints(
        xyz=xyz[kept], rgb=rgb[kept], visible=visible[:, kept], xy=xy[:, kept] + noise
    )


def _corners(
    rng: Rng, view: View, image: ColorImage, depth: DepthMap, count: int
) -> tuple[Matrix, npt.NDArray[np.uint8]]:
    """Points of one view, drawn by their strength as corners, with their colours."""
    gray = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    strength = cv2.cornerMinEigenVal(gray, 5).ravel().astype(np.float64)
    strength = np.sqrt(np.maximum(strength, 0)) + 1e-6
    strength[depth.ravel() <= 0] = 0
    if strength.sum() == 0:
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.uint8)
    picked = rng.choice(strength.size, count, p=strength / strength.sum())
    row, column = np.divmod(picked, depth.shape[1])
    z = depth[row, column].astype(np.float64)
    camera = view.camera
    x = (column + 0.5 - camera.cx) / camera.fx * z
    y = (row + 0.5 - camera.cy) / camera.fy * z
    in_camera = np.stack([x, y, z], axis=1)
    in_camera += rng.normal(0, _NOISE_OF_DEPTH, (count, 3)) * z[:, None]
    rotation, shift = view.cam_from_world[:, :3], view.cam_from_world[:, 3]
    return (in_camera - shift) @ rotation, image[row, column]


def _observe(
    view: View, depth: DepthMap, xyz: Matrix
) -> tuple[npt.NDArray[np.bool_], Matrix]:
    """Whether a view sees the points, and their projections."""
    camera = view.camera
    in_camera = transform(view.cam_from_world, xyz)
    z = in_camera[:, 2]
    ahead = np.where(z > 1e-6, z, 1.0)
    x = camera.fx * in_camera[:, 0] / ahead + camera.cx
    y = camera.fy * in_camera[:, 1] / ahead + camera.cy
    inside = (x >= 0) & (x < camera.width_px) & (y >= 0) & (y < camera.height_px)
    column = np.clip(np.floor(x), 0, camera.width_px - 1).astype(np.int64)
    row = np.clip(np.floor(y), 0, camera.height_px - 1).astype(np.int64)
    surface = depth[row, column]
    near_surface = np.abs(surface - z) < _SAME_SURFACE * ahead
    visible = (z > 1e-6) & inside & near_surface
    return visible, np.stack([x, y], axis=1)
