"""Ctrl-C as a request to stop and give what there is."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from dovetail.cli.terminal import note_from_handler

if TYPE_CHECKING:
    from types import FrameType

    from dovetail.interfaces import TimeLimit


@contextmanager
def stopped_by_interrupt(limit: TimeLimit) -> Iterator[None]:
    """Stop the work with a time limit on the first Ctrl-C; the second raises KeyboardInterrupt, as without this.

    Nothing changes where Ctrl-C is ignored, as in a command that a shell runs in the background, or outside of the main
    thread.
    """
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or before is not signal.default_int_handler:
        yield
        return

    def stop(_number: int, _frame: FrameType | None) -> None:
        signal.signal(signal.SIGINT, before)
        limit.stop()
        note_from_handler("\nStopping with what there is. Ctrl-C again ends at once.\n")

    signal.signal(signal.SIGINT, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
