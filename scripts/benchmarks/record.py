"""Where benchmarks read data and write figures, and what a record says of itself."""

import argparse
import datetime
import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).resolve().parents[2]
MEASUREMENTS = REPOSITORY / "docs" / "measurements"
DATA = Path(os.environ.get("RESDEPTH_DATA", REPOSITORY.parent / "shared" / "data"))
BUILD = REPOSITORY / "build"
_HARDWARE = "from resdepth_colmap.versions import hardware; print(hardware())"


def parser(
    description: str | None, name: str, reads_data: bool = True
) -> argparse.ArgumentParser:
    """The command line of a benchmark, with --output and --data.

    Args:
        description: The docstring of its module.
        name: Name of its file in docs/measurements/, without suffix.
        reads_data: Whether it reads the real data.
    """
    made = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    result = MEASUREMENTS / f"{name}.json"
    made.add_argument("--output", type=Path, default=result, help="JSON file to write")
    if reads_data:
        made.add_argument("--data", type=Path, default=DATA, help="the real data")
    return made


def today() -> str:
    """The date in UTC, as 2026-01-31."""
    return datetime.datetime.now(datetime.UTC).date().isoformat()


def hardware() -> str:
    """`versions.hardware` of another process: torch takes no memory of this one."""
    command = [sys.executable, "-c", _HARDWARE]
    return subprocess.check_output(command, text=True, cwd=REPOSITORY).strip()


def stamp(command: str) -> dict[str, Any]:
    """The head of a record: command, date, hardware and versions.

    Args:
        command: Module and options after "python -m scripts.benchmarks.".
    """
    from resdepth_colmap.versions import versions

    return {
        "command": f"python -m scripts.benchmarks.{command}",
        "date": today(),
        "hardware": hardware(),
        "versions": versions(),
    }


def read(path: Path) -> dict[str, Any]:
    """A record written earlier; empty where there is none."""
    if not path.exists():
        return {}
    found: dict[str, Any] = json.loads(path.read_text("utf-8"))
    return found


def write(path: Path, measured: Mapping[str, Any]) -> None:
    """Write a record; its folder is made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(measured, indent=2) + "\n", "utf-8")
    print(f"wrote {path}", flush=True)


def rounded(value: Any, digits: int = 6) -> Any:
    """The same value with every float in it rounded."""
    if isinstance(value, dict):
        return {key: rounded(part, digits) for key, part in value.items()}
    if isinstance(value, list):
        return [rounded(part, digits) for part in value]
    return round(value, digits) if isinstance(value, float) else value
