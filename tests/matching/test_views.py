"""Laws of the projection into a source."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from resdepth_colmap.matching.views import (
    inverse_depth_per_px,
    pack_sources,
    project,
)

K = np.array([[70, 0, 39.5], [0, 60, 29.5], [0, 0, 1.0]])
ANGLE = 0.1
ROTATION = np.array(
    [
        [np.cos(ANGLE), 0, np.sin(ANGLE)],
        [0, 1, 0],
        [-np.sin(ANGLE), 0, np.cos(ANGLE)],
    ]
)
TRANSLATION = np.array([-0.3, 0.1, 0.05])
GRAYS = [np.full((4, 6), 0.25, np.float32), np.full((3, 5), 0.75, np.float32)]
SOURCES = pack_sources(
    np.stack([K @ ROTATION @ np.linalg.inv(K)] * 2).astype(np.float32),
    np.stack([K @ TRANSLATION] * 2).astype(np.float32),
    GRAYS,
    [np.array([[0, 2, 4]] * 8, np.float32).reshape(4, 6), np.ones((3, 5), np.float32)],
)
X, Y, DEPTH = 20.0, 35.0, 2.5


def _position(w: float) -> NDArray[Any]:
    pixel = np.float32(X), np.float32(Y), np.float32(w)
    u = np.array([project(*pixel, SOURCES, 1, axis) for axis in range(3)])
    return np.asarray(u[:2] / u[2])


def test_a_pixel_lies_where_its_point_is_seen() -> None:
    xyz = DEPTH * np.linalg.inv(K) @ [X, Y, 1]
    seen = K @ (ROTATION @ xyz + TRANSLATION)
    np.testing.assert_allclose(_position(1 / DEPTH), seen[:2] / seen[2], rtol=1e-4)


def test_a_step_of_inverse_depth_per_px_moves_the_pixel_by_one() -> None:
    w = 1 / DEPTH
    step = inverse_depth_per_px(np.float32(X), np.float32(Y), np.float32(w), SOURCES, 0)
    moved = np.linalg.norm(_position(w + step) - _position(w))
    assert moved == pytest.approx(1.0, abs=0.02)


def test_sources_lie_one_after_the_other() -> None:
    assert SOURCES.starts.tolist() == [0, 24]
    assert SOURCES.sizes.tolist() == [[6, 4], [5, 3]]
    assert np.allclose(SOURCES.pixels[:, :24], 0.25)
    assert np.allclose(SOURCES.pixels[:, 24:], 0.75)
    assert SOURCES.inverse_depths[:3].tolist() == [0, 0.5, 0.25]
    assert pack_sources(*SOURCES[:2], GRAYS, None).inverse_depths.size == 0
