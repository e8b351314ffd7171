"""How a long computation says how far it is, without knowing who listens.

The pipeline reports stages; the command line draws them.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Protocol

Advance = Callable[[float], None]
"""Advances a stage by so many units (it is a step, not a position)."""


class Progress(Protocol):
    """A listener that is told about stages of known length."""

    def stage(self, title: str, total: int) -> AbstractContextManager[Advance]:
        """Open a stage.

        Args:
            title: What is being done, for the user to read ("Refining").
            total: Number of units of the stage; fractions of one may be reported.

        Returns:
            A context manager that is the stage; it yields what advances the stage.
            Leaving it ends the stage, whatever was reported.
        """


class SilentProgress:
    """A listener that ignores everything: for the library and for tests."""

    def stage(self, title: str, total: int) -> AbstractContextManager[Advance]:
        """Open a stage that nobody watches; see `Progress.stage`."""
        return nullcontext(_ignore)


def _ignore(units: float) -> None:
    """Take the report and do nothing with it."""
