"""What all tests share: the manner of hypothesis, and where the real data lies."""

import os
from collections.abc import Callable
from pathlib import Path

import hypothesis
import pytest

# One slow example on a busy machine is no failure; the same examples on each run.
hypothesis.settings.register_profile(
    "resdepth",
    deadline=None,
    derandomize=True,
    max_examples=25,
    suppress_health_check=[hypothesis.HealthCheck.function_scoped_fixture],
)
hypothesis.settings.load_profile("resdepth")

REPOSITORY = Path(__file__).resolve().parents[1]


@pytest.fixture
def shared_data() -> Callable[[str], Path]:
    """Finds a folder of the real data; the test is skipped where it is absent."""

    def find(name: str) -> Path:
        default = REPOSITORY.parent / "shared" / "data"
        path = Path(os.environ.get("RESDEPTH_DATA", default)) / name
        if not path.is_dir():
            pytest.skip(f"no {name} in the real data (set RESDEPTH_DATA to its folder)")
        return path

    return find
