"""Laws of carrying a depth map into another camera."""

import pytest
import torch
from analytic_scene import (
    CAMERA,
    PLANE_NORMAL,
    PLANE_OFFSET,
    Pair,
    depth_of_plane,
    plane_pair,
    tensor,
    two_views,
)
from torch import Tensor

from resdepth_colmap.geometry.forward_warp import reproject_inverse_depth
from resdepth_colmap.scene import Camera

SIZE_PX = (CAMERA.height_px, CAMERA.width_px)
LARGER = Camera(width_px=96, height_px=80, fx=95.0, fy=90.0, cx=47.0, cy=41.0)


def source_depth(camera: Camera = CAMERA) -> Tensor:
    return tensor(depth_of_plane(two_views(camera)[1], PLANE_NORMAL, PLANE_OFFSET))[
        None
    ]


def reprojected(pair: Pair, depth_in_source: Tensor) -> Tensor:
    inverse = torch.where(depth_in_source > 0, 1.0 / depth_in_source, 0.0)
    pose = pair.source_from_reference
    return reproject_inverse_depth(
        inverse, pair.source_K, pair.reference_K, pose, SIZE_PX
    )


@pytest.mark.parametrize("camera", [CAMERA, LARGER])
def test_a_plane_arrives_where_it_is_and_closed(camera: Camera) -> None:
    pair = plane_pair(camera)
    arrived = reprojected(pair, source_depth(camera))
    inside = arrived > 0
    slope = 0.02  # of the plane's inverse depth over the pixel that a point may be off
    error = (arrived * pair.depth - 1).abs()
    assert float(error[inside].max()) < slope
    assert float(inside.double().mean()) > 0.6
    middle = inside[0, 0, 8:-8, 20:44]
    assert bool(middle.all())


def test_what_the_source_has_not_measured_does_not_arrive() -> None:
    pair = plane_pair()
    depth = source_depth()
    assert not reprojected(pair, torch.zeros_like(depth)).any()
    halved = depth.clone()
    halved[..., : CAMERA.width_px // 2] = 0
    before, after = reprojected(pair, depth) > 0, reprojected(pair, halved) > 0
    assert bool((before | ~after).all())
    assert 0.1 < float(after.double().mean() / before.double().mean()) < 0.9


def steps(focal_px: float, baseline: float) -> tuple[Tensor, Tensor, Tensor]:
    """A card at depth 2 before a wall at 4: source map, K and pose, source aside."""
    depth = torch.full((1, 1, 20, 60), 4.0, dtype=torch.float64)
    depth[..., 20:30] = 2.0
    K = torch.tensor([[[focal_px, 0, 30.0], [0, focal_px, 10.0], [0, 0, 1.0]]])
    pose = torch.eye(3, 4)[None]
    pose[0, 0, 3] = -baseline
    return depth, K.double(), pose.double()


def test_what_the_card_hides_from_the_source_is_left_open() -> None:
    depth, K, pose = steps(focal_px=40.0, baseline=0.8)
    arrived = reproject_inverse_depth(1 / depth, K, K, pose, (20, 60))
    # Disparities are 16 px of the card and 8 px of the wall: the card, at 36 to 46,
    # is followed or led by a strip of 8 px that the source does not see.
    row = arrived[0, 0, 10]
    assert torch.allclose(row[36:46], torch.full((10,), 0.5).double())
    assert not row[30:36].any()
    assert torch.allclose(row[46:60], torch.full((14,), 0.25).double())


def test_what_comes_to_lie_behind_the_reference_is_dropped() -> None:
    depth, K, pose = steps(focal_px=40.0, baseline=0.0)
    pose[0, 2, 3] = 3.0  # the reference is 3 units before the source: past the card
    arrived = reproject_inverse_depth(1 / depth, K, K, pose, (20, 60))
    assert torch.allclose(arrived[arrived > 0], torch.ones(1).double())


def test_the_views_of_a_batch_do_not_mix() -> None:
    depth, K, pose = steps(focal_px=40.0, baseline=0.8)
    inverse = torch.cat([1 / depth, 1 / (2 * depth)])
    both = reproject_inverse_depth(
        inverse, K.repeat(2, 1, 1), K.repeat(2, 1, 1), pose.repeat(2, 1, 1), (20, 60)
    )
    for index in range(2):
        one = reproject_inverse_depth(inverse[index : index + 1], K, K, pose, (20, 60))
        assert torch.equal(both[index], one[0])
