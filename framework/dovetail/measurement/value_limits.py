"""Limits of what a file may state: beyond them squares, products and powers of the values would not be finite."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.frf import HIGHEST_FREQUENCY, LARGEST_VALUE, MOST_AVERAGES

__all__ = ["check_size"]


def check_size(
    arrays: Mapping[str, NDArray[Any] | None],
    first: int,
    factor: float,
    averages: int | None,
    locate: Callable[[int], str],
) -> None:
    """Check that the values of an FRF can be computed with.

    Parameters
    ----------
    arrays : mapping of str to (n_freq,) array or None
        "frequency" [Hz], "value" and "variance" in the file's unit.
    first : int
        The first line that is used.
    factor : float
        Positive; converts the values to SI.
    averages : int or None
    locate : callable
        Returns the place in the file of the line with an index.

    Raises
    ------
    MeasurementError
        The first value that is too large, with its place in the file.
    """
    limits = {
        "frequency": HIGHEST_FREQUENCY,
        "value": LARGEST_VALUE / factor,
        "variance": (LARGEST_VALUE / factor) ** 2,
    }
    for name, array in arrays.items():
        if array is None:
            continue
        beyond = np.flatnonzero(np.abs(array[first:]) > limits[name]) + first
        if beyond.size:
            more = f" ({beyond.size} such lines)" if beyond.size > 1 else ""
            problem = f"the {name} is {np.abs(array[beyond[0]]):.3g}, which no structure has{more}."
            remedy = "Correct the unit or the columns, or remove these lines."
            raise MeasurementError(Fault(locate(int(beyond[0])), problem, f"up to {limits[name]:.3g}", remedy))
    values = arrays["value"]
    if values is not None and 0.0 < (largest := float(np.abs(values[first:]).max()) * factor) < 1.0 / LARGEST_VALUE:
        place = locate(first + int(np.argmax(np.abs(values[first:]))))
        problem = f"the largest value is {largest:.3g} in SI, which no structure has."
        raise MeasurementError(
            Fault(place, problem, f"from {1.0 / LARGEST_VALUE:g}", "Correct the unit or the columns.")
        )
    if averages is not None and not 1 <= averages <= MOST_AVERAGES:
        problem = f"{str(averages)[:40]} is not a number of averages."
        raise MeasurementError(Fault(locate(first), problem, f"1 to {MOST_AVERAGES:,}"))
