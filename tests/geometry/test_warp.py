import dataclasses

import pytest
import torch
from analytic_scene import CAMERA, Pair, plane_pair, sphere_pair
from torch import Tensor

from resdepth_colmap.geometry.warp import warp_to_reference


def warp(pair: Pair) -> tuple[Tensor, Tensor]:
    warped, inside = warp_to_reference(
        pair.source_gray,
        pair.inverse_depth,
        pair.reference_K,
        pair.source_K,
        pair.source_from_reference,
    )
    return warped, inside


def error(pair: Pair, warped: Tensor, inside: Tensor) -> Tensor:
    return (warped - pair.reference_gray)[inside & (pair.depth > 0)].abs()


def test_with_the_true_depth_of_a_plane_both_views_look_the_same() -> None:
    pair = plane_pair()
    warped, inside = warp(pair)
    errors = error(pair, warped, inside)
    assert inside.float().mean() > 0.7
    # Bilinear sampling of waves of 24 px or more: a quarter of a grey level of 255.
    assert errors.median() < 1e-3
    assert errors.quantile(0.95) < 3e-3


def test_with_the_true_depth_of_a_sphere_both_views_look_the_same() -> None:
    pair = sphere_pair()
    warped, inside = warp(pair)
    errors = error(pair, warped, inside)
    assert len(errors) > 500
    assert errors.median() < 2e-3  # the rim is hidden in one view or mixed with black


def test_a_source_of_half_the_size_shows_the_half_pixel() -> None:
    half = CAMERA.resized(32, 24)
    pair = plane_pair(half)
    exact = error(pair, *warp(pair)).median()
    # What comes out when COLMAP's K is used as if centres were at the index.
    wrong = dataclasses.replace(
        pair,
        reference_K=pair.reference_K + half_pixel(),
        source_K=pair.source_K + half_pixel(),
    )
    assert exact < 5e-3
    assert error(wrong, *warp(wrong)).median() > 4 * exact


def half_pixel() -> Tensor:
    return torch.tensor([[[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]], dtype=torch.float64)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_the_identity_pose_changes_nothing(dtype: torch.dtype) -> None:
    pair = plane_pair()
    image = pair.source_gray.to(dtype)
    same = torch.eye(3, 4)[None].double()
    warped, inside = warp_to_reference(
        image, pair.inverse_depth.to(dtype), pair.source_K, pair.source_K, same
    )
    assert inside.all()
    torch.testing.assert_close(warped, image, rtol=0, atol=1e-5)


@pytest.mark.parametrize("scale", [1e-3, 0.37, 25.0, 1e4])
def test_the_scale_of_the_scene_does_not_matter(scale: float) -> None:
    pair = plane_pair()
    pose = pair.source_from_reference.clone()
    pose[..., 3] *= scale
    scaled = dataclasses.replace(
        pair, depth=pair.depth * scale, source_from_reference=pose
    )
    torch.testing.assert_close(warp(scaled)[0], warp(pair)[0], rtol=0, atol=1e-9)


def test_points_without_depth_or_behind_the_source_are_outside_and_black() -> None:
    pair = plane_pair()
    pose = pair.source_from_reference.clone()
    pose[..., 2, 3] -= 100.0  # the source, far beyond the plane, looks away from it
    behind = dataclasses.replace(pair, source_from_reference=pose)
    empty = dataclasses.replace(pair, depth=torch.zeros_like(pair.depth))
    for sample in (behind, empty):
        warped, inside = warp(sample)
        assert not inside.any()
        assert not warped.any()


def test_nearly_infinite_and_nearly_zero_depths_give_numbers() -> None:
    pair = plane_pair()
    depth = pair.depth.clone()
    depth[..., 0] = 1e30
    depth[..., 1] = 1e-30
    warped, _ = warp(dataclasses.replace(pair, depth=depth))
    assert torch.isfinite(warped).all()


def test_each_view_of_a_batch_has_its_own_geometry() -> None:
    plane, sphere = plane_pair(), sphere_pair()
    both = Pair(
        **{
            field.name: torch.cat(
                [getattr(plane, field.name), getattr(sphere, field.name)]
            )
            for field in dataclasses.fields(Pair)
        }
    )
    warped, _ = warp(both)
    torch.testing.assert_close(warped[:1], warp(plane)[0])
    torch.testing.assert_close(warped[1:], warp(sphere)[0])


def test_the_gradient_is_that_of_finite_differences() -> None:
    pair = plane_pair()
    window = slice(20, 25)
    inverse = pair.inverse_depth[..., window, window].clone().requires_grad_()
    image = pair.source_gray.clone().requires_grad_()

    def sample(inverse: Tensor, image: Tensor) -> Tensor:
        warped: Tensor = warp_to_reference(
            image,
            inverse,
            pair.reference_K,
            pair.source_K,
            pair.source_from_reference,
        )[0]
        return warped

    assert torch.autograd.gradcheck(sample, (inverse, image), fast_mode=True)
