from typing import Any

import pytest

from scripts.benchmarks.tables.cloud import cloud_table, largest_difference


def measured() -> dict[str, Any]:
    scores = {"accuracy": [0.5, 0.75], "completeness": [0.25, 1.0], "f1": [0.3, 0.8]}
    ours = {**scores, "f1": [0.302, 0.8]}
    sample = {"tolerances": [0.01, 0.5], "official": scores, "ours": ours}
    size = {"num_points": 1000000, "num_scan_points": 2000, "seconds": 4.56}
    times = {"cpu_seconds": 3.21, "peak_memory_mb": 512}
    return {
        "command": "python bench.py",
        "date": "2026-01-02",
        "samples": {"two_scans": sample, "exact": {**sample, "ours": scores}},
        "sizes": [{**size, **times}],
    }


def test_every_score_has_the_official_one_beside_it() -> None:
    text = cloud_table(measured())
    cells = "50.000 % | 50.000 % | 25.000 % | 25.000 % | 30.000 % | 30.200 %"
    assert f"| two scans | 0.01 | {cells} |" in text
    assert text.count("| exact |") == 2
    assert "| 1,000,000 | 2,000 | 4.6 | 3.2 | 0.50 GiB |" in text
    assert "`python bench.py` on 2026-01-02" in text
    first, second = (part for part in text.split("\n\n") if part.startswith("|"))
    for table in (first, second):
        assert len({line.count("|") for line in table.splitlines()}) == 1


def test_the_largest_difference_is_found_and_told() -> None:
    assert largest_difference(measured()) == pytest.approx(0.002)
    assert "score: 0.2000 percentage points" in cloud_table(measured())
