"""The tolerance within which two sets of results agree."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.testing.outcomes import Nonconformity

_DEVIATION_SHARE = 1e-4
"""Tolerance relative to a column's standard deviation, for rounding and the order of sums in single precision."""
_SIZE_SHARE = 1e-6
"""Tolerance relative to a column's largest value: eight times the rounding of single precision."""


def require_agreement(answers: NDArray[Any], reference: NDArray[Any], problem: str, remedy: str) -> None:
    """Raise a Nonconformity if answers (n_samples, n_columns) differ from `reference` by more than single precision."""
    if answers.shape == reference.shape:
        expected = reference.astype(np.float64)
        tolerance = _DEVIATION_SHARE * expected.std(axis=0) + _SIZE_SHARE * np.abs(expected).max(axis=0)
        if bool((np.abs(answers - expected) <= tolerance).all()):
            return
    raise Nonconformity(f"{problem}.", remedy)
