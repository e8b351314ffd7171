"""Depth maps to points, and points to pixels, in numpy.

All pixels are index coordinates, all K those of `pixels.index_K`: without skew.
"""

from typing import NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from resdepth_colmap.scene import FloatMap, Matrix

Float = TypeVar("Float", np.float32, np.float64)
Indices = npt.NDArray[np.int64]


class Landing(NamedTuple):
    """Which of some points fall on a pixel of a map, and on which one.

    Attributes:
        points: Indices of these points, ascending, shape (M,).
        pixels: Flat index of the pixel that each falls on, shape (M,).
    """

    points: Indices
    pixels: Indices


def pixel_rays(xy_index: npt.ArrayLike, K: Matrix) -> Matrix:
    """Rays through pixels, in the camera frame, with z = 1.

    Args:
        xy_index: Pixels, shape (..., 2).
        K: Shape (3, 3).

    Returns:
        Shape (..., 3), float64. A ray times a depth is the point at that depth.
    """
    xy = np.asarray(xy_index, dtype=np.float64)
    homogeneous = np.concatenate([xy, np.ones_like(xy[..., :1])], axis=-1)
    return np.asarray(homogeneous @ np.linalg.inv(K).T, dtype=np.float64)


def back_project(depth: FloatMap, K: Matrix) -> Matrix:
    """The point that each pixel of a depth map sees.

    Args:
        depth: Shape (H, W), in units; 0 = no depth.
        K: Shape (3, 3).

    Returns:
        Points in the camera frame, shape (H, W, 3), float64, in units; the origin where
        there is no depth.
    """
    height_px, width_px = depth.shape
    x, y = np.meshgrid(np.arange(width_px), np.arange(height_px))
    return pixel_rays(np.stack([x, y], axis=-1), K) * depth[..., None]


def pixel_xy(pixels: Indices, width_px: int) -> FloatMap:
    """Column and row of flat pixel indices, shape (N, 2), float32."""
    rows, columns = np.divmod(pixels, width_px)
    return np.stack([columns, rows], axis=1).astype(np.float32)


def lift(pixels: Indices, depth: FloatMap, K: Matrix) -> FloatMap:
    """The points that some pixels of a depth map see, in single precision.

    Args:
        pixels: Flat indices of pixels with a depth, shape (N,).
        depth: Shape (H, W), in units.
        K: Shape (3, 3).

    Returns:
        Points in the camera frame, shape (N, 3), float32, in units.
    """
    xy, z = pixel_xy(pixels, depth.shape[1]), depth.ravel()[pixels]
    x = (xy[:, 0] - np.float32(K[0, 2])) / np.float32(K[0, 0])
    y = (xy[:, 1] - np.float32(K[1, 2])) / np.float32(K[1, 1])
    return np.stack([x * z, y * z, z], axis=1)


def transform(
    target_from_source: npt.NDArray[Float],
    xyz_in_source: npt.NDArray[np.float32] | npt.NDArray[np.float64],
) -> npt.NDArray[Float]:
    """Points in another frame.

    Args:
        target_from_source: Pose, shape (3, 4).
        xyz_in_source: Points, shape (..., 3).

    Returns:
        Points, shape (..., 3), in the precision of the pose.
    """
    rotation, translation = target_from_source[:, :3], target_from_source[:, 3]
    return np.asarray(
        xyz_in_source @ rotation.T + translation, dtype=target_from_source.dtype
    )


def project(
    xyz_in_cam: npt.NDArray[Float], K: Matrix
) -> tuple[npt.NDArray[Float], npt.NDArray[Float]]:
    """The pixels that see points.

    Args:
        xyz_in_cam: Points in the camera frame, shape (..., 3).
        K: Shape (3, 3).

    Returns:
        Pixels, shape (..., 2), and depths, shape (...), in the precision of the points.
        A pixel means something only where the depth is > 0.
    """
    number = xyz_in_cam.dtype.type
    x, y, z = (xyz_in_cam[..., axis] for axis in range(3))
    safe = np.where(z > 0, z, number(1))
    column = x / safe * number(K[0, 0]) + number(K[0, 2])
    row = y / safe * number(K[1, 1]) + number(K[1, 2])
    return np.stack([column, row], axis=-1), z


def look_up(
    xyz_in_cam: npt.NDArray[Float], K: Matrix, shape: tuple[int, ...]
) -> Landing:
    """Which points a view's map has a pixel for, and which pixel that is.

    Args:
        xyz_in_cam: Points in the camera frame of the view, shape (N, 3).
        K: Shape (3, 3).
        shape: Height and width of the map.

    Returns:
        The points in front of the camera that project into the map, each with the
        pixel whose centre is nearest.
    """
    xy, z = project(xyz_in_cam, K)
    height_px, width_px = shape
    column, row = np.rint(xy[:, 0]), np.rint(xy[:, 1])
    inside = (z > 0) & (column >= 0) & (row >= 0)
    inside &= (column < width_px) & (row < height_px)
    points = np.flatnonzero(inside)
    pixels = row[points].astype(np.int64) * width_px + column[points].astype(np.int64)
    return Landing(points, pixels)
