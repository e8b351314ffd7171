"""The tables that documents show of comparisons."""

from typing import Any

from scripts.benchmarks.tables.compare import comparison_table, score_gains


def result(num_points: int | None = 1234) -> dict[str, Any]:
    before = {"tolerances": [0.05], "accuracy": [0.9], "completeness": [0.4]}
    after = {"tolerances": [0.05], "accuracy": [0.88], "completeness": [0.7]}
    cloud = {"num_points": num_points, "note": "", "seconds": 1.0}
    none = {"num_points": None, "note": "no tracks", "scores": None}
    clouds = {
        "filtered": {**cloud, "scores": {**before, "f1": [0.554]}},
        "refined": {**cloud, "scores": {**after, "f1": [0.78]}},
    }
    views = {
        "num_pairs": 3,
        "mean": 0.25,
        "median": 0.2,
        "num_better": 3,
        "num_worse": 0,
        "interval": [0.1, 0.4],
    }
    return {
        "fusion": {"open3d": {"min_num_views": 3}, "colmap": {"min_num_pixels": 3}},
        "clouds": {"open3d": clouds, "colmap": {"filtered": none, "refined": none}},
        "measures": {"filtered": {"coverage": 0.5}, "refined": {"coverage": 0.75}},
        "paired": {"refined - filtered": {"coverage": {"views": views}}},
        "notes": ["a word"],
        "cost": {"compare": {"seconds": 12.34, "peak_memory_mb": 512}},
    }


def measured() -> dict[str, Any]:
    return {
        "command": "python bench.py",
        "date": "2026-01-02",
        "weights_sha256": "0123456789abcdef",
        "results": {"plant": result()},
    }


def test_scores_differences_and_costs_have_their_rows() -> None:
    text = comparison_table(measured())
    row = "| plant | ours | filtered | 1,234 | 0.05 | 90.0 % | 40.0 % | 55.4 % |"
    assert row in text
    assert "| plant | COLMAP's | refined | - | - | - | - | - |" in text
    assert "| plant | ours | 0.05 | -2.0 | +30.0 | +22.6 |" in text
    assert (
        "| plant | coverage | refined - filtered | 50.0 | - | 75.0 | "
        "25.0 | 10.0 | 40.0 | 3 | 0 |"
    ) in text
    assert "| plant | compare | 12.3 | 0.50 GiB |" in text
    assert "- plant: COLMAP's fusion: no tracks." in text
    assert "`min_num_views` 3" in text


def test_each_table_has_one_number_of_columns() -> None:
    for part in comparison_table(measured()).split("\n\n"):
        lines = [line for line in part.splitlines() if line.startswith("|")]
        assert len({line.count("|") for line in lines}) <= 1


def test_no_gain_is_said_without_scores() -> None:
    assert list(score_gains(result(), "colmap")) == []
    unscored = result()
    del unscored["clouds"]["open3d"]["filtered"]
    assert list(score_gains(unscored, "open3d")) == []
