"""Laws of the table of the matcher's memory."""

from typing import Any

from scripts.benchmarks.tables.stereo_memory import stereo_memory_table


def run(views: int, peak_mb: float, *tenths_mb: float) -> dict[str, Any]:
    run: dict[str, Any] = {"views": views, "peak_memory_mb": peak_mb}
    return {**run, "tenths_mb": list(tenths_mb)} if tenths_mb else run


def series(*runs: dict[str, Any]) -> dict[str, Any]:
    options = {"cache_size": 0.25}
    said = {"command": "python x.py", "date": "2026-01-02", "options": options}
    return {**said, "runs": list(runs)}


def test_memory_is_told_by_size_and_number_of_views() -> None:
    large = series(run(12, 1026.4))
    small = series(run(7, 90, 70, 80), run(9, 92, 71, 81))
    text = stereo_memory_table({"sizes": {"1632 x 1224": large, "512 x 512": small}})
    assert "| 1632 x 1224 | 12 | 256.0 | 1026 | - |" in text
    assert "| 512 x 512 | 9 | 256.0 | 92 | 81 |" in text
    assert len({row.count("|") for row in text.splitlines() if row[0:1] == "|"}) == 1


def test_growth_is_told_beside_one_map_a_view() -> None:
    runs = series(run(100, 200, 91, 102), run(12, 200, 91, 90), run(24, 200, 120, 1))
    text = stereo_memory_table({"sizes": {"512 x 256": runs}})
    assert "from 12 to 100 of them" in text
    # 11 MiB over 88 views are 0.125 MiB a view; a map of floats has 0.5 MiB.
    assert "+11.0 MiB, +0.25 of one map of 0.50 MiB" in text
    assert "it is 91.0, 102.0 MiB" in text


def test_a_single_run_tells_no_growth_and_the_start_is_told_where_measured() -> None:
    measured: dict[str, Any] = {"sizes": {"64 x 64": series(run(12, 91))}}
    text = stereo_memory_table(measured)
    assert "changes by" not in text
    assert "compiled" not in text
    start = {"cold_s": 30.4, "warm_s": 2.34}
    text = stereo_memory_table({**measured, "start": start})
    assert "30 s with nothing compiled, 2.3 s" in text
