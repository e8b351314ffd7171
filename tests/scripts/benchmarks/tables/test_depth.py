"""Laws of the tables of the refined depth."""

from typing import Any

from resdepth_colmap.evaluation.markdown import table
from scripts.benchmarks.tables.depth import (
    ACCURACY,
    SCENES,
    accuracy_rows,
    ratio_note,
    scene_rows,
)


def errors(mae: float | None, bad_2: float = 0.25) -> dict[str, Any]:
    return {"mae": mae, "rmse": 0.5, "medae": 0.0123, "bad_2": bad_2}


def measured(refined_mae: float | None = 0.1) -> dict[str, Any]:
    scene = {
        "unfiltered": errors(0.2),
        "median": errors(0.15),
        "refined": errors(refined_mae),
    }
    better = {**scene, "unfiltered": errors(0.4), "refined": errors(refined_mae, 0.2)}
    return {
        "command": "resdepth-colmap evaluate depth middlebury --rounds 1",
        "scenes": {"Teddy": scene, "Pipes": better},
        "mean": {"mae_ratio": 0.375, "medae_ratio": None},
    }


def test_each_scene_and_the_mean_have_a_row() -> None:
    text = table(SCENES, scene_rows(measured()))
    assert "| Teddy | 0.200 | 0.150 | 0.100 | 25.0 % | 25.0 % |" in text
    assert "| **mean** | 0.300 | 0.150 | 0.100 | 25.0 % | 22.5 % |" in text


def test_the_note_has_the_mean_ratios_and_those_of_the_worst_scene() -> None:
    note = ratio_note(measured())
    assert "MAE 0.38 (0.50), MedAE - (1.00); " in note
    assert "fewer pixels off by > 2 % in 1 of 2 scenes" in note


def test_an_error_that_is_missing_is_a_dash_in_its_mean_too() -> None:
    text = table(SCENES, scene_rows(measured(refined_mae=None)))
    assert "| Teddy | 0.200 | 0.150 | - |" in text
    assert "| **mean** | 0.300 | 0.150 | - |" in text


def test_each_record_is_a_row_with_its_scenes_and_options() -> None:
    text = table(ACCURACY, accuracy_rows(measured(), measured(0.2)))
    head, _, first, second = text.splitlines()
    assert first.startswith("| `middlebury --rounds 1` | 0.300 | 0.150 | 0.100 |")
    assert first.endswith("| 0.38 | 0.50 | - | 1.00 | 1 of 2 |")
    assert "| 0.38 | 1.00 |" in second
    assert {line.count("|") for line in (head, first, second)} == {head.count("|")}
