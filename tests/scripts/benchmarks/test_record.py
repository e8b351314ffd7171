"""Laws of the records that benchmarks write."""

from pathlib import Path

import pytest

from scripts.benchmarks import record
from scripts.benchmarks.record import parser, read, rounded, stamp, write


def test_what_is_written_is_read_and_nothing_is_an_empty_record(tmp_path: Path) -> None:
    path = tmp_path / "new" / "record.json"
    assert read(path) == {}
    write(path, {"a": [1, None]})
    assert read(path) == {"a": [1, None]}


def test_floats_are_rounded_wherever_they_are() -> None:
    assert rounded({"a": [0.123456789, 1], "b": {"c": "x", "d": 2.5}}, 3) == {
        "a": [0.123, 1],
        "b": {"c": "x", "d": 2.5},
    }


def test_a_record_says_how_when_and_on_what_it_was_measured(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(record, "hardware", lambda: "a CPU")
    head = stamp("refine --passes 2")
    assert head["command"] == "python -m scripts.benchmarks.refine --passes 2"
    assert head["hardware"] == "a CPU"
    assert len(head["date"]) == 10
    assert "torch" in head["versions"]


def test_each_benchmark_writes_its_record_unless_told_otherwise() -> None:
    default = parser("x", "refine", reads_data=False).parse_args([])
    assert default.output == record.MEASUREMENTS / "refine.json"
    assert not hasattr(default, "data")
    given = parser("x", "cloud").parse_args(["--output", "/tmp/x.json", "--data", "d"])
    assert (given.output, given.data) == (Path("/tmp/x.json"), Path("d"))
