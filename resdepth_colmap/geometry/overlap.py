"""The overlap of two views, from their poses alone.

A coarse grid of pixels of the reference is placed at several depths and projected into
the source: how much the views overlap at each depth, at which angle their rays meet
there, and the disparity compared with a point at infinity.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from resdepth_colmap.geometry.pixels import CENTER_PX, index_K
from resdepth_colmap.geometry.projection import pixel_rays, project, transform
from resdepth_colmap.scene import Camera, Matrix, View, cam_from_cam, projection_center

GRID_SIDE = 9


class Overlap(NamedTuple):
    """How a source sees the pixels of the reference, for D depths and P pixels.

    Attributes:
        inside: Whether the point falls into the source image, shape (D, P), bool.
        angle_deg: Angle at which the two rays meet in the point, shape (D, P).
        disparity_px: Distance in the source from where the point would be at infinity,
            shape (D, P); infinite where infinity lies behind the source.
    """

    inside: npt.NDArray[np.bool_]
    angle_deg: Matrix
    disparity_px: Matrix


def overlap(reference: View, source: View, depths: npt.ArrayLike) -> Overlap:
    """Project a grid of pixels of the reference into a source.

    Args:
        reference: The view whose pixels are taken.
        source: The view that they are projected into.
        depths: Depths in the reference, shape (D,), in units, > 0.

    Returns:
        The sightings at each depth of each of 9 x 9 pixels.
    """
    source_from_reference = cam_from_cam(source, reference)
    rays = pixel_rays(_grid(reference.camera), index_K(reference.camera))
    xyz = rays * np.asarray(depths, dtype=np.float64)[:, None, None]
    K = index_K(source.camera)
    xyz_in_source = transform(source_from_reference, xyz)
    xy, z = project(xyz_in_source, K)
    inside = (z > 0) & _in_image(xy, source.camera)
    center = projection_center(source_from_reference)
    angle_deg = _angle_deg(xyz, xyz - center)
    xy_far, z_far = project(rays @ source_from_reference[:, :3].T, K)
    shift = np.linalg.norm(xy - xy_far, axis=-1)
    disparity_px = np.where((z > 0) & (z_far > 0), shift, np.inf)
    return Overlap(inside, angle_deg, disparity_px)


def _grid(camera: Camera) -> Matrix:
    """Centres of 9 x 9 equal parts of the image, shape (81, 2)."""
    parts = (np.arange(GRID_SIDE) + 0.5) / GRID_SIDE
    x = parts * camera.width_px - CENTER_PX  # image sides to index coordinates
    y = parts * camera.height_px - CENTER_PX
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def _in_image(xy: Matrix, camera: Camera) -> npt.NDArray[np.bool_]:
    sides = np.array([camera.width_px, camera.height_px]) - CENTER_PX
    return np.asarray(((xy >= -CENTER_PX) & (xy <= sides)).all(axis=-1))


def _angle_deg(first: Matrix, second: Matrix) -> Matrix:
    lengths = np.linalg.norm(first, axis=-1) * np.linalg.norm(second, axis=-1)
    cosine = (first * second).sum(axis=-1) / np.where(lengths > 0, lengths, 1.0)
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
