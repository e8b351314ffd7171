"""Laws of the packed numbers, with Pillow as the decoder."""

import io

import hypothesis
import hypothesis.extra.numpy as hnp
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import strategies as st
from PIL import Image

from resdepth_colmap.report.packing import (
    CONFIDENCE_LEVELS,
    DepthCode,
    packed_confidence,
    packed_photo,
)

DEPTHS = hnp.arrays(
    np.float32,
    hnp.array_shapes(min_dims=2, max_dims=2, max_side=8),
    elements=st.one_of(st.just(0.0), st.floats(2**-10, 2**13, width=32)),
)


def values_of(png: bytes) -> npt.NDArray[np.int64]:
    planes = np.asarray(Image.open(io.BytesIO(png))).astype(np.int64)
    high, low = np.split(planes, 2)
    joined: npt.NDArray[np.int64] = 256 * high + low
    return joined


@hypothesis.given(depth=DEPTHS, step=st.sampled_from([0.0005, 0.002]))
def test_a_depth_comes_back_within_half_a_step_and_a_hole_as_a_hole(
    depth: npt.NDArray[np.float32], step: float
) -> None:
    code = DepthCode.of(step, depth)
    values = values_of(code.packed(depth))
    decoded = np.where(values > 0, code.nearest * np.exp((values - 1) * step), 0)
    np.testing.assert_array_equal(decoded > 0, depth > 0)
    np.testing.assert_allclose(decoded, depth, rtol=0.51 * step)


def test_equal_depths_of_two_maps_have_equal_values() -> None:
    first = np.array([[1.0, 2.0], [0.0, 3.7]], np.float32)
    second = np.array([[0.5, 2.0], [9.0, 3.7]], np.float32)
    code = DepthCode.of(0.0005, first, second, None)
    one, other = values_of(code.packed(first)), values_of(code.packed(second))
    np.testing.assert_array_equal(one[:, 1], other[:, 1])


def test_a_map_without_depth_is_packed_too() -> None:
    empty = np.zeros((3, 4), np.float32)
    assert not values_of(DepthCode.of(0.001, empty).packed(empty)).any()


def test_confidence_comes_back_within_half_a_level() -> None:
    confidence = np.linspace(0, 1, 101, dtype=np.float32).reshape(1, -1)
    values = np.asarray(Image.open(io.BytesIO(packed_confidence(confidence))))
    error = np.abs(values / CONFIDENCE_LEVELS - confidence)
    assert error.max() <= 0.5 / CONFIDENCE_LEVELS + 1e-6


@pytest.mark.parametrize(("side", "expected"), [(50, (50, 25)), (400, (200, 100))])
def test_a_photo_is_made_smaller_never_larger(
    side: int, expected: tuple[int, int]
) -> None:
    rgb = np.zeros((100, 200, 3), np.uint8)
    with Image.open(io.BytesIO(packed_photo(rgb, side))) as photo:
        assert photo.size == expected
