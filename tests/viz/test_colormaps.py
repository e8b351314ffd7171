"""Laws of the colours of depth, differences and errors."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from resdepth_colmap.scene import DepthMap
from resdepth_colmap.viz.colormaps import (
    DepthScale,
    color_table,
    difference_limit,
    difference_scale,
    error_scale,
    relative_difference,
)

HOLE = (200, 200, 200)


def _map(seed: int) -> DepthMap:
    rng = np.random.default_rng(seed)
    return rng.uniform(1.0, 5.0, (12, 10)).astype(np.float32)


def test_holes_and_only_holes_have_their_colour() -> None:
    depth = _map(0)
    depth[3, 4] = 0
    is_hole = (DepthScale.of(depth).colored(depth) == HOLE).all(axis=2)
    assert is_hole.sum() == 1 and is_hole[3, 4]


@given(scale=st.floats(1e-3, 1e3))
def test_the_unit_of_the_scene_does_not_change_the_colours(scale: float) -> None:
    depth = _map(1)
    scaled = depth * np.float32(scale)
    first = DepthScale.of(depth).colored(depth).astype(int)
    second = DepthScale.of(scaled).colored(scaled).astype(int)
    assert np.abs(first - second).max() <= 12  # one entry of the table


def test_a_few_wild_depths_do_not_move_the_scale() -> None:
    depth = np.tile(np.linspace(2, 4, 100, dtype=np.float32), (100, 1))
    wild = depth.copy()
    wild[0, :5], wild[1, :5] = 1e-3, 1e4
    scale, expected = DepthScale.of(wild), DepthScale.of(depth)
    assert scale.least == pytest.approx(expected.least, rel=0.01)
    assert scale.most == pytest.approx(expected.most, rel=0.01)


def test_the_scale_is_that_of_the_first_map_with_a_depth() -> None:
    empty, full = np.zeros((3, 3), np.float32), _map(2)
    assert DepthScale.of(empty, full) == DepthScale.of(full)
    assert DepthScale.of(empty).most > DepthScale.of(empty).least > 0


@given(
    center=st.floats(1e-4, 1e6),
    spread=st.sampled_from([1e-6, 0.01, 0.5, 0.9]),
)
def test_ticks_are_increasing_places_on_the_bar_with_their_depths(
    center: float, spread: float
) -> None:
    span = np.linspace(1 - spread, 1 + spread, 400, dtype=np.float32)
    scale = DepthScale.of((center * span[np.newaxis]).astype(np.float32))
    ticks = scale.ticks()
    assert ticks
    places = [unit for unit, _ in ticks]
    assert places == sorted(places) and 0 <= places[0] <= places[-1] <= 1
    for unit, text in ticks:
        inverse = scale.least + unit * (scale.most - scale.least)
        assert float(text) == pytest.approx(1 / inverse, rel=1e-4)


def test_a_wall_parallel_to_the_image_has_a_scale_and_ticks() -> None:
    wall = np.full((4, 4), 2.0, np.float32)
    scale = DepthScale.of(wall)
    assert scale.least < 0.5 < scale.most and scale.ticks()


def test_the_difference_is_relative_signed_and_nothing_at_holes() -> None:
    before = np.array([[2.0, 2.0, 0.0, 2.0]], np.float32)
    after = np.array([[2.2, 1.8, 2.0, 0.0]], np.float32)
    difference = relative_difference(before, after)
    assert difference[0, :2] == pytest.approx([0.1, -0.1], abs=1e-6)
    assert np.isnan(difference[0, 2:]).all()


@given(size=st.floats(1e-9, 1e3))
def test_the_limit_is_round_and_holds_most_differences(size: float) -> None:
    limit = difference_limit(np.full((3, 3), size, np.float32))
    digit = limit / 10.0 ** np.floor(np.log10(limit) + 1e-9)
    assert min(abs(digit - np.array([1, 2, 5]))) < 1e-6
    assert limit >= min(size, 1.0) * (1 - 1e-5)
    assert 0.001 <= limit <= 1.0


def test_without_a_common_pixel_there_is_still_a_limit() -> None:
    assert difference_limit(np.full((2, 2), np.nan, np.float32)) == 0.001


def test_no_difference_is_white_and_signs_have_opposite_colours() -> None:
    difference = np.array([[0.0, -0.1, 0.1]], np.float32)
    (none, nearer, farther) = difference_scale(difference).colored(difference)[0]
    assert none.min() > 240
    assert nearer[2] > nearer[0] and farther[0] > farther[2]


def test_larger_errors_are_brighter() -> None:
    error = np.geomspace(1e-4, 1.0, 50, dtype=np.float32)[np.newaxis]
    colors = error_scale().colored(error)[0]
    brightness = colors.astype(int).sum(axis=1)
    assert (np.diff(brightness) >= 0).all() and brightness[-1] > 600
    table = color_table(error_scale().colors)
    assert table.shape == (256, 3)
    np.testing.assert_allclose(table[-1], colors[-1].astype(int), atol=1)  # rounding


def test_no_error_at_all_is_dark_and_not_a_hole() -> None:
    zero, hole = error_scale().colored(np.array([[0.0, np.nan]], np.float32))[0]
    assert zero.max() < 10 and tuple(hole) == HOLE


@pytest.mark.parametrize("limit", [0.001, 0.02, 0.5])
def test_the_ends_of_the_bar_have_the_limit_of_the_difference(limit: float) -> None:
    scale = difference_scale(np.full((2, 2), limit, np.float32))
    assert [float(scale.norm.inverse(unit)) for unit, _ in scale.ticks] == (
        pytest.approx([-limit, 0, limit])
    )
    assert scale.ticks[-1][1] == f"+{100 * limit:g} %"
