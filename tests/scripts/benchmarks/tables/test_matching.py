"""Laws of the tables of the matcher."""

from typing import Any

import pytest

from resdepth_colmap.evaluation.markdown import table
from scripts.benchmarks.tables.matching import (
    NEAR_COLMAP,
    OPENMVS,
    SPEED,
    TRUTH,
    memory_note,
    near_colmap_rows,
    speed_rows,
    truth_rows,
)

ERRORS = {"0.01": 0.75, "0.02": 0.875, "0.05": 0.95, "median": 0.00123}
PART = {
    "maps": {
        name: {"photometric": {**ERRORS, "0.01": share}, "geometric": ERRORS}
        for name, share in (("a.jpg", 0.5), ("b.jpg", 0.7))
    },
    "mean": {"photometric": ERRORS, "geometric": {**ERRORS, "0.01": 0.8}},
    "cpu_s_per_map": {"photometric": 12.34, "geometric": None},
}


def run(megapixels: float, num_sources: int) -> dict[str, Any]:
    times = {"cpu_s": 4.0, "cpu_s_per_mp_source_iteration": 3.21}
    return {"megapixels": megapixels, "num_sources": num_sources, **times}


def measured() -> dict[str, Any]:
    cloud = {"true_points": 1000, "min_num_pixels=5": {"f1": 0.847}}
    rendered = {
        "date": "2026-01-02",
        "rendered_rich": {**PART, "cloud": cloud},
        "rendered_weak": PART,
    }
    speed = {
        "sizes": [run(0.3, 1), run(0.75, 1), run(1.5, 1)],
        "sources": [run(0.3, 1), run(0.3, 2)],
        "bounds": {"arithmetic_s": 2.0, "memory_s": 0.01, "ours_s": 4.0},
    }
    plant = {"own_range": PART}
    return {"middlebury": PART, "rendered": rendered, "plant": plant, "speed": speed}


def test_cited_figures_stand_beside_ours() -> None:
    text = table(TRUTH, truth_rows(measured()))
    ours = "25.0 % | 0.123 % | 12.3 | 20.0 % | 0.123 % | -"
    assert f"| middlebury | {ours} | 26.1 % | 0.287 % | 7.3 | - |" in text
    assert f"| rendered rich | {ours} | 6.2 % | 0.015 % | 27.0 | 84.7 % |" in text
    assert len(text.splitlines()) == 2 + len(OPENMVS)


def test_agreement_with_colmap_is_the_mean_and_the_worst_of_the_images() -> None:
    shares = {"within_2": 0.8, "within_5": 0.9}
    images = {
        name: {
            "unfiltered": {"within_1": before, **shares},
            "refined": {"within_1": 0.7, **shares},
        }
        for name, before in (("a.jpg", 0.5), ("b.jpg", 0.6))
    }
    text = table(NEAR_COLMAP, near_colmap_rows({"images": images}, measured()))
    rest = "80.0 % | 90.0 % |"
    assert f"| COLMAP's, unfiltered | 55.0 % | {rest} 50.0 % | 60.0 % |" in text
    assert f"| the same, refined | 70.0 % | {rest} 70.0 % | 70.0 % |" in text
    assert "photometric | 60.0 % | 87.5 % | 95.0 % | 50.0 % | 70.0 % |" in text


def test_every_other_size_and_number_of_sources_is_shown() -> None:
    text = table(SPEED, speed_rows(measured(), {}))
    assert [line[:12] for line in text.splitlines()[2:]] == [
        "| 0.30 | 1 |",
        "| 1.50 | 1 |",
        "| 0.30 | 2 |",
    ]


@pytest.mark.parametrize("larger", ["1632 x 1224", "240 x 180"])
def test_memory_is_that_of_the_largest_views(larger: str) -> None:
    peaks_mb = {100: 2e3, 12: 9}
    runs = [{"views": count, "peak_memory_mb": mb} for count, mb in peaks_mb.items()]
    memory = {
        "sizes": {"64 x 48": {"runs": []}, larger: {"runs": runs}},
        "start": {"cold_s": 30.4, "warm_s": 2.34},
    }
    note = memory_note(measured(), memory)
    assert f"views of {larger} px: 9 MiB for 12, 2,000 MiB for 100." in note
    assert "30 s with nothing compiled, 2.3 s" in note
    assert "bound for two sources: 2.00 s, of 4.00 s measured" in note
