"""The mass of the accelerometer that was on the structure while it was measured."""

from __future__ import annotations

import math
from dataclasses import replace

from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Frf

__all__ = ["add_accelerometer_mass", "remove_accelerometer_mass"]


def remove_accelerometer_mass(frf: Frf, mass: float) -> Frf:
    """Return the drive-point FRF that the structure has without the accelerometer.

    Parameters
    ----------
    frf : Frf
        Measured with the accelerometer at the drive point; any quantity, with phase.
    mass : float
        kg, zero or more.

    Returns
    -------
    Frf
        In the quantity of `frf`: A / (1 - m A), where A is the measured accelerance.

    Raises
    ------
    MeasurementError
        A negative or infinite mass, or an FRF of the amplitude alone.
    """
    return _with_mass(frf, mass, -1.0)


def add_accelerometer_mass(frf: Frf, mass: float) -> Frf:
    """Return the drive-point FRF that is measured once an accelerometer is on the structure.

    Parameters
    ----------
    frf : Frf
        Drive-point FRF of the structure alone; any quantity, with phase.
    mass : float
        kg, zero or more.

    Returns
    -------
    Frf
        In the quantity of `frf`: A / (1 + m A), the inverse of `remove_accelerometer_mass`.

    Raises
    ------
    MeasurementError
        A negative or infinite mass, or an FRF of the amplitude alone.
    """
    return _with_mass(frf, mass, 1.0)


def _with_mass(frf: Frf, mass: float, sign: float) -> Frf:
    if frf.rotation and mass:
        raise MeasurementError(f"{frf.label}: a mass at the drive point changes no rotation per moment.")
    if not (math.isfinite(mass) and mass >= 0):
        raise MeasurementError(Fault(frf.label, f"the accelerometer's mass is {mass!r} kg.", "zero or more kg"))
    if mass == 0:
        return frf
    if not frf.has_phase:
        raise MeasurementError(
            Fault(
                frf.label,
                "the accelerometer's mass acts on amplitude and phase, and this is an amplitude alone.",
                remedy="Export the FRF as real and imaginary part, or leave the mass at 0.",
            )
        )
    accelerance = frf.to("accelerance")
    corrected = replace(accelerance, values=accelerance.values / (1.0 + sign * mass * accelerance.values))
    return corrected.to(frf.quantity)
