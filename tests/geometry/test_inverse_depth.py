import numpy as np
import torch
from hypothesis import given
from hypothesis import strategies as st

from resdepth_colmap.geometry.inverse_depth import (
    depth_from_inverse,
    inverse_depth,
    invert_map,
)


@given(st.lists(st.floats(1e-6, 1e6), min_size=1, max_size=20))
def test_depth_to_inverse_and_back_is_the_identity(depths: list[float]) -> None:
    depth = torch.tensor(depths, dtype=torch.float64)
    back = depth_from_inverse(inverse_depth(depth))
    torch.testing.assert_close(back, depth, rtol=1e-12, atol=0)


def test_no_depth_stays_no_depth_and_has_no_gradient() -> None:
    depth = torch.tensor([0.0, -1.0, 2.0], requires_grad=True)
    inverse = inverse_depth(depth)
    inverse.sum().backward()  # type: ignore[no-untyped-call]
    assert inverse.tolist() == [0.0, 0.0, 0.5]
    assert depth.grad is not None
    assert depth.grad.tolist() == [0.0, 0.0, -0.25]


def test_nothing_that_is_not_a_depth_gets_an_inverse() -> None:
    depth = np.array([[np.nan, np.inf, -np.inf, -2, 0, 1e-45, 4]], dtype=np.float32)
    assert invert_map(depth).tolist() == [[0, 0, 0, 0, 0, 0, 0.25]]
