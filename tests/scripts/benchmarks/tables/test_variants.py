"""Laws of the table of variants."""

from typing import Any

from resdepth_colmap.evaluation.markdown import table
from scripts.benchmarks.tables.variants import (
    ADDITIONS,
    COLUMNS,
    PAPER,
    budget_note,
    variant_rows,
)
from scripts.benchmarks.variants import methods


def measured(*names: str) -> dict[str, Any]:
    errors = {"mae_ratio": 0.9, "medae_ratio": 1.1, "bad_2": 0.25}
    return {
        "steps": 3000,
        "num_scenes": 40,
        "training": {"batch_size": 4, "crop_px": 256, "learning_rate": 0.001},
        "network": {"base_channels": 16, "max_channels": 128},
        "sets": {"rendered": {"methods": dict.fromkeys(names, errors)}},
    }


def labels(text: str) -> list[str]:
    return [line.split(" | ")[0][2:] for line in text.splitlines()[2:]]


def test_every_network_has_a_row_in_order() -> None:
    records = (measured(*reversed(PAPER)), measured(*ADDITIONS))
    text = table(COLUMNS, variant_rows(*records))
    assert labels(text) == [*PAPER.values(), *ADDITIONS.values()]
    assert text.splitlines()[2].endswith("| 0.90 | 1.10 | 25.0 % | - | - | - |")


def test_a_network_that_was_not_trained_has_no_row() -> None:
    rows = variant_rows(measured("unfiltered", "resdepth_0"), measured("gate"))
    assert labels(table(COLUMNS, rows)) == [
        PAPER["unfiltered"],
        PAPER["resdepth_0"],
        ADDITIONS["gate"],
    ]


def test_the_rows_are_networks_that_are_trained() -> None:
    trained = {*methods.PAPER, methods.ITERATED, "unfiltered", "median"}
    assert set(PAPER) == trained
    assert set(ADDITIONS) - {"two_inner_iterations"} < set(methods.ADDITIONS)


def test_the_budget_is_named() -> None:
    assert budget_note(measured(), measured()) == (
        "Each network: 3,000 steps of 4 crops of 256 px from 40 rooms, learning rate "
        "0.001, 16 to 128 channels."
    )
