"""Laws of the tables of the paper's variants, and of what is beyond the paper."""

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from scripts.benchmarks.tables.variants import (
    BEYOND,
    METHODS,
    WORST_FIRST,
    beyond_table,
    out_of_order,
    variants_table,
)


def measured(**maes: float) -> dict[str, Any]:
    methods = {
        name: {
            "mae": mae,
            "rmse": 0.5,
            "medae": 0.0123,
            "bad_2": 0.25,
            "mae_ratio": 0.9,
            "medae_ratio": 1.1,
        }
        for name, mae in maes.items()
    }
    return {
        "command": "python bench.py",
        "date": "2026-01-02",
        "hardware": "a machine",
        "steps": 3000,
        "num_scenes": 40,
        "training": {"batch_size": 4, "crop_px": 256, "learning_rate": 0.001},
        "network": {
            "base_channels": 16,
            "max_channels": 128,
            "normalisation": "baseline",
        },
        "sets": {"rendered": {"num_views": 7, "methods": methods}},
    }


def test_every_variant_has_a_row_in_the_papers_order() -> None:
    text = variants_table(measured(**dict.fromkeys(reversed(METHODS), 0.1)))
    lines = [line for line in text.splitlines() if line.startswith("| ")][1:]
    assert [line.split(" | ")[0][2:] for line in lines] == list(METHODS.values())
    assert "| 0.100 | 0.500 | 12.3 | 25.0 % | 0.90 | 1.10 |" in lines[0]
    assert (
        "3,000 steps of 4 crops of 256 px from 40 rendered scenes, learning rate "
        "0.001, 16 to 128 channels. Its inverse depth: times the baseline" in text
    )


def test_the_table_says_whether_the_order_is_the_papers() -> None:
    falling = {name: 1.0 / (1 + place) for place, name in enumerate(WORST_FIRST)}
    assert "The order is the paper's." in variants_table(measured(**falling))
    swapped = {**falling, "resdepth_0": 0.01}
    text = variants_table(measured(**swapped))
    assert "Unlike in the paper: ResDepth-0 beats ResDepth-mono; " in text


@given(st.permutations(WORST_FIRST))
def test_a_list_is_in_order_only_if_it_is_the_papers(names: list[str]) -> None:
    maes = {name: 1.0 - 0.1 * place for place, name in enumerate(names)}
    assert (out_of_order(maes) == []) == (tuple(names) == WORST_FIRST)


def test_every_addition_has_a_row_with_the_ratios_of_all_sets() -> None:
    one = measured(**dict.fromkeys(BEYOND, 0.1))
    rendered = one["sets"]["rendered"]
    both = {**one, "sets": {"middlebury": {**rendered, "num_views": 5}, **one["sets"]}}
    for found, num_ratios in ((one, 3), (both, 6)):
        text = beyond_table(found)
        lines = [line for line in text.splitlines() if line.startswith("|")]
        assert [line.split(" | ")[0][2:] for line in lines[2:]] == list(BEYOND.values())
        assert {line.count("|") for line in lines} == {num_ratios + 2}
        assert "| 0.90 | 1.10 | 25.0 % |" in lines[2]
    assert "held-out rendered scenes, 7 views" in text
    assert "Middlebury, 5 views" in text


def test_an_addition_that_was_not_trained_has_no_row() -> None:
    text = beyond_table(measured(unfiltered=0.1, robust=0.1))
    assert BEYOND["robust"] in text
    assert BEYOND["gate"] not in text


def test_it_is_told_what_each_addition_changed_against_the_row_before() -> None:
    found = measured(unfiltered=0.1, resdepth_stereo=0.1, robust=0.1, inputs=0.1)
    methods = found["sets"]["rendered"]["methods"]
    methods["robust"]["mae_ratio"] = 0.7  # 0.9 before
    methods["inputs"] |= {"mae_ratio": 0.75, "medae_ratio": 1.11}  # 0.7, 1.1 before
    text = beyond_table(found)
    assert "MAE ratio lower with robust normalisation (-0.20), higher with " in text
    assert (
        "inputs (+0.05). MedAE ratio lower with nothing, higher with nothing." in text
    )
