"""Laws of the depth errors."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import median_filter

from resdepth_colmap.evaluation.metrics.depth_metrics import (
    depth_metrics,
    median_filtered,
)
from resdepth_colmap.scene import DepthMap


def _map(seed: int, height: int = 9, width: int = 11) -> DepthMap:
    rng = np.random.default_rng(seed)
    return rng.uniform(1.0, 5.0, (height, width)).astype(np.float32)


@given(seed=st.integers(0, 1000))
def test_the_truth_has_no_error(seed: int) -> None:
    truth = _map(seed)
    metrics = depth_metrics(truth, truth)
    assert metrics.mae == metrics.rmse == metrics.medae == 0
    assert metrics.bad_1 == metrics.bad_2 == 0
    assert metrics.num_valid == metrics.num_pixels == truth.size


@given(seed=st.integers(0, 1000))
def test_errors_are_ordered(seed: int) -> None:
    metrics = depth_metrics(_map(seed), _map(seed + 1))
    assert 0 < metrics.mae <= metrics.rmse
    assert 0 <= metrics.bad_2 <= metrics.bad_1 <= 1


@given(seed=st.integers(0, 1000), growth=st.floats(1.1, 4.0))
def test_moving_away_from_the_truth_never_makes_an_error_smaller(
    seed: int, growth: float
) -> None:
    truth = _map(seed)
    shift = np.random.default_rng(seed + 1).normal(0, 0.05, truth.shape)
    near = depth_metrics((truth + shift).astype(np.float32), truth)
    far = depth_metrics((truth + growth * shift).astype(np.float32), truth)
    assert far.mae > near.mae and far.rmse > near.rmse and far.medae > near.medae
    assert far.bad_1 >= near.bad_1 and far.bad_2 >= near.bad_2


@given(seed=st.integers(0, 1000), scale=st.sampled_from([0.125, 2.0, 64.0]))
def test_errors_scale_with_the_scene_and_shares_do_not(seed: int, scale: float) -> None:
    depth, truth = _map(seed), _map(seed + 1)
    plain = depth_metrics(depth, truth, max_residual=None)
    scaled = depth_metrics(depth * scale, truth * scale, max_residual=None)
    assert scaled.mae == pytest.approx(scale * plain.mae)
    assert scaled.rmse == pytest.approx(scale * plain.rmse)
    assert scaled.medae == pytest.approx(scale * plain.medae)
    assert (scaled.bad_1, scaled.bad_2) == (plain.bad_1, plain.bad_2)


def test_holes_are_bad_and_missing_but_leave_the_errors_alone() -> None:
    truth = np.full((4, 5), 2.0, np.float32)
    depth = truth + np.float32(0.01)
    depth[0] = 0
    metrics = depth_metrics(depth, truth)
    assert metrics.num_missing == 5 and metrics.num_valid == 15
    assert metrics.mae == pytest.approx(0.01, rel=1e-4)
    assert metrics.bad_1 == metrics.bad_2 == 0.25


def test_where_the_truth_is_unknown_nothing_counts() -> None:
    truth = np.full((4, 5), 2.0, np.float32)
    depth = truth.copy()
    truth[1], depth[1] = 0, 100
    metrics = depth_metrics(depth, truth)
    assert metrics.num_pixels == 15 and metrics.mae == 0


def test_a_residual_beyond_the_limit_is_discarded_but_bad() -> None:
    truth = np.full((2, 2), 2.0, np.float32)
    depth = truth.copy()
    depth[0, 0] = 13.0
    metrics = depth_metrics(depth, truth)
    assert metrics.num_discarded == 1 and metrics.mae == 0 and metrics.bad_2 == 0.25
    assert depth_metrics(depth, truth, max_residual=None).mae == pytest.approx(11 / 4)


def test_only_the_region_counts() -> None:
    truth = np.full((4, 4), 2.0, np.float32)
    depth = truth.copy()
    depth[:2] = 3.0
    region = np.zeros((4, 4), bool)
    region[:2] = True
    assert depth_metrics(depth, truth, region).mae == 1.0
    assert depth_metrics(depth, truth, ~region).mae == 0.0


def test_without_pixels_there_is_no_error_rather_than_a_zero() -> None:
    metrics = depth_metrics(np.ones((2, 2), np.float32), np.zeros((2, 2), np.float32))
    assert math.isnan(metrics.mae) and math.isnan(metrics.bad_1)
    assert json.loads(json.dumps(metrics.to_mapping()))["mae"] is None


def test_maps_of_different_sizes_are_refused() -> None:
    with pytest.raises(ValueError, match="differ"):
        depth_metrics(_map(0, 4, 5), _map(0, 5, 4))


def test_the_median_is_that_of_scipy_inside_a_full_map() -> None:
    depth = _map(0, 150, 13)  # more rows than are filtered at once
    expected = median_filter(depth, 5)
    assert np.array_equal(median_filtered(depth)[2:-2, 2:-2], expected[2:-2, 2:-2])


@given(seed=st.integers(0, 1000), share=st.floats(0.0, 1.0))
def test_the_median_keeps_holes_and_takes_depths_of_the_map_only(
    seed: int, share: float
) -> None:
    depth = _map(seed)
    depth[np.random.default_rng(seed).random(depth.shape) < share] = 0
    filtered = median_filtered(depth)
    assert np.array_equal(filtered > 0, depth > 0)
    assert np.isin(filtered, depth).all()


def test_an_even_window_is_refused() -> None:
    with pytest.raises(ValueError, match="size=4"):
        median_filtered(_map(0), 4)
