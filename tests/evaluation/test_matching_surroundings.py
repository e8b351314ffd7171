"""Laws of what surrounds a pixel."""

import numpy as np
import pytest

from resdepth_colmap.evaluation.matching_surroundings import (
    is_like_median,
    likeness,
    near_steps,
    textures,
)


def test_a_plane_is_like_itself_and_a_hole_like_nothing() -> None:
    depth = np.full((12, 16), 4, np.float32)
    depth[5, 5] = 0
    found = likeness(depth)
    assert found[5, 5] == 0
    depth_there = np.delete(found.ravel(), 5 * 16 + 5)
    np.testing.assert_array_equal(depth_there, 1)
    np.testing.assert_array_equal(is_like_median(depth), depth > 0)


def test_a_lonely_depth_is_like_itself_alone() -> None:
    depth = np.full((12, 16), 4, np.float32)
    depth[5, 5] = 5
    assert likeness(depth)[5, 5] == pytest.approx(1 / 25)
    assert not is_like_median(depth)[5, 5]
    assert is_like_median(depth)[5, 6]
    alone = np.zeros_like(depth)
    alone[5, 5] = 5
    assert likeness(alone)[5, 5] == 1


def test_steps_reach_a_few_pixels_and_slopes_are_none() -> None:
    depth = np.full((8, 40), 4, np.float32)
    depth[:, 20:] = 5
    expected = np.zeros(40, np.bool_)
    expected[14:26] = True
    np.testing.assert_array_equal(near_steps(depth), np.tile(expected, (8, 1)))
    slope = np.tile(np.linspace(4, 5, 40, dtype=np.float32), (8, 1))
    assert not near_steps(slope).any()
    holes = np.where(np.arange(40) % 7, slope, np.float32(0))
    assert not near_steps(holes).any()


def test_texture_is_the_deviation_of_grey_values() -> None:
    gray = np.full((20, 20), 0.5, np.float32)
    np.testing.assert_allclose(textures(gray), 0, atol=1e-3)
    noise = np.random.default_rng(0).random((40, 40), dtype=np.float32)
    assert textures(noise)[20, 20] == pytest.approx(255 / np.sqrt(12), rel=0.1)
