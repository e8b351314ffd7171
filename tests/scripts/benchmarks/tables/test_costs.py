"""Laws of the tables of commands, workspaces and cloud scores."""

from typing import Any

from resdepth_colmap.evaluation.markdown import table
from scripts.benchmarks.tables.costs import (
    CLOUDS,
    COMMANDS,
    WORKSPACES,
    cloud_note,
    cloud_rows,
    refine_note,
    workspace_rows,
)


def test_each_command_has_its_seconds_and_memory() -> None:
    row = {
        "command": "report plant",
        "what": "4 views",
        "seconds": 1.26,
        "cpu_seconds": 2.0,
        "peak_memory_mb": 512.0,
    }
    assert table(COMMANDS, [row]).endswith(
        "| `report plant` | 4 views | 1.3 | 2.0 | 0.50 |"
    )


def test_each_size_has_its_seconds() -> None:
    size = {"width_px": 704, "height_px": 496, "s_per_mp_and_inner_iteration": 1.873}
    assert "1.87 s at 704 x 496 px" in refine_note({}, {"sizes": [size]})


def test_a_workspace_has_what_was_there_before_and_after() -> None:
    sample = {
        "options": ["--input", "geometric"],
        "num_images": 4,
        "seconds": {"stereo": 1.0, "refine": 2.25},
        "seconds_in_all": 4.0,
        "peak_memory_mb": None,
        "points_before": 1000,
        "points_after": 2500,
        "filled_before": 0.5,
        "filled_after": 1.0,
        "date": "2026-01-02",
    }
    text = table(WORKSPACES, workspace_rows({"workspaces": {"plant": sample}}))
    assert text.endswith(
        "| plant | `refine --input geometric` | 4 | 1.0 | 2.2 | 4.0 | - | 1,000 | "
        "2,500 | 50 % | 100 % | 2026-01-02 |"
    )


def clouds() -> dict[str, Any]:
    scores = {"accuracy": [0.5, 0.75], "completeness": [0.25, 1.0], "f1": [0.3, 0.8]}
    ours = {**scores, "f1": [0.302, 0.8]}
    sample = {"tolerances": [0.01, 0.5], "official": scores, "ours": ours}
    size = {"num_points": 1000000, "seconds": 4.56, "peak_memory_mb": 512}
    return {
        "samples": {"two_scans": sample, "exact": {**sample, "ours": scores}},
        "sizes": [size],
    }


def test_each_sample_has_the_largest_difference_from_the_official_scores() -> None:
    text = table(CLOUDS, cloud_rows(clouds()))
    assert "| two scans | 2, 0.01 to 0.5 | 30.000 % | 30.200 % | 0.2000 |" in text
    assert "| exact | 2, 0.01 to 0.5 | 30.000 % | 30.000 % | 0.0000 |" in text
    assert "1,000,000 points 4.6 s and 0.50 GiB" in cloud_note(clouds())
