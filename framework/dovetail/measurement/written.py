"""An FRF as it is written to a file: checked, and in the unit that is wanted."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Frf
from dovetail.measurement.unit_labels import meaning_of_unit

__all__ = ["Written", "prepared"]


@dataclass(frozen=True)
class Written:
    """What every writer needs.

    Parameters
    ----------
    frf : Frf
        In the quantity of the file.
    unit : str
        Of the values in the file.
    factor : float
        SI for one unit of the file.
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
        """(n_freq,) variance in the square of the file's unit, where the FRF has one."""
        return None if self.frf.variance is None else self.frf.variance / self.factor**2


def prepared(frf: Frf, path: Path, unit: str | None) -> Written:
    """Return what is written for an FRF, in a unit or in SI.

    Raises
    ------
    MeasurementError
        A coherence that is not finite, a unit that is none of an FRF, a displacement's unit for a rotation.
    """
    if frf.coherence is not None and not np.all(np.isfinite(frf.coherence)):
        raise MeasurementError(Fault(str(path), f"the coherence of {frf.label} is not finite: nothing is written."))
    if unit is None:
        return Written(frf, frf.unit, 1.0)
    meaning = meaning_of_unit(unit, "the argument unit")
    if meaning.rotation != frf.rotation:
        kind = "a rotation per moment" if frf.rotation else "a displacement per force"
        raise MeasurementError(Fault("the argument unit", f"{frf.label} is {kind}, and '{unit}' is no unit of that."))
    return Written(frf.to(meaning.quantity), unit, meaning.factor)
