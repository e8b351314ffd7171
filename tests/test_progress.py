"""Laws of the progress listeners."""

import pytest

from resdepth_colmap.progress import Progress, SilentProgress


def test_silence_accepts_any_report_and_says_nothing(
    capsys: pytest.CaptureFixture[str],
) -> None:
    progress: Progress = SilentProgress()
    with progress.stage("Matching", 3) as advance:
        advance(0.5)
        advance(10.0)
    assert capsys.readouterr() == ("", "")


def test_stages_may_be_nested_and_repeated() -> None:
    progress = SilentProgress()
    for _ in range(2):
        with progress.stage("outer", 1) as outer, progress.stage("inner", 2) as inner:
            inner(1.0)
            outer(1.0)
