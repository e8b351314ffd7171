import numpy as np

from resdepth_colmap.geometry.projection import transform
from resdepth_colmap.scene import Camera, Matrix, View, cam_from_cam, projection_center

CAMERA = Camera(width_px=4, height_px=3, fx=5, fy=5, cx=2, cy=1.5)


def _view(seed: int) -> View:
    return View(image_id=1, name="a.png", camera=CAMERA, cam_from_world=_pose(seed))


def _pose(seed: int) -> Matrix:
    rng = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return np.column_stack([rotation, rng.normal(size=3)])


def test_a_relative_pose_leads_from_one_camera_to_the_other() -> None:
    source, target = _view(0), _view(1)
    world = np.random.default_rng(2).normal(size=(5, 3))
    in_source = transform(source.cam_from_world, world)
    in_target = transform(target.cam_from_world, world)
    relative = cam_from_cam(target, source)
    np.testing.assert_allclose(transform(relative, in_source), in_target, atol=1e-12)


def test_the_projection_centre_is_the_origin_of_the_camera() -> None:
    pose = _pose(0)
    center = projection_center(pose)
    np.testing.assert_allclose(transform(pose, center), 0, atol=1e-12)
    assert np.array_equal(_view(0).center_in_world, center)
