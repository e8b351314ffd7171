"""Ctrl-C and SIGTERM, deferred to the end of a step."""

import contextlib
import logging
import signal
import threading
from collections.abc import Iterator
from types import FrameType

logger = logging.getLogger(__name__)

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class StopRequest:
    """Whether a signal asks the training to stop.

    Attributes:
        is_made: Whether it does.
    """

    is_made = False

    def receive(self, number: int, _frame: FrameType | None) -> None:
        """Handle a signal.

        Raises:
            KeyboardInterrupt: On the second one, which does not wait.
        """
        if self.is_made:
            raise KeyboardInterrupt
        self.is_made = True
        name = signal.Signals(number).name
        logger.info("%s: saving after this step; repeat it to stop at once.", name)


@contextlib.contextmanager
def stop_request() -> Iterator[StopRequest]:
    """Handle SIGINT and SIGTERM within the block.

    Outside the main thread, where Python handles no signals, the request is never made.
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
