"""When two sets of answers count as the same."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.testing.outcomes import Nonconformity

__all__ = ["require_alike"]

_OF_DEVIATION = 1e-4
"""Of a column's standard deviation, since features are standardised: single precision, and the order of a sum."""
_OF_SIZE = 1e-6
"""Of a column's greatest value: eight times the rounding of single precision."""


def require_alike(answers: NDArray[Any], wanted: NDArray[Any], problem: str, remedy: str) -> None:
    """Raise where answers (n_samples, n_columns) differ from those wanted by more than single precision."""
    if answers.shape == wanted.shape:
        expected = wanted.astype(np.float64)
        tolerance = _OF_DEVIATION * expected.std(axis=0) + _OF_SIZE * np.abs(expected).max(axis=0)
        if bool((np.abs(answers - expected) <= tolerance).all()):
            return
    raise Nonconformity(f"{problem}.", remedy)
