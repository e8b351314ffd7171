"""Laws of the commands whose cost is counted."""

from pathlib import Path

import pytest

from scripts.benchmarks.program import run


def test_a_command_has_its_cost(tmp_path: Path) -> None:
    cost = run("--version", folder=tmp_path, quiet=True)
    assert 0 < cost["cpu_seconds"] < 60
    assert 0 < cost["seconds"] < 60
    assert cost["peak_memory_mb"] > 5


def test_a_command_that_fails_shows_why(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="No such command"):
        run("no-such-command", folder=tmp_path, quiet=True)
