"""The log of a training: a CSV file, and TensorBoard's where it is installed."""

import csv
import importlib.util
import io
import logging
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

logger = logging.getLogger(__name__)


class TrainingLog:
    """Lines of a log; each is on disk as soon as it is added."""

    def __init__(self, folder: Path, step: int, with_tensorboard: bool) -> None:
        """Go on with the log in a folder, or begin one.

        Args:
            folder: Where the files are.
            step: Where the training goes on: later lines are of steps that were lost.
            with_tensorboard: Write for TensorBoard too, if it is installed.
        """
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
        known = {key: value for key, value in row.items() if not math.isnan(value)}
        self.rows.append(known)
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(COLUMNS)
        for line in self.rows:
            writer.writerow([_shown(name, line.get(name)) for name in COLUMNS])
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
    if not path.is_file():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    rows = [
        {name: float(text) for name, text in line.items() if name and _is_number(text)}
        for line in lines
    ]
    return [row for row in rows if "step" in row]


def _is_number(text: str | None) -> bool:
    try:
        return text is not None and not math.isnan(float(text))
    except ValueError:
        return False


def _shown(name: str, value: float | None) -> str:
    if value is None:
        return ""
    return str(int(value)) if name == "step" else f"{value:.6g}"
