"""Laws of pooling the errors of several depth maps."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from resdepth_colmap.evaluation.metrics.depth_metrics import depth_metrics
from resdepth_colmap.evaluation.metrics.pooled_metrics import PooledErrors, pooled
from resdepth_colmap.scene import DepthMap


def maps(seed: int, scale: float) -> tuple[DepthMap, DepthMap]:
    rng = np.random.default_rng(seed)
    truth = rng.uniform(1, 5, (13, 17)).astype(np.float32)
    noise = rng.normal(0, scale, truth.shape) * rng.choice([0.1, 1], truth.shape)
    depth = np.maximum(truth + noise, 0).astype(np.float32)
    truth[rng.random(truth.shape) < 0.2] = 0
    return depth, truth


@given(seed=st.integers(0, 1000), scale=st.sampled_from([1e-4, 0.02, 6.0]))
def test_pooling_is_measuring_all_pixels_at_once(seed: int, scale: float) -> None:
    pairs = [maps(seed + i, scale * (1 + i)) for i in range(3)]
    depth, truth = (np.concatenate(part) for part in zip(*pairs, strict=True))
    whole = depth_metrics(depth, truth)
    together = pooled([PooledErrors.of(*pair) for pair in pairs]).metrics.to_mapping()
    for name, value in whole.to_mapping().items():
        # The median is read off a histogram whose bins are half a per cent wide.
        tolerance = 0.02 if name == "medae" else 1e-6
        assert together[name] == pytest.approx(value, rel=tolerance)


def test_a_single_map_is_measured_exactly() -> None:
    depth, truth = maps(0, 0.1)
    sample = pooled([PooledErrors.of(depth, truth)])
    assert sample.metrics == depth_metrics(depth, truth)


def test_a_map_without_truth_changes_nothing() -> None:
    depth, truth = maps(0, 0.1)
    sample = PooledErrors.of(depth, truth)
    empty = PooledErrors.of(depth, np.zeros_like(truth))
    both = pooled([sample, empty]).metrics
    assert both.mae == pytest.approx(sample.metrics.mae)
    assert both.bad_5cm == pytest.approx(sample.metrics.bad_5cm)
    assert math.isnan(pooled([empty, empty]).metrics.mae)
    assert math.isnan(pooled([empty, empty]).metrics.medae)


def test_exact_maps_have_a_median_error_of_next_to_nothing() -> None:
    _, truth = maps(0, 0.1)
    sample = PooledErrors.of(truth, truth)
    assert pooled([sample, sample]).metrics.medae < 1e-8
