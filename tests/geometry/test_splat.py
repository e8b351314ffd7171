"""Laws of the z-buffer."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from resdepth_colmap.geometry.projection import back_project
from resdepth_colmap.geometry.splat import splat_depth

K = np.array([[20.0, 0, 7.3], [0, 21.0, 5.2], [0, 0, 1]])


@given(seed=st.integers(0, 1000), num_chunks=st.integers(1, 4))
def test_the_points_of_a_depth_map_give_it_back(seed: int, num_chunks: int) -> None:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(1, 5, (11, 16)).astype(np.float32)
    depth[rng.random(depth.shape) < 0.3] = 0
    xyz = rng.permutation(back_project(depth, K)[depth > 0])
    chunks = np.array_split(xyz, num_chunks)
    assert np.allclose(splat_depth(chunks, K, 11, 16), depth, rtol=1e-6)


def at(x: float, y: float, z: float) -> list[float]:
    """The point at depth z that falls on that place of the map."""
    return [(x - K[0, 2]) / K[0, 0] * z, (y - K[1, 2]) / K[1, 1] * z, z]


def test_the_front_surface_counts_and_of_it_the_middle() -> None:
    points = [at(3.0, 3.0, 4.0), at(3.4, 3.0, 2.0), at(3.1, 3.0, 2.02)]
    depth = splat_depth([np.array(points)], K, 11, 16)
    assert np.count_nonzero(depth) == 1
    assert depth[3, 3] == np.float32(2.02)


def test_what_cannot_be_seen_is_passed_over() -> None:
    behind = [-1.0 * value for value in at(3, 3, 2)]
    points = [behind, [np.nan, 0, 1], at(-0.6, 3, 1), at(3, 10.6, 1), [1e20, 0, 1e-3]]
    assert not splat_depth([np.array(points)], K, 11, 16).any()
    assert not splat_depth([], K, 11, 16).any()
