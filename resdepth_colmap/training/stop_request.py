"""Ctrl-C and SIGTERM, kept until a step is whole."""

import contextlib
import logging
import signal
import threading
from collections.abc import Iterator
from types import FrameType

logger = logging.getLogger(__name__)

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class StopRequest:
    """Whether somebody asked to stop."""

    def __init__(self) -> None:
        """Nobody did yet."""
        self.is_made = False

    def receive(self, number: int, _frame: FrameType | None) -> None:
        """Take the signal; a second one does not wait.

        Raises:
            KeyboardInterrupt: On the second signal.
        """
        if self.is_made:
            raise KeyboardInterrupt
        self.is_made = True
        name = signal.Signals(number).name
        logger.info("%s: saving after this step; once more to stop at once.", name)


@contextlib.contextmanager
def stop_request() -> Iterator[StopRequest]:
    """Take SIGINT and SIGTERM for the time of the block.

    Outside the main thread Python takes no signals; the request is then never made.
    """
    request = StopRequest()
    if threading.current_thread() is not threading.main_thread():
        yield request
        return
    before = {number: signal.signal(number, request.receive) for number in SIGNALS}
    try:
        yield request
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
