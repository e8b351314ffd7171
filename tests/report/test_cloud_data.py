"""Laws of the packed cloud, the cameras and the first look."""

import io

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image
from planes import plane_views, points_on_plane

from resdepth_colmap.io.point_cloud import PointCloud
from resdepth_colmap.report.cloud_data import (
    SIZE,
    CloudBox,
    PackedCloud,
    camera_outline,
    first_look,
    packed_cloud,
)


def cloud_of(points: npt.ArrayLike) -> PointCloud:
    """Points whose colours tell them apart."""
    values = np.asarray(points, np.float32)
    number = np.arange(len(values))
    colors = np.stack([number % 256, number // 256, 0 * number], axis=1)
    return PointCloud(
        points=values, colors=colors.astype(np.uint8), normals=np.zeros_like(values)
    )


def decoded(
    packed: PackedCloud,
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Points in page units, and the numbers that their colours tell."""
    planes = np.asarray(Image.open(io.BytesIO(packed.points))).astype(np.float64)
    unit = (256 * planes[:3] + planes[3:]) / 65535
    colors = np.asarray(Image.open(io.BytesIO(packed.colors))).astype(np.int64)[0]
    return (unit.T - 0.5) * SIZE, colors[:, 0] + 256 * colors[:, 1]


def test_points_come_back_at_their_places_with_their_colours() -> None:
    points = np.random.default_rng(0).normal([100, -50, 7], 3, (2000, 3))
    cloud = cloud_of(points)
    box = CloudBox.of(cloud)
    packed = packed_cloud(cloud, box, 10_000)
    assert packed is not None
    shown, number = decoded(packed)
    assert packed.num_points == len(np.unique(number)) > 1900
    expected = box.shown(cloud.points[number])
    np.testing.assert_allclose(shown, expected, atol=SIZE / 65535)


def test_a_few_points_far_away_do_not_make_the_rest_small() -> None:
    near = np.random.default_rng(0).uniform(-1, 1, (5000, 3))
    cloud = cloud_of(np.vstack([near, [[1000, 0, 0], [0, -5000, 0]]]))
    packed = packed_cloud(cloud, CloudBox.of(cloud), 10_000)
    assert packed is not None
    shown, number = decoded(packed)
    assert np.ptp(shown, axis=0).min() > 0.9 * SIZE
    assert number.max() < 5000


def test_a_cloud_is_thinned_to_what_is_asked_for() -> None:
    cloud = cloud_of(np.random.default_rng(0).normal(0, 1, (3000, 3)))
    packed = packed_cloud(cloud, CloudBox.of(cloud), 500)
    assert packed is not None and 450 < packed.num_points <= 500


@pytest.mark.parametrize("points", [[[1, 2, 3]], [[1, 2, 3], [1, 2, 3]]])
def test_a_cloud_of_one_place_is_shown(points: list[list[float]]) -> None:
    cloud = cloud_of(points)
    assert packed_cloud(cloud, CloudBox.of(cloud), 10) is not None


def test_the_first_look_has_most_points_in_sight_and_the_right_way_up() -> None:
    views = [plane.view for plane in plane_views()]
    cloud = cloud_of(points_on_plane(3000))
    box = CloudBox.of(cloud)
    look = first_look(views, cloud.points, box)
    eye, target, up = (np.array(look[key]) for key in ("eye", "target", "up"))
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, up) / np.linalg.norm(np.cross(forward, up))
    offset = box.shown(cloud.points) - eye
    depth = offset @ forward
    tangent = np.tan(np.radians(look["fov_deg"] / 2))
    inside = np.abs(offset @ np.cross(right, forward)) <= tangent * depth
    inside &= np.abs(offset @ right) <= tangent * look["aspect"] * depth
    assert inside.mean() > 0.85
    assert up @ [0, -1, 0] > 0.9  # y is down in these cameras
    assert forward @ [0, 0, 1] > 0.7  # the plane lies ahead of them


def test_a_camera_opens_towards_what_it_sees() -> None:
    views = [plane.view for plane in plane_views()]
    cloud = cloud_of(points_on_plane(500))
    box = CloudBox.of(cloud)
    apex, *corners = np.array(camera_outline(views[0], box))
    np.testing.assert_allclose(apex, box.shown(views[0].center_in_world), atol=1e-3)
    middle = np.mean(corners, axis=0) - apex
    assert middle @ (box.shown(points_on_plane(500)).mean(axis=0) - apex) > 0
