"""The state of a fitted reducer or regressor: arrays and plain values, nothing that could be code."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

__all__ = ["State"]

StateValue = NDArray[np.generic] | int | float | str | bool
State = Mapping[str, StateValue]
"""Name to array, number, text or truth value; arrays go to safetensors, the others to JSON."""
