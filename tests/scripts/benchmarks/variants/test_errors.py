"""Laws of the errors that several networks are compared by."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from resdepth_colmap.evaluation.metrics.depth_metrics import depth_metrics
from scripts.benchmarks.variants.errors import method_errors, method_summaries

TRUTH = np.full((12, 10), 2.0, np.float32)


def moved(by: float) -> np.ndarray:
    return (TRUTH + by).astype(np.float32)


@given(st.floats(0.001, 0.5), st.floats(0.001, 0.5))
def test_a_ratio_is_the_error_over_the_initial_one(before: float, after: float) -> None:
    errors = {"view": method_errors(moved(before), {"net": moved(after)}, TRUTH)}
    summary = method_summaries(errors)["net"]
    for key in ("mae_ratio", "medae_ratio"):
        assert summary[key] == pytest.approx(after / before, rel=0.01)
    assert summary["bad_2"] == float(after > 0.02 * 2.0)


def test_the_initial_map_and_its_median_are_methods_too() -> None:
    initial = moved(0.1)
    initial[5, 5] = 9.0
    errors = method_errors(initial, {}, TRUTH)
    expected = depth_metrics(initial, TRUTH).to_mapping()
    assert errors["unfiltered"]["mae"] == pytest.approx(expected["mae"], abs=1e-6)
    assert errors["median"]["mae"] == pytest.approx(0.1, abs=1e-6)
    assert method_summaries({"view": errors})["unfiltered"]["mae_ratio"] == 1


def test_means_are_over_views_and_a_view_without_error_has_no_ratio() -> None:
    views = {
        "bad": method_errors(moved(0.2), {"net": moved(0.1)}, TRUTH),
        "exact": method_errors(TRUTH, {"net": moved(0.3)}, TRUTH),
    }
    summary = method_summaries(views)["net"]
    assert summary["mae"] == pytest.approx(0.2, abs=1e-6)
    assert summary["mae_ratio"] == pytest.approx(0.5, abs=1e-5)
    assert summary["views"] == {"bad": 0.1, "exact": 0.3}
    only = method_summaries({"exact": views["exact"]})["net"]
    assert only["mae_ratio"] is None


def test_no_views_are_no_methods() -> None:
    assert method_summaries({}) == {}
