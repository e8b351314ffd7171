"""Depth maps to points, and points to pixels; numpy, double precision.

All pixels are index coordinates, all K those of `pixels.index_K`.
"""

import numpy as np
import numpy.typing as npt

from resdepth_colmap.scene import FloatMap, Matrix


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


def transform(target_from_source: Matrix, xyz_in_source: Matrix) -> Matrix:
    """Points in another frame.

    Args:
        target_from_source: Pose, shape (3, 4).
        xyz_in_source: Points, shape (..., 3).

    Returns:
        Points, shape (..., 3), float64.
    """
    rotation, translation = target_from_source[:, :3], target_from_source[:, 3]
    return np.asarray(xyz_in_source @ rotation.T + translation, dtype=np.float64)


def project(xyz_in_cam: Matrix, K: Matrix) -> tuple[Matrix, Matrix]:
    """The pixels that see points.

    Args:
        xyz_in_cam: Points in the camera frame, shape (..., 3).
        K: Shape (3, 3).

    Returns:
        Pixels, shape (..., 2), and depths, shape (...), both float64. A pixel means
        something only where the depth is > 0.
    """
    z = xyz_in_cam[..., 2]
    safe = np.where(z != 0, z, 1.0)
    homogeneous = xyz_in_cam @ K.T
    return homogeneous[..., :2] / safe[..., None], z
