"""The tolerance within which two sets of results count as the same."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.testing.outcomes import Nonconformity

_OF_DEVIATION = 1e-4
"""Relative to a column's standard deviation, since features are standardised: single precision, and order of sums."""
_OF_SIZE = 1e-6
"""Relative to a column's largest value: eight times the rounding of single precision."""


def require_alike(answers: NDArray[Any], wanted: NDArray[Any], problem: str, remedy: str) -> None:
    """Raise a Nonconformity if answers (n_samples, n_columns) differ from `wanted` by more than single precision."""
    if answers.shape == wanted.shape:
        expected = wanted.astype(np.float64)
        tolerance = _OF_DEVIATION * expected.std(axis=0) + _OF_SIZE * np.abs(expected).max(axis=0)
        if bool((np.abs(answers - expected) <= tolerance).all()):
            return
    raise Nonconformity(f"{problem}.", remedy)
