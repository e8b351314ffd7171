import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from resdepth_colmap.geometry.resize import area_resized, nearest_resized

SIZES = st.integers(1, 300)


@given(height=SIZES, width=SIZES, rows=SIZES, columns=SIZES)
def test_each_pixel_of_a_resized_map_is_the_nearest_one_of_the_map(
    height: int, width: int, rows: int, columns: int
) -> None:
    y, x = np.mgrid[:height, :width]
    values = (1000 * y + x).astype(np.float32)
    resized = nearest_resized(values, (columns, rows))
    assert resized.shape == (rows, columns)
    row, column = np.divmod(resized.astype(np.int64), 1000)
    expected_y = (np.arange(rows)[:, None] + 0.5) * height / rows
    expected_x = (np.arange(columns)[None] + 0.5) * width / columns
    # A centre that falls between two pixels may take either.
    assert (np.abs(row + 0.5 - expected_y) <= 0.501).all()
    assert (np.abs(column + 0.5 - expected_x) <= 0.501).all()


def test_the_nearest_pixel_is_counted_from_the_centres() -> None:
    values = np.arange(6, dtype=np.float32)[np.newaxis]
    assert nearest_resized(values, (2, 1)).tolist() == [[1, 4]]  # INTER_NEAREST: 0, 3


def test_a_mask_follows_the_size_of_the_map() -> None:
    wanted = np.zeros((6, 8), np.bool_)
    wanted[:, 4:] = True
    small = nearest_resized(wanted, (4, 3))
    assert small.dtype == np.bool_
    assert np.array_equal(small, np.tile([False, False, True, True], (3, 1)))


def test_a_smaller_image_is_the_mean_of_what_each_pixel_covers() -> None:
    rng = np.random.default_rng(0)
    rgb = rng.integers(0, 256, (6, 8, 3)).astype(np.uint8)
    means = rgb.reshape(3, 2, 4, 2, 3).mean(axis=(1, 3))
    resized = area_resized(rgb, (4, 3))
    assert resized.dtype == np.uint8
    np.testing.assert_allclose(resized, means, atol=0.5)


@pytest.mark.parametrize("resize", [nearest_resized, area_resized])
@pytest.mark.parametrize("shape", [(3, 5), (3, 5, 1), (3, 5, 3)])
def test_the_type_and_the_channels_stay_and_the_same_size_costs_nothing(
    resize: type, shape: tuple[int, ...]
) -> None:
    values = np.ones(shape, np.float32)
    assert resize(values, (5, 3)) is values
    resized = resize(values, (7, 2))
    assert resized.shape == (2, 7, *shape[2:])
    assert resized.dtype == np.float32
