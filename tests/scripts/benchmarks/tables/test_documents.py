"""Laws of the tables, and whether the documents show what was measured."""

from pathlib import Path
from typing import Any

import pytest

from scripts.benchmarks.tables.documents import (
    DOCUMENTS,
    agreement_table,
    filled_in,
    middlebury_summary,
    middlebury_table,
    refine_table,
    rendered,
    workspaces_table,
)

REPOSITORY = Path(__file__).resolve().parents[4]
PLACES = [(document, name) for document in DOCUMENTS for name in DOCUMENTS[document]]


@pytest.mark.parametrize(("document", "name"), PLACES)
def test_the_documents_show_what_was_measured(document: str, name: str) -> None:
    path = REPOSITORY / document
    if not path.is_file() or f"<!-- {name} -->" not in path.read_text("utf-8"):
        pytest.skip(f"{document} has no place for {name}")
    places = rendered(document, REPOSITORY / "docs" / "measurements")
    if name not in places:
        pytest.skip(f"docs/measurements/{name}.json is not there: not measured yet")
    text = path.read_text("utf-8")
    assert filled_in(text, {name: places[name]}) == text, "run make_tables"


def errors(mae: float | None) -> dict[str, Any]:
    values = {"rmse": 0.5, "medae": 0.0123, "bad_1": 0.3, "bad_2": 0.25}
    return {"mae": mae, "num_valid": 12345, **values}


def middlebury(refined_mae: float | None = 0.1) -> dict[str, Any]:
    scene = {
        "unfiltered": errors(0.2),
        "median": errors(0.15),
        "refined": errors(refined_mae),
        "unfiltered_seen_by_both": {**errors(0.05), "median_relative_error": 0.0034},
        "matching_cpu_s_per_mp": 21.0,
        "refining_cpu_s_per_mp": 1.5,
    }
    return {
        "command": "python bench.py",
        "date": "2026-01-02",
        "weights_sha256": "0123456789abcdef",
        "options": {"refine": {"inner_iterations": 2}},
        "scenes": {"Teddy": scene, "Pipes": {**scene, "unfiltered": errors(0.4)}},
        "mean": {"mae_ratio": 0.375, "medae_ratio": None},
    }


def columns(table: str) -> set[int]:
    """The numbers of columns that the lines of a table have: one, if it is sound."""
    return {line.count("|") for line in table.splitlines() if line.startswith("|")}


def test_every_scene_and_the_mean_have_their_errors() -> None:
    text = middlebury_table(middlebury())
    assert "| Teddy | unfiltered | 0.200 | 0.500 | 12.3 | 25.0 % | 12,345 |" in text
    assert "| **mean** | unfiltered | 0.300 |" in text
    assert "| Teddy | 0.34 % | 30.0 % | 25.0 % | 0.050 | 21.0 | 1.5 |" in text
    assert "`python bench.py` on 2026-01-02" in text


def test_the_summary_has_one_row_a_scene() -> None:
    text = middlebury_summary(middlebury())
    assert "| Teddy | 0.200 | 0.150 | 0.100 | 25.0 % | 25.0 % |" in text
    assert "| **mean** | 0.300 | 0.150 | 0.100 |" in text
    assert "2 scenes, 2 passes: MAE 0.38 (the worst scene 0.50), MedAE - (" in text
    assert "fewer pixels off by more than 2 % in 0 of 2" in text
    assert len(columns(text)) == 1


def test_an_error_that_is_missing_is_a_dash_in_its_mean_too() -> None:
    text = middlebury_summary(middlebury(refined_mae=None))
    assert "| Teddy | 0.200 | 0.150 | - |" in text
    assert "| **mean** | 0.300 | 0.150 | - |" in text


def test_workspaces_share_the_columns_of_all_their_stages() -> None:
    sample = {
        "options": ["--input", "geometric"],
        "num_images": 4,
        "seconds": {"stereo": 1.0, "refine": 2.25},
        "seconds_in_all": 4.0,
        "peak_memory_mb": 1536,
        "points_before": 1000,
        "points_after": 2500,
        "filled_before": 0.5,
        "filled_after": 1.0,
    }
    other = {
        **sample,
        "options": [],
        "seconds": {"fuse": 3.0},
        "peak_memory_mb": None,
        "points_before": None,
        "date": "2026-01-02",
    }
    text = workspaces_table({"plant": sample, "walnut": other})
    assert len(columns(text)) == 1
    assert (
        "| plant | `--input geometric` | 4 | 1.0 | 2.2 | - | 4.0 | 1.5 GiB | "
        "1,000 | 2,500 | 50 % | 100 % | - |"
    ) in text
    assert (
        "| walnut |  | 4 | - | - | 3.0 | 4.0 | - | "
        "- | 2,500 | 50 % | 100 % | 2026-01-02 |"
    ) in text


def test_each_size_has_its_seconds() -> None:
    size = {"width_px": 704, "height_px": 496, "megapixels": 0.349}
    times = {"seconds": [1.0, 2.0, 3.0], "s_per_mp_and_pass": 5.727}
    text = refine_table({**middlebury(), "sizes": [{**size, **times}]})
    assert "| 704 x 496 | 0.35 | 5.73 | 1.0 2.0 3.0 |" in text
    assert len(columns(text)) == 1


def test_only_the_place_is_filled_and_filling_twice_is_filling_once() -> None:
    text = "before\n<!-- a -->\nold\n<!-- /a -->\nafter\n<!-- b --><!-- /b -->\n"
    once = filled_in(text, {"a": "new \\1", "missing": "x"})
    expected = "before\n<!-- a -->\n\nnew \\1\n\n<!-- /a -->\nafter\n"
    assert once == f"{expected}<!-- b --><!-- /b -->\n"
    assert filled_in(once, {"a": "new \\1"}) == once


@pytest.mark.parametrize(
    "text",
    [
        "<!-- a -->",
        "<!-- /a -->",
        "<!-- /a --><!-- a -->",
        "<!-- a --><!-- a --><!-- /a -->",
    ],
)
def test_a_broken_place_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="expected one <!-- a -->"):
        filled_in(text, {"a": "new"})


def test_what_was_not_measured_has_no_text(tmp_path: Path) -> None:
    assert rendered("docs/benchmarks.md", tmp_path) == {}


def test_the_agreement_has_one_row_an_image_and_both_arms_side_by_side() -> None:
    limits = ("within_1", "within_2", "within_5")
    image = {
        "known": 0.5,
        "unfiltered": dict(zip(limits, (0.8, 0.85, 0.9), strict=True)),
        "refined": dict(zip(limits, (0.81, 0.86, 0.91), strict=True)),
    }
    measured = {**middlebury(), "images": {"a.png": image, "b.png": image}}
    text = agreement_table(measured)
    assert (
        "| a.png | 50.0 % | 80.0 % | 81.0 % | 85.0 % | 86.0 % | 90.0 % | 91.0 % |"
        in (text)
    )
    assert columns(text) == {9}
