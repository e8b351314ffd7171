"""The documents' tables, and the blocks that hold them.

A block is the text between `<!-- name -->` and `<!-- /name -->`.
"""

import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from resdepth_colmap.evaluation.markdown import Column, Measured, table
from scripts.benchmarks.record import read
from scripts.benchmarks.tables import (
    cases,
    compare,
    costs,
    depth,
    matching,
    variants,
)
from scripts.benchmarks.tables.model_card import short_hash, training_text, weights_text

WIDTH = 160
Renderer = Callable[..., str]


class Block(NamedTuple):
    """A block of a document.

    Attributes:
        names: Names of the records in docs/measurements/.
        render: Makes its text of the records.
    """

    names: tuple[str, ...]
    render: Renderer


def block(
    names: Sequence[str],
    shown: Sequence[Column],
    rows: Callable[..., Iterable[Any]],
    note: Renderer | None = None,
) -> Block:
    """A block of one table, and the sentence that says where its figures are from.

    Args:
        names: Names of the records.
        shown: The columns of the table.
        rows: Makes the rows of the records.
        note: Makes a further sentence of the records.
    """

    def render(*records: Measured) -> str:
        notes = [note(*records)] if note is not None else []
        text = " ".join([*notes, measured_by(*records)])
        lines = textwrap.fill(
            text, WIDTH, break_long_words=False, break_on_hyphens=False
        )
        return f"{table(shown, rows(*records))}\n\n{lines}"

    return Block(tuple(names), render)


SCENES = (depth.SCENES, depth.scene_rows, depth.ratio_note)
ACCURACY = (
    "middlebury",
    "middlebury_rounds_1",
    "middlebury_passes_2",
    "middlebury_no_update_gating",
    "middlebury_without_network",
    "middlebury_like_colmap",
    "held_out",
    "held_out_rounds_1",
    "held_out_rounds_2",
    "held_out_like_colmap",
)
DOCUMENTS: dict[str, dict[str, Block]] = {
    "README.md": {"middlebury": block(["middlebury"], *SCENES)},
    "docs/benchmarks.md": {
        "accuracy": block(ACCURACY, depth.ACCURACY, depth.accuracy_rows),
        "near_colmap": block(
            ["agreement", "matching"], matching.NEAR_COLMAP, matching.near_colmap_rows
        ),
        "workspaces": block(["workspaces"], costs.WORKSPACES, costs.workspace_rows),
        "cases": block(["cases"], cases.CASES, cases.case_rows),
        "clouds": block(["compare"], compare.CLOUDS, compare.cloud_rows),
        "paired": block(["compare"], compare.PAIRED, compare.paired_rows),
        "matching": block(["matching"], matching.TRUTH, matching.truth_rows),
        "matcher_cost": block(
            ["matching", "stereo_memory"],
            matching.SPEED,
            matching.speed_rows,
            matching.memory_note,
        ),
        "variants": block(
            ["variants", "additions"],
            variants.COLUMNS,
            variants.variant_rows,
            variants.budget_note,
        ),
        "cloud": block(["cloud"], costs.CLOUDS, costs.cloud_rows, costs.cloud_note),
        "costs": block(
            ["commands", "refine"],
            costs.COMMANDS,
            lambda commands, _: commands["commands"],
            costs.refine_note,
        ),
    },
    "docs/model_card.md": {
        "weights": Block(("weights",), weights_text),
        "training": Block(("training",), training_text),
        "middlebury": block(["middlebury"], *SCENES),
        "middlebury_like_colmap": block(["middlebury_like_colmap"], *SCENES),
    },
}


def measured_by(*records: Measured) -> str:
    """By which commands, when, on which machine and with which weights."""
    commands, machines = (
        list(dict.fromkeys(record[key] for record in records))
        for key in ("command", "hardware")
    )
    dates = {date for record in records for date in _dates(record)}
    if len(commands) > 2:  # they differ in scenes and options, which the rows show
        commands = [" ".join([*commands[0].split()[:3], "..."])]
    text = (
        f"Measured by {' and '.join(f'`{name}`' for name in commands)} on "
        f"{' and '.join(sorted(dates))}; {' and '.join(machines)}"
    )
    weights = records[0].get("weights_sha256")
    return f"{text}; weights `{short_hash(weights)}`." if weights else f"{text}."


def _dates(value: Any) -> Iterator[str]:
    """The dates of a record and of the parts that are measured apart."""
    if isinstance(value, Mapping):
        for key, part in value.items():
            yield from [part] if key == "date" else _dates(part)


def rendered(document: str, measurements: Path) -> dict[str, str]:
    """Text of each block of a document whose records exist.

    Args:
        document: Path in the repository.
        measurements: Folder of the records.
    """
    texts = {}
    for name, it in DOCUMENTS[document].items():
        records = [read(measurements / f"{record}.json") for record in it.names]
        if all(records):
            texts[name] = it.render(*records)
    return texts


def filled_in(text: str, blocks: Mapping[str, str]) -> str:
    """A document with its blocks filled; those that it does not have are left out.

    Raises:
        ValueError: If a block begins and does not end, or the other way round.
    """
    for name, content in blocks.items():
        start, end = f"<!-- {name} -->", f"<!-- /{name} -->"
        if start not in text and end not in text:
            continue
        before, _, rest = text.partition(start)
        _, found, after = rest.partition(end)
        if text.count(start) != 1 or text.count(end) != 1 or not found:
            raise ValueError(f"expected one {start} and one {end} after it.")
        text = f"{before}{start}\n{content}\n{end}{after}"
    return text
