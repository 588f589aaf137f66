"""Waiting for other processes and threads on a machine that may stand still for a minute or more."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Callable

PATIENCE = 300.0
"""Seconds after which a wait is given up. A safety net, which only ends a test that would otherwise never end: a test
whose subject is a time counts processor time, sets the clock, or checks what limit was passed on."""


def wait_until(condition: Callable[[], object], process: subprocess.Popen[bytes] | None = None) -> None:
    """Wait until a condition holds, while a process that is needed for it runs."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert process is None or process.poll() is None, process.communicate()
        assert time.monotonic() < end, "never true"
        time.sleep(0.02)


def processor_time() -> float:
    """Seconds that the processors have worked for this process and for the children that have ended."""
    return time.process_time() + sum(os.times()[2:4])
