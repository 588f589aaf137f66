"""What a writer of a format gets: an FRF in the quantity and the unit of the file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Frf
from dovetail.measurement.frf_units import meaning_of_unit


@dataclass(frozen=True)
class FrfToWrite:
    """An FRF in the quantity and the unit of the file to write.

    Parameters
    ----------
    frf : Frf
        In the quantity of the file.
    unit : str
        Of the values in the file.
    factor : float
        From the unit of the file to SI.
    """

    frf: Frf
    unit: str
    factor: float

    @property
    def values(self) -> NDArray[np.complex128]:
        """(n_freq,) values in the file's unit."""
        return self.frf.values if self.factor == 1.0 else self.frf.values / self.factor

    @property
    def variance(self) -> NDArray[np.float64] | None:
        """(n_freq,) variance in the square of the file's unit, if the FRF has one."""
        return None if self.frf.variance is None else self.frf.variance / self.factor**2


def prepare_for_writing(frf: Frf, path: Path, unit: str | None) -> FrfToWrite:
    """Return an FRF for writing, in a given unit or in SI.

    Raises
    ------
    MeasurementError
        A coherence that is not finite, a unit that is not one of an FRF, or that of a displacement for a rotation.
    """
    if frf.coherence is not None and not np.all(np.isfinite(frf.coherence)):
        raise MeasurementError(Fault(str(path), f"the coherence of {frf.label} is not finite: nothing is written."))
    if unit is None:
        return FrfToWrite(frf, frf.unit, 1.0)
    meaning = meaning_of_unit(unit, "the argument unit")
    if meaning.kind != (frf.rotation, frf.by_moment):
        problem = f"{frf.label} is a {frf.kind}, and '{unit}' is no unit of that."
        raise MeasurementError(Fault("the argument unit", problem))
    return FrfToWrite(frf.to(meaning.quantity), unit, meaning.factor)
