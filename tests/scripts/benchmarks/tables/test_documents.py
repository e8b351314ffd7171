"""Whether the documents show what was measured, and how blocks are filled."""

import json
from pathlib import Path
from typing import Any

import pytest

from resdepth_colmap.evaluation.markdown import Column
from scripts.benchmarks.record import MEASUREMENTS, REPOSITORY
from scripts.benchmarks.tables.documents import (
    DOCUMENTS,
    WIDTH,
    block,
    filled_in,
    measured_by,
    rendered,
)

BLOCKS = [(document, name) for document in DOCUMENTS for name in DOCUMENTS[document]]
MAX_LINES = 200


@pytest.mark.parametrize(("document", "name"), BLOCKS)
def test_the_documents_show_what_was_measured(document: str, name: str) -> None:
    text = (REPOSITORY / document).read_text("utf-8")
    content = rendered(document, MEASUREMENTS)[name]
    assert f"<!-- {name} -->" in text
    assert filled_in(text, {name: content}) == text, "run make_tables"


def test_every_record_is_in_a_document() -> None:
    shown = {
        name
        for blocks in DOCUMENTS.values()
        for block in blocks.values()
        for name in block.names
    }
    assert {path.stem for path in MEASUREMENTS.glob("*.json")} == shown


def test_every_record_names_a_command_of_today_and_its_machine() -> None:
    for path in MEASUREMENTS.glob("*.json"):
        record = json.loads(path.read_text("utf-8"))
        if path.stem == "weights":
            continue
        assert record["hardware"], path
        module = record.get("command", "").partition("python -m ")[2].split(" ")[0]
        if module:
            file = REPOSITORY / f"{module.replace('.', '/')}.py"
            assert file.is_file() or file.with_suffix("").is_dir(), path


def test_the_benchmarks_stay_short() -> None:
    lines = (REPOSITORY / "docs" / "benchmarks.md").read_text("utf-8").splitlines()
    assert len(lines) <= MAX_LINES
    assert all(len(line) <= WIDTH for line in lines if not line.startswith("|"))


def record(**changes: Any) -> dict[str, Any]:
    plain = {"command": "python bench.py", "date": "2026-01-02", "hardware": "a CPU"}
    return {**plain, **changes}


def test_the_origin_of_figures_is_named_once() -> None:
    assert measured_by(record(), record()) == (
        "Measured by `python bench.py` on 2026-01-02; a CPU."
    )
    other = record(command="python other.py", parts={"a": {"date": "2025-12-31"}})
    assert measured_by(record(weights_sha256="0123456789abcdef"), other) == (
        "Measured by `python bench.py` and `python other.py` on 2025-12-31 and "
        "2026-01-02; a CPU; weights `0123456789ab`."
    )


def test_commands_that_rows_show_are_not_repeated() -> None:
    commands = ("evaluate depth", "evaluate depth x --rounds 1", "evaluate depth y")
    records = [record(command=f"resdepth-colmap {command}") for command in commands]
    assert measured_by(*records).startswith(
        "Measured by `resdepth-colmap evaluate depth ...` on "
    )


def test_a_block_is_a_table_a_note_and_the_origin() -> None:
    columns = [Column("n", "n", ",")]
    made = block(["x"], columns, lambda it: it["rows"], lambda _: "Note.")
    text = made.render(record(rows=[{"n": 1000}]))
    assert text == (
        "| n |\n|--:|\n| 1,000 |\n\n"
        "Note. Measured by `python bench.py` on 2026-01-02; a CPU."
    )


def test_only_the_block_is_filled_and_filling_twice_is_filling_once() -> None:
    text = "before\n<!-- a -->\nold\n<!-- /a -->\nafter\n<!-- b --><!-- /b -->\n"
    once = filled_in(text, {"a": "new \\1", "missing": "x"})
    expected = "before\n<!-- a -->\nnew \\1\n<!-- /a -->\nafter\n"
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
def test_a_broken_block_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="expected one <!-- a -->"):
        filled_in(text, {"a": "new"})


def test_what_was_not_measured_has_no_text(tmp_path: Path) -> None:
    assert rendered("docs/benchmarks.md", tmp_path) == {}
