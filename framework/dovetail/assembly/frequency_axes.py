"""The frequencies of an assembly's responses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.errors import Fault, ParameterError


def checked_axis(frequency: ArrayLike) -> NDArray[np.float64]:
    """Return frequencies (n_freq,) as an array.

    Raises
    ------
    ParameterError
        They are no row of positive numbers that increase.
    """
    axis = np.asarray(frequency, dtype=np.float64)
    accepted = "(n_freq,) numbers in Hz, positive and increasing"
    if axis.ndim != 1:
        raise ParameterError(Fault("frequency", f"its shape is {axis.shape}.", accepted))
    before = np.concatenate([[0.0], axis[:-1]])
    wrong = np.flatnonzero(~(np.isfinite(axis) & (axis > before)))
    if wrong.size:
        first = int(wrong[0])
        problem = f"line {first + 1} is {axis[first]:g} Hz" + (f", after {axis[first - 1]:g} Hz." if first else ".")
        raise ParameterError(Fault("frequency", problem, accepted))
    return axis


def same_axes(some: Sequence[NDArray[np.float64]], others: Sequence[NDArray[np.float64]]) -> bool:
    """Return whether the frequencies of all responses are equal, one to one."""
    return all(one is other or np.array_equal(one, other) for one, other in zip(some, others, strict=True))
