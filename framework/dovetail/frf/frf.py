"""A frequency response function: frequency axis, complex values and what they are."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.errors import MeasurementError
from dovetail.frf.quantity import QUANTITIES, Quantity, conversion

__all__ = ["Frf"]


def _frozen(values: ArrayLike, dtype: type[np.generic]) -> NDArray[np.generic]:
    array = np.array(values, dtype=dtype)
    array.flags.writeable = False
    return array


@dataclass(frozen=True, eq=False)
class Frf:
    """One drive-point or transfer FRF.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz, positive and strictly increasing.
    values : (n_freq,) complex array
        SI, in `quantity`. Real and non-negative when `has_phase` is false.
    quantity : {"receptance", "mobility", "accelerance"}
    coherence : (n_freq,) array, optional
        Ordinary coherence of the measurement, from 0 to 1.
    has_phase : bool
        False for a measurement of the amplitude alone.
    label : str
        Where it comes from, for figures and reports.
    note : str
        What its file says of it in words.

    Raises
    ------
    MeasurementError
        Wrong shapes, values that are not finite, an axis that does not increase, an unknown quantity.
    """

    frequency: NDArray[np.float64]
    values: NDArray[np.complex128]
    quantity: Quantity
    coherence: NDArray[np.float64] | None = None
    has_phase: bool = True
    label: str = field(default="FRF")
    note: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "frequency", _frozen(self.frequency, np.float64))
        object.__setattr__(self, "values", _frozen(self.values, np.complex128))
        if self.coherence is not None:
            object.__setattr__(self, "coherence", _frozen(self.coherence, np.float64))
        self._check()

    def _check(self) -> None:
        if self.quantity not in QUANTITIES:
            raise MeasurementError(f"'{self.quantity}' is not a quantity; accepted: {', '.join(QUANTITIES)}.")
        if self.frequency.ndim != 1 or self.frequency.size == 0:
            raise MeasurementError(
                f"{self.label}: the frequencies have the shape {self.frequency.shape}, not (n_freq,)."
            )
        if self.values.shape != self.frequency.shape:
            raise MeasurementError(
                f"{self.label}: {self.values.shape} values do not fit {self.frequency.shape} frequencies."
            )
        if self.coherence is not None and self.coherence.shape != self.frequency.shape:
            raise MeasurementError(
                f"{self.label}: {self.coherence.shape} coherences do not fit {self.frequency.shape} frequencies."
            )
        for name, array in (("frequency", self.frequency), ("value", self.values)):
            bad = np.flatnonzero(~np.isfinite(array))
            if bad.size:
                raise MeasurementError(
                    f"{self.label}: the {name} of line {bad[0] + 1} is not finite ({bad.size} such lines)."
                )
        falling = np.flatnonzero(np.diff(self.frequency) <= 0)
        if falling.size:
            raise MeasurementError(
                f"{self.label}: the frequency does not increase after line {falling[0] + 1} "
                f"({self.frequency[falling[0]]:g} Hz, then {self.frequency[falling[0] + 1]:g} Hz)."
            )
        if self.frequency[0] <= 0:
            raise MeasurementError(
                f"{self.label}: the first frequency is {self.frequency[0]:g} Hz; it must be positive."
            )

    @property
    def amplitude(self) -> NDArray[np.float64]:
        """(n_freq,) magnitude, in the SI unit of the quantity."""
        return np.abs(self.values)

    @property
    def phase(self) -> NDArray[np.float64]:
        """(n_freq,) phase in radians, from -pi to pi."""
        return np.angle(self.values)

    def to(self, quantity: Quantity) -> Frf:
        """Return the same FRF as another quantity (a factor of i omega for each derivative)."""
        if quantity not in QUANTITIES:
            raise MeasurementError(f"'{quantity}' is not a quantity; accepted: {', '.join(QUANTITIES)}.")
        factor = conversion(self.frequency, self.quantity, quantity)
        values = self.values * (factor if self.has_phase else np.abs(factor))
        return replace(self, values=values, quantity=quantity)
