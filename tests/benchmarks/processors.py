"""The processor time of a benchmark, with that of the processes that it starts."""

from __future__ import annotations

import os
import time


def processor_time() -> float:
    """Return the processor time [s] of this process and of those that it has started and that have ended."""
    return time.process_time() + sum(os.times()[2:4])
