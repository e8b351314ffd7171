import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from resdepth_colmap.geometry.holes import fill_holes
from resdepth_colmap.scene import DepthMap


def random_map(height: int, width: int, share: float, seed: int) -> DepthMap:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(1.0, 9.0, (height, width)).astype(np.float32)
    depth[rng.random((height, width)) > share] = 0.0
    depth.flat[rng.integers(depth.size)] = 3.0
    return depth


@given(
    height=st.integers(1, 40),
    width=st.integers(1, 40),
    share=st.floats(0, 1),
    seed=st.integers(0, 2**32),
)
def test_every_pixel_gets_a_depth_and_known_ones_keep_theirs(
    height: int, width: int, share: float, seed: int
) -> None:
    depth = random_map(height, width, share, seed)
    filled = fill_holes(depth)
    known = depth > 0
    assert filled.shape == depth.shape
    assert filled.dtype == np.float32
    np.testing.assert_array_equal(filled[known], depth[known])
    assert filled.min() >= depth[known].min() * (1 - 1e-6)
    assert filled.max() <= depth[known].max() * (1 + 1e-6)


def test_one_known_pixel_fills_the_whole_map() -> None:
    depth = np.zeros((33, 18), dtype=np.float32)
    depth[7, 11] = 2.5
    np.testing.assert_allclose(fill_holes(depth), 2.5, rtol=1e-6)


def test_a_hole_in_a_smooth_surface_is_filled_smoothly() -> None:
    x = np.arange(64, dtype=np.float32)
    inverse = np.broadcast_to(0.2 + 0.001 * x, (48, 64))
    depth = (1.0 / inverse).astype(np.float32)
    depth[18:30, 24:36] = 0.0
    filled = 1.0 / fill_holes(depth)
    assert np.abs(filled - inverse).max() < 0.004  # a third of the hole's own range
    assert np.abs(np.diff(filled, axis=1)).max() < 0.004


def test_what_is_not_a_number_is_a_hole() -> None:
    depth = np.array([[2.0, np.nan, np.inf, -1.0]], dtype=np.float32)
    np.testing.assert_allclose(fill_holes(depth), 2.0)


def test_a_map_without_any_depth_is_refused() -> None:
    with pytest.raises(ValueError, match="4 x 3"):
        fill_holes(np.zeros((3, 4), dtype=np.float32))
