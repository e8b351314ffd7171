import numpy as np
import pytest
import torch
from torch.nn.functional import grid_sample

from resdepth_colmap.geometry.pixels import (
    cropped_K,
    index_K,
    inside_image,
    mirrored_K,
    to_grid,
)
from resdepth_colmap.scene import Camera


def test_the_point_that_colmap_sees_at_half_a_pixel_has_index_zero() -> None:
    camera = Camera(width_px=8, height_px=6, fx=4.0, fy=5.0, cx=4.0, cy=3.0)
    x_colmap, y_colmap = 0.5, 0.5
    ray = np.array([(x_colmap - 4.0) / 4.0, (y_colmap - 3.0) / 5.0, 1.0])
    np.testing.assert_allclose(index_K(camera) @ ray, [0.0, 0.0, 1.0], atol=1e-12)


def test_the_index_projection_is_pycolmaps_minus_half_a_pixel() -> None:
    pycolmap = pytest.importorskip("pycolmap")
    camera = Camera(width_px=80, height_px=60, fx=70.0, fy=72.0, cx=41.0, cy=29.0)
    oracle = pycolmap.Camera(
        model="PINHOLE", width=80, height=60, params=[70.0, 72.0, 41.0, 29.0]
    )
    point = np.array([0.3, -0.2, 2.0])
    expected = oracle.img_from_cam(point) - 0.5
    projected = index_K(camera) @ point
    np.testing.assert_allclose(projected[:2] / projected[2], expected)


@pytest.mark.parametrize("size", [(1, 1), (1, 5), (7, 1), (7, 5)])
def test_sampling_at_indices_gives_the_pixels_themselves(size: tuple[int, int]) -> None:
    height, width = size
    image = torch.rand(1, 1, height, width, generator=torch.Generator().manual_seed(0))
    y, x = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    grid = to_grid(torch.stack([x, y], -1).float(), width, height)
    sampled = grid_sample(image, grid[None], align_corners=True, padding_mode="border")
    torch.testing.assert_close(sampled, image)


def test_a_pixel_reaches_half_a_pixel_round_its_centre() -> None:
    xy = torch.tensor([[-0.5, 0.0], [-0.51, 0.0], [3.5, 2.5], [3.51, 2.5], [3.5, 2.51]])
    assert inside_image(xy, 4, 3).tolist() == [True, False, True, False, False]


def test_a_crop_sees_the_same_ray_at_the_shifted_pixel() -> None:
    K = np.array([[50.0, 0.0, 31.0], [0.0, 52.0, 20.0], [0.0, 0.0, 1.0]])
    ray = np.linalg.inv(K) @ [12.0, 9.0, 1.0]
    np.testing.assert_allclose(cropped_K(K, 10, 4) @ ray, [2.0, 5.0, 1.0], atol=1e-12)


def test_mirroring_twice_is_none_and_the_first_column_becomes_the_last() -> None:
    K = np.array([[50.0, 0.3, 31.2], [0.0, 52.0, 20.5], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(mirrored_K(mirrored_K(K, 64), 64), K)
    ray = np.linalg.inv(K) @ [0.0, 7.0, 1.0]
    np.testing.assert_allclose(mirrored_K(K, 64) @ ray, [63.0, 7.0, 1.0], atol=1e-12)
