"""Laws of the median that the photo guides."""

import subprocess
import sys

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from resdepth_colmap.geometry.guided_median import RADIUS_PX, guided_median

FloatArray = npt.NDArray[np.float32]


def step(at_px: int, near: float = 1.0, far: float = 0.4) -> FloatArray:
    """A map of 40 x 60 pixels with a step from near to far."""
    columns = np.broadcast_to(np.arange(60), (40, 60))
    return np.where(columns < at_px, near, far).astype(np.float32)


def photo(at_px: int, num_channels: int = 3) -> FloatArray:
    return np.repeat(step(at_px, 0.8, 0.2)[..., np.newaxis], num_channels, axis=2)


ONES = np.ones((40, 60), np.float32)


@pytest.mark.parametrize("num_channels", [1, 3])
@pytest.mark.parametrize("shift_px", [-3, -1, 2, 3])
def test_an_edge_beside_that_of_the_photo_moves_onto_it(
    shift_px: int, num_channels: int
) -> None:
    found = guided_median(step(30 + shift_px), photo(30, num_channels), ONES)
    assert np.array_equal(found, step(30))


def test_without_an_edge_in_the_photo_the_depth_keeps_its_own() -> None:
    plain = np.full((40, 60, 3), 0.5, np.float32)
    assert np.array_equal(guided_median(step(30), plain, ONES), step(30))


def test_what_lies_within_a_few_per_cent_does_not_change() -> None:
    rng = np.random.default_rng(0)
    wall = rng.uniform(1.0, 1.04, (40, 60)).astype(np.float32)
    assert np.array_equal(guided_median(wall, photo(30), ONES), wall)


def test_a_patch_that_is_not_trusted_takes_what_surrounds_it() -> None:
    rows, columns = np.mgrid[:40, :60]
    is_patch = (abs(rows - 20) < 8) & (abs(columns - 30) < 8)
    depth = np.where(is_patch, 0.4, 1.0).astype(np.float32)
    plain = np.full((40, 60, 3), 0.5, np.float32)
    weights = np.where(is_patch, 1e-3, 1.0).astype(np.float32)
    assert (guided_median(depth, plain, weights) == 1.0).all()
    assert (guided_median(depth, plain, ONES)[is_patch] == 0.4).any()


@given(seed=st.integers(0, 999), height=st.integers(1, 30), width=st.integers(1, 30))
def test_it_takes_values_of_the_input_whichever_way_it_is_turned(
    seed: int, height: int, width: int
) -> None:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(0.1, 1.0, (height, width)).astype(np.float32)
    colors = rng.random((height, width, 3)).astype(np.float32)
    weights = rng.uniform(0.1, 1.0, (height, width)).astype(np.float32)
    found = guided_median(depth, colors, weights)
    for row, column in np.ndindex(found.shape):
        rows = slice(max(row - RADIUS_PX, 0), row + RADIUS_PX + 1)
        columns = slice(max(column - RADIUS_PX, 0), column + RADIUS_PX + 1)
        assert found[row, column] in depth[rows, columns]
    mirrored = guided_median(depth[:, ::-1], colors[:, ::-1], weights[:, ::-1])
    turned = guided_median(depth.T, colors.transpose(1, 0, 2), weights.T)
    # Sums of weights in another order may fall on the other side of the half.
    assert (mirrored[:, ::-1] == found).mean() > 0.99
    assert (found == turned.T).mean() > 0.99


def test_the_unit_of_length_does_not_matter() -> None:
    rng = np.random.default_rng(1)
    depth = rng.uniform(0.1, 1.0, (40, 60)).astype(np.float32)
    found = guided_median(depth, photo(30), ONES)
    assert np.array_equal(guided_median(depth * 64, photo(30), ONES), found * 64)
    assert (found != depth).any()


def test_the_old_tbb_of_open3d_is_nothing_to_warn_of() -> None:
    code = """
import warnings
import open3d
from numba.core.errors import NumbaWarning
import subprocess
import sys

import numpy as np
from resdepth_colmap.geometry.guided_median import guided_median
warnings.simplefilter("error", NumbaWarning)
depth = np.ones((8, 8), np.float32)
depth[:, :4] = 0.5
guided_median(depth, np.zeros((8, 8, 3), np.float32), depth)
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)
