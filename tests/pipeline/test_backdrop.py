"""Laws of uniform backdrops: found where all images have one, and left out."""

import numpy as np
import pytest

from resdepth_colmap.pipeline.backdrop import backdrop_color, is_backdrop
from resdepth_colmap.scene import ColorImage

SIZE_PX = (60, 80)
OBJECT = (slice(15, 45), slice(20, 60))
HOLE = (slice(25, 35), slice(35, 45))


def photograph(level: int, seed: int = 0) -> ColorImage:
    """A textured object with a hole, before paper of that grey with a little noise."""
    rng = np.random.default_rng(seed)
    paper = np.clip(level + rng.integers(-2, 3, (*SIZE_PX, 3)), 0, 255)
    shown = paper.copy()
    dark, light = rng.integers(40, 70, shown.shape), rng.integers(170, 220, shown.shape)
    texture = np.where(rng.random((*SIZE_PX, 1)) < 0.5, dark, light)
    shown[OBJECT] = texture[OBJECT]
    shown[OBJECT][2:4, 2:4] = paper[OBJECT][2:4, 2:4]  # a speck of that colour
    shown[HOLE] = paper[HOLE]
    return shown.astype(np.uint8)


@pytest.mark.parametrize("level", [0, 120, 255])
def test_a_backdrop_of_any_grey_is_found_and_the_object_is_not(level: int) -> None:
    images = [photograph(level, seed) for seed in range(4)]
    color = backdrop_color(images)
    assert color is not None
    np.testing.assert_allclose(color, level, atol=2)
    found = is_backdrop(images[0], color)
    inside = np.zeros(SIZE_PX, np.bool_)
    inside[OBJECT] = True
    inside[HOLE] = False
    assert found[inside].mean() < 0.01  # the texture's mean may be that of the paper
    assert found[HOLE][3:-3, 3:-3].all()
    assert found[~inside].mean() > 0.85  # but for a rim of the blur


def test_views_of_a_room_have_none() -> None:
    rng = np.random.default_rng(0)
    rooms = [rng.integers(0, 256, (*SIZE_PX, 3)).astype(np.uint8) for _ in range(4)]
    assert backdrop_color(rooms) is None
    walls = [np.full((*SIZE_PX, 3), 40 * n, np.uint8) for n in range(4)]
    assert backdrop_color(walls) is None  # each of another colour
    one_of_four = [photograph(0), *rooms[:3]]
    assert backdrop_color(one_of_four) is None
