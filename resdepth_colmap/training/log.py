"""The log of a training: a CSV file, and TensorBoard's where it is installed."""

import csv
import importlib.util
import io
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from resdepth_colmap.io.files import write_whole
from resdepth_colmap.io.png import is_zlib_sound
from resdepth_colmap.scene import ColorImage

if TYPE_CHECKING:
    from torch.utils.tensorboard import SummaryWriter

CSV_NAME = "log.csv"
TENSORBOARD_FOLDER = "tensorboard"
MEASURES = ("mae_ratio", "medae_ratio", "off_ratio")
COLUMNS = (
    "step",
    "learning_rate",
    "loss",
    "held_out_loss",
    *(f"held_out_{measure}" for measure in MEASURES),
    *(f"watched_{measure}" for measure in MEASURES),
    "seconds",
)

Row = dict[str, float]
"""Values by column; what was not measured is left out."""


class TrainingLog:
    """Lines of a log; each is on disk as soon as it is added.

    Args:
        folder: Folder of the files; an existing log is continued.
        step: Step from which the training resumes: later lines are dropped.
        with_tensorboard: Write for TensorBoard too, if it is installed.
    """

    def __init__(self, folder: Path, step: int, with_tensorboard: bool) -> None:  # noqa: D107
        self.path = folder / CSV_NAME
        self.rows = [row for row in _read(self.path) if row["step"] <= step]
        self._board: SummaryWriter | None = None
        if with_tensorboard and importlib.util.find_spec("tensorboard") is not None:
            from torch.utils import tensorboard

            self._board = tensorboard.SummaryWriter(
                str(folder / TENSORBOARD_FOLDER), purge_step=step or None
            )

    def add(self, row: Mapping[str, float]) -> None:
        """Add a line; values that are NaN are left out.

        Raises:
            WorkspaceError: If the file cannot be written.
        """
        known = _known(row)
        self.rows.append(known)
        text = io.StringIO()
        writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
        writer.writeheader()
        for line in self.rows:
            shown = {name: f"{value:.6g}" for name, value in line.items()}
            writer.writerow({**shown, "step": int(line["step"])})
        write_whole(self.path, text.getvalue().encode())
        if self._board is not None:
            for name, value in known.items():
                if name != "step":
                    self._board.add_scalar(name, value, int(known["step"]))
            self._board.flush()

    def add_picture(self, name: str, rgb: ColorImage, step: int) -> None:
        """Show a picture in TensorBoard, where it is safe to make a PNG of it."""
        if self._board is not None and is_zlib_sound():
            self._board.add_image(name, rgb, step, dataformats="HWC")

    def close(self) -> None:
        """Write what is left."""
        if self._board is not None:
            self._board.close()


def _read(path: Path) -> list[Row]:
    """The lines of a log; what is no number is left out."""
    if not path.is_file():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        rows = [
            {name: _number(line.get(name)) for name in COLUMNS}
            for line in csv.DictReader(file)
        ]
    return [row for row in map(_known, rows) if "step" in row]


def _known(row: Mapping[str, float]) -> Row:
    return {name: value for name, value in row.items() if not math.isnan(value)}


def _number(text: str | None) -> float:
    try:
        return float(text or "nan")
    except ValueError:
        return math.nan
