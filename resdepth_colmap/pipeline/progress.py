"""How a long computation tells somebody else how far it is, without knowing who listens.

The pipeline reports stages; the command line draws them. Nothing below the command line prints.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Protocol

Advance = Callable[[float], None]


class Progress(Protocol):
    """A listener that is told about stages of known length."""

    def stage(self, title: str, total: int) -> AbstractContextManager[Advance]:
        """Opens a stage.

        Args:
            title: what is being done, to be read by the user ("Refining").
            total: number of units the stage consists of; fractions of a unit may be reported.

        Returns:
            A context manager which is the stage. It yields a callable that advances the stage by so
            many units (not to a position); leaving the context ends the stage, whatever was reported.
        """


class SilentProgress:
    """A listener that ignores everything: for library use and tests."""

    def stage(self, title: str, total: int) -> AbstractContextManager[Advance]:
        """Opens a stage nobody watches; see Progress.stage."""
        return nullcontext(_ignore)


def _ignore(units: float) -> None:
    """Takes the report and does nothing with it."""
