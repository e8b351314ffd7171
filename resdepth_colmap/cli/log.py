"""The log and the progress bars: all on stderr, so that stdout is data alone."""

import contextlib
import functools
import logging
from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

    from resdepth_colmap.progress import Advance

LEVELS = (logging.ERROR, logging.WARNING, logging.INFO, logging.DEBUG)
USUAL = 2  # index of INFO

logger = logging.getLogger("resdepth_colmap")


@functools.cache
def stderr_console() -> "Console":
    """The one console of log and bars: a line of the log goes above the bars."""
    from rich.console import Console

    return Console(stderr=True, highlight=False)


def start_log(verbosity: int) -> None:
    """Show the package's log on stderr.

    Args:
        verbosity: 0 = what the program does; +1 per -v, -1 per -q.
    """
    from rich.logging import RichHandler

    level = LEVELS[min(max(USUAL + verbosity, 0), len(LEVELS) - 1)]
    handler = RichHandler(
        console=stderr_console(), show_path=False, show_time=False, highlighter=None
    )
    logger.handlers = [handler]  # replaced, not added: tests run many commands
    logger.setLevel(level)


class BarProgress:
    """Draws each stage of the pipeline as a bar with the time left."""

    def __init__(self) -> None:
        """Draw nothing yet."""
        self._bars: Progress | None = None

    @contextlib.contextmanager
    def stage(self, title: str, total: int) -> "Iterator[Advance]":
        """Show a bar while the stage lasts; see `pipeline.progress.Progress`."""
        with self._running() as bars:
            task = bars.add_task(title, total=total)
            try:
                yield lambda units: bars.advance(task, units)
            finally:
                bars.stop_task(task)

    @contextlib.contextmanager
    def _running(self) -> "Iterator[Progress]":
        if self._bars is not None:  # a stage within a stage
            yield self._bars
            return
        with _bars() as self._bars:
            try:
                yield self._bars
            finally:
                self._bars = None


def _bars() -> "Progress":
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=stderr_console(),
        disable=not (
            stderr_console().is_terminal and logger.isEnabledFor(logging.INFO)
        ),
    )
