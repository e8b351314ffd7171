"""Laws of the log: what is in it, and what a resumed training leaves of it."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from resdepth_colmap.training.curves import draw_curves
from resdepth_colmap.training.log import COLUMNS, TrainingLog


def row(step: int, **values: float) -> dict[str, float]:
    return {"step": step, "loss": 1.0 / step, "learning_rate": 1e-3, **values}


def test_what_is_added_is_on_disk_at_once(tmp_path: Path) -> None:
    log = TrainingLog(tmp_path, 0, with_tensorboard=False)
    log.add(row(2, held_out_mae_ratio=0.5, watched_mae_ratio=math.nan))
    lines = (tmp_path / "log.csv").read_text().splitlines()
    assert lines[0].split(",") == list(COLUMNS)
    values = dict(zip(COLUMNS, lines[1].split(","), strict=True))
    assert values["step"] == "2"
    assert values["held_out_mae_ratio"] == "0.5"
    assert values["watched_mae_ratio"] == values["held_out_loss"] == ""


def test_lines_of_steps_that_were_lost_are_left_out(tmp_path: Path) -> None:
    log = TrainingLog(tmp_path, 0, with_tensorboard=False)
    for step in (2, 4, 6):
        log.add(row(step))
    again = TrainingLog(tmp_path, 4, with_tensorboard=False)
    assert [line["step"] for line in again.rows] == [2, 4]
    again.add(row(6))
    assert len((tmp_path / "log.csv").read_text().splitlines()) == 4


def test_a_log_of_an_early_version_is_gone_on_with(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("step,loss,held_out_loss\n3,0.7,nan\n")
    log = TrainingLog(tmp_path, 3, with_tensorboard=False)
    assert log.rows == [{"step": 3, "loss": 0.7}]


def test_tensorboard_has_every_value_and_picture(tmp_path: Path) -> None:
    accumulator = pytest.importorskip(
        "tensorboard.backend.event_processing.event_accumulator"
    )
    log = TrainingLog(tmp_path, 0, with_tensorboard=True)
    for step in (2, 4):
        log.add(row(step))
    log.add_picture("view", np.zeros((4, 6, 3), np.uint8), 4)
    log.close()
    events = accumulator.EventAccumulator(str(tmp_path / "tensorboard"))
    events.Reload()
    points = [(point.step, point.value) for point in events.Scalars("loss")]
    assert points == [(2, 0.5), (4, 0.25)]
    assert events.Images("view")[0].width == 6


def test_without_tensorboard_there_is_the_csv_file_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "tensorboard", None)
    log = TrainingLog(tmp_path, 0, with_tensorboard=True)
    log.add(row(2))
    log.close()
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]


def test_curves_have_a_panel_for_what_was_measured() -> None:
    few = draw_curves([row(2), row(4)])
    more = draw_curves([row(2), row(4, held_out_mae_ratio=0.5)])
    assert few.dtype == np.uint8
    assert few.shape[1:] == more.shape[1:] == (800, 3)
    assert more.shape[0] > few.shape[0]
    assert draw_curves([]).shape[2] == 3
