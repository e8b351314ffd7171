"""Laws of the tables of comparisons."""

from typing import Any

from resdepth_colmap.evaluation.markdown import table
from scripts.benchmarks.tables.compare import (
    CLOUDS,
    METRICS,
    PAIRED,
    cloud_rows,
    difference,
    paired_rows,
)

VIEWS = {"mean": 0.25, "interval": [0.1, 0.4], "num_better": 3, "num_worse": 0}


def scores(accuracy: float) -> dict[str, Any]:
    return {
        "tolerances": [0.05, 0.1],
        "accuracy": [accuracy, 1.0],
        "completeness": [0.4, 1.0],
        "f1": [0.554, 1.0],
        "num_points": 1234,
    }


def result(has_reference: bool = True) -> dict[str, Any]:
    ours = {
        method: {"num_points": 1234, "scores": scores(0.9) if has_reference else None}
        for method in ("filtered", "refined")
    }
    colmap = {"filtered": {"num_points": None, "note": "no tracks", "scores": None}}
    return {
        "methods": ["filtered", "refined"],
        "clouds": {"open3d": ours, "colmap": colmap},
        "paired": {"refined - filtered": {"coverage": {"views": VIEWS}}},
    }


def test_each_method_has_the_scores_at_the_smallest_tolerance() -> None:
    text = table(CLOUDS, cloud_rows({"results": {"room": result()}}))
    cells = "1,234 | 90.0 % | 40.0 % | 55.4 % | - | - | - | - |"
    assert f"| room | filtered | 0.05 | {cells}" in text
    assert f"| room | refined | 0.05 | {cells}" in text


def test_without_a_reference_cloud_there_is_no_row() -> None:
    measured = {"results": {"plant": result(has_reference=False)}}
    assert list(cloud_rows(measured)) == []


def test_each_pair_of_methods_has_its_differences_with_their_intervals() -> None:
    text = table(PAIRED, paired_rows({"results": {"plant": result()}}))
    dashes = " | ".join(["-"] * (len(METRICS) - 1))
    assert text.endswith(
        f"| plant | refined - filtered | +25.0 [10.0, 40.0] | {dashes} |"
    )


def test_what_was_not_measured_has_no_difference() -> None:
    assert difference(None) is None
    assert difference({**VIEWS, "mean": None}) is None
    assert difference({**VIEWS, "interval": None}) == "+25.0"
