"""The fused clouds and the cameras, reduced to the size of a page."""

import itertools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt
import scipy.spatial

from resdepth_colmap.geometry.pixels import CENTER_PX, index_K
from resdepth_colmap.geometry.projection import pixel_rays
from resdepth_colmap.io.png import encode_png
from resdepth_colmap.io.point_cloud import PointCloud
from resdepth_colmap.report.packing import MAX_VALUE, byte_planes
from resdepth_colmap.scene import Matrix, View

SIZE = 10.0
"""Longest side of the box of points, in page units."""

_ROBUST_PERCENT = (1.0, 99.0)
_MARGIN = 0.5  # of the robust box, on each side
_CAMERA_SIZE = 0.02  # of the box
_DECIMALS = 4

_FOV_DEG = 50.0
_ASPECT = 1.7
_LOOK_DOWN = 0.25  # of the way ahead
_LOOK_ASIDE = 0.2
_PERCENT_IN_SIGHT = 94.0
_NUM_SAMPLES = 20_000
_SPACINGS = (0.0003 * SIZE, 0.03 * SIZE)


Positions = npt.NDArray[np.float32]


class CloudBox(NamedTuple):
    """The part of space that is shown, without outliers.

    Attributes:
        center: In the world frame, shape (3,), float64.
        scale: Page units per workspace unit.
    """

    center: Matrix
    scale: float

    @classmethod
    def of(cls, *clouds: PointCloud) -> Self:
        """The box of the clouds, which have at least one point."""
        points = np.concatenate([cloud.points for cloud in clouds]).astype(np.float64)
        low, high = np.percentile(points, _ROBUST_PERCENT, axis=0)
        low, high = low - _MARGIN * (high - low), high + _MARGIN * (high - low)
        inside = points[((points >= low) & (points <= high)).all(axis=1)]
        inside = inside if len(inside) else points
        low, high = inside.min(axis=0), inside.max(axis=0)
        extent = float((high - low).max()) or 1.0
        return cls((low + high) / 2, SIZE / extent)

    def shown(self, xyz_in_world: npt.ArrayLike) -> Matrix:
        """Points in page units, relative to the centre of the box."""
        shifted = np.asarray(xyz_in_world, np.float64) - self.center
        return np.asarray(shifted * self.scale, np.float64)


class PackedCloud(NamedTuple):
    """A cloud as two PNG files.

    Attributes:
        points: Grey, shape (6, N): x high, y high, z high, x low, y low, z low;
            the box is 0..65535.
        colors: RGB, shape (1, N, 3).
        num_points: Number of points N.
    """

    points: bytes
    colors: bytes
    num_points: int


def packed_cloud(cloud: PointCloud, box: CloudBox, most: int) -> PackedCloud | None:
    """At most `most` points in the box, along a Z-order curve; None without any."""
    sample = cloud.sampled(most)
    unit = box.shown(sample.points) / SIZE + 0.5
    inside = ((unit >= 0) & (unit <= 1)).all(axis=1)
    if not inside.any():
        return None
    values = np.rint(unit[inside] * MAX_VALUE).astype(np.uint16)
    order = np.argsort(_morton(values), kind="stable")
    return PackedCloud(
        points=encode_png(byte_planes(np.ascontiguousarray(values[order].T))),
        colors=encode_png(np.ascontiguousarray(sample.colors[inside][order][None])),
        num_points=len(order),
    )


def point_spacing(cloud: PointCloud, box: CloudBox, most: int) -> float:
    """Median distance of the shown points to the nearest other, in page units."""
    shown = box.shown(cloud.sampled(most).points)
    if len(shown) < 2:
        return SIZE / 10
    some = shown[:: max(1, len(shown) // _NUM_SAMPLES)]
    distance, _ = scipy.spatial.cKDTree(shown).query(some, k=2)
    return float(np.clip(np.median(distance[:, 1]), *_SPACINGS))


def first_look(
    views: Sequence[View], points: Positions, box: CloudBox
) -> dict[str, Any]:
    """The first view of the cloud: from near the cameras, with most points in sight.

    Returns:
        "eye", "target" and "up" in page units, the vertical field of view "fov_deg" and
        the "aspect" ratio, for JSON.
    """
    poses = np.array([view.cam_from_world for view in views])
    right, down, forward = (_direction(poses[:, axis, :3]) for axis in range(3))
    direction = forward + _LOOK_DOWN * down - _LOOK_ASIDE * right
    direction /= np.linalg.norm(direction)
    shown = box.shown(points[:: max(1, len(points) // _NUM_SAMPLES)])
    target = np.median(shown, axis=0)
    side = np.cross(direction, -down)
    side /= np.linalg.norm(side)
    top = np.cross(side, direction)
    tangent = math.tan(math.radians(_FOV_DEG / 2))
    offset = shown - target
    # Distances from which a point is in sight, vertically and horizontally.
    height = np.abs(offset @ top) / tangent
    width = np.abs(offset @ side) / (tangent * _ASPECT)
    needed = np.maximum(height, width) - offset @ direction
    distance = max(float(np.percentile(needed, _PERCENT_IN_SIGHT)), 0.05 * SIZE)
    return {
        "eye": _rounded(target - distance * direction),
        "target": _rounded(target),
        "up": _rounded(-down),
        "fov_deg": _FOV_DEG,
        "aspect": _ASPECT,
    }


def camera_outline(view: View, box: CloudBox) -> list[list[float]]:
    """Apex and four corners of the pyramid of a camera, in page units."""
    camera = view.camera
    length = _CAMERA_SIZE * SIZE / box.scale
    right, bottom = camera.width_px - CENTER_PX, camera.height_px - CENTER_PX
    left = top = -CENTER_PX
    xy = [[left, top], [right, top], [right, bottom], [left, bottom]]
    corners = pixel_rays(xy, index_K(camera)) * length
    rotation, translation = view.cam_from_world[:, :3], view.cam_from_world[:, 3]
    corners_in_world = (corners - translation) @ rotation
    outline = np.vstack([view.center_in_world, corners_in_world])
    return [_rounded(point) for point in box.shown(outline)]


def _direction(directions: Matrix) -> Matrix:
    """The mean direction; the first one if they cancel out, as around an object."""
    mean = directions.mean(axis=0)
    length = float(np.linalg.norm(mean))
    return np.asarray(mean / length if length > 0.3 else directions[0], np.float64)


def _rounded(xyz: Matrix) -> list[float]:
    return [round(float(value), _DECIMALS) for value in xyz]


def _morton(values: npt.NDArray[np.uint16]) -> npt.NDArray[np.uint64]:
    """Index of each point on the Z-order curve, from the top 10 bits of x, y and z."""
    coordinates = (values >> 6).astype(np.uint64)
    code = np.zeros(len(values), np.uint64)
    for bit, axis in itertools.product(range(10), range(3)):
        digit = (coordinates[:, axis] >> np.uint64(bit)) & np.uint64(1)
        code |= digit << np.uint64(3 * bit + axis)
    return code
