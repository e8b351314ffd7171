"""Laws of completing what one view sees and no other."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from resdepth_colmap.geometry.completion import complete_from_background
from resdepth_colmap.scene import FloatMap

SHAPE = (12, 30)


def card_before_a_wall() -> FloatMap:
    """A card at depth 2 before a wall at 4, as inverse depth."""
    inverse = np.full(SHAPE, 0.25, np.float32)
    inverse[:, 12:18] = 0.5
    return inverse


@pytest.mark.parametrize("along_rows", [True, False])
def test_the_wall_goes_on_behind_the_card(along_rows: bool) -> None:
    truth = card_before_a_wall()
    known = np.ones(SHAPE, bool)
    known[:, 8:12] = False  # left of the card: what it hides from the other view
    found = np.where(known, truth, np.float32(9.0))
    if not along_rows:
        truth, known, found = truth.T, known.T, found.T
    filled_in = complete_from_background(found, known, along_rows)
    np.testing.assert_array_equal(filled_in, truth)
    assert filled_in.dtype == np.float32


def test_what_lies_at_the_border_takes_what_is_there() -> None:
    truth = card_before_a_wall()
    known = np.ones(SHAPE, bool)
    known[:, :5] = False
    filled_in = complete_from_background(truth * known, known, along_rows=True)
    np.testing.assert_array_equal(filled_in, truth)


def test_a_line_without_anything_known_takes_the_median() -> None:
    truth = np.full(SHAPE, 0.25, np.float32)
    known = np.ones(SHAPE, bool)
    known[2:9] = False
    filled_in = complete_from_background(truth * known, known, along_rows=True)
    np.testing.assert_array_equal(filled_in, truth)


maps = arrays.arrays(np.float32, SHAPE, elements=st.floats(0.125, 8.0, width=32))
masks = arrays.arrays(np.bool_, SHAPE)


@given(maps, masks, st.booleans())
def test_known_depths_stay_and_none_is_invented(
    inverse: FloatMap, known: np.ndarray, along_rows: bool
) -> None:
    filled_in = complete_from_background(inverse, known, along_rows)
    np.testing.assert_array_equal(filled_in[known], inverse[known])
    if known.any():
        assert filled_in.min() >= inverse[known].min()
        assert filled_in.max() <= inverse[known].max()
    else:
        np.testing.assert_array_equal(filled_in, inverse)
