"""The state of a fitted reducer or regressor: arrays and plain values, never code."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

StateValue = NDArray[np.generic] | int | float | str | bool
ComponentState = Mapping[str, StateValue]
"""Arrays, numbers, texts or booleans by name; arrays are stored as safetensors, the others as JSON."""
