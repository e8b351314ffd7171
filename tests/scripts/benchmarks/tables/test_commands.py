"""The table of what each command takes."""

from scripts.benchmarks.tables.commands import command_table


def test_each_command_has_its_row_with_seconds_and_memory() -> None:
    row = {
        "command": "report plant",
        "what": "4 views",
        "seconds": 1.26,
        "cpu_seconds": 2.0,
        "peak_memory_mb": 512.0,
    }
    table = command_table({"command": "bench", "date": "2026-01-01", "commands": [row]})
    assert table.splitlines()[0].startswith("Measured by `bench` on 2026-01-01")
    assert table.endswith("| `report plant` | 4 views | 1.3 | 2.0 | 0.50 GiB |")
