"""Laws of the table of the paper's variants."""

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from resdepth_colmap.evaluation.variant_tables import (
    ARMS,
    WORST_FIRST,
    out_of_order,
    variants_table,
)


def measured(**maes: float) -> dict[str, Any]:
    arms = {
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
        "training": {"batch_size": 4},
        "network": {"base_channels": 16, "max_channels": 128},
        "sets": {"rendered": {"num_views": 7, "arms": arms}},
    }


def test_every_variant_has_a_row_in_the_papers_order() -> None:
    text = variants_table(measured(**dict.fromkeys(reversed(ARMS), 0.1)))
    lines = [line for line in text.splitlines() if line.startswith("| ")][1:]
    assert [line.split(" | ")[0][2:] for line in lines] == list(ARMS.values())
    assert "| 0.100 | 0.500 | 12.3 | 25.0 % | 0.90 | 1.10 |" in lines[0]
    assert "3,000 steps of 4 crops from 40 rendered scenes, 16 to 128" in text


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
