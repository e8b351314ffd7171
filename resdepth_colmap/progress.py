"""Progress reports of long computations.

The pipeline reports stages; the command line draws them.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Protocol

Advance = Callable[[float], None]
"""Advances a stage by a number of units: a step, not a position."""


class Progress(Protocol):
    """A listener to stages of known length."""

    def stage(self, title: str, total: int) -> AbstractContextManager[Advance]:
        """Open a stage.

        Args:
            title: Name of the stage, for the user ("Refining").
            total: Number of units of the stage; fractions of one may be reported.

        Returns:
            A context manager for the stage; it yields the function that advances it.
            Leaving it ends the stage, whatever was reported.
        """


class SilentProgress:
    """A listener that ignores everything: for the library and for tests."""

    def stage(self, title: str, total: int) -> AbstractContextManager[Advance]:
        """Open a stage that is not shown; see `Progress.stage`."""
        return nullcontext(_ignore)


def _ignore(units: float) -> None:
    """Ignore the report."""
