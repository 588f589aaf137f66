"""The processor time of a benchmark, with that of the processes that it starts; benchmarks run from any folder."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from support.waiting import processor_time

__all__ = ["processor_time"]
