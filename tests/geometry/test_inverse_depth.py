import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from resdepth_colmap.geometry.inverse_depth import invert_map


@given(st.lists(st.floats(1e-6, 1e6), min_size=1, max_size=20))
def test_depth_to_inverse_and_back_is_the_identity(depths: list[float]) -> None:
    depth = np.array([depths], np.float32)
    np.testing.assert_allclose(invert_map(invert_map(depth)), depth, rtol=3e-7)


def test_nothing_that_is_not_a_depth_gets_an_inverse() -> None:
    depth = np.array([[np.nan, np.inf, -np.inf, -2, 0, 1e-45, 4]], dtype=np.float32)
    assert invert_map(depth).tolist() == [[0, 0, 0, 0, 0, 0, 0.25]]
