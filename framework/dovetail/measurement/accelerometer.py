"""The mass of the accelerometer that was on the structure while it was measured."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Frf
from dovetail.measurement.named_points import ModelDof
from dovetail.measurement.roles import IGNORE, Role, check_roles, contradictions
from dovetail.units import to_si

_LARGEST_MASS = 1000.0
"""kg; with a heavier one, the FRF would consist of rounding errors."""
_HEAVIEST = 1.0
"""kg; a heavier accelerometer is reported."""


def remove_accelerometer_mass(
    frf: Frf,
    mass: float | str,
    *,
    drive: Frf | None = None,
    to_response: Frf | None = None,
    from_force: Frf | None = None,
) -> Frf:
    """Return the FRF of the structure without the accelerometer.

    With the response i, the force j, the accelerometer k and accelerances that were all measured with it, this is
    ``A_ij + m A_ik A_kj / (1 - m A_kk)``. The FRFs that are needed depend on the place of the accelerometer:

    - at the drive point of `frf`: only `frf` itself, ``A / (1 - m A)``;
    - at the response or at the force of a transfer FRF: `drive`, ``A_ij / (1 - m A_kk)``;
    - at a third DOF: `drive`, `to_response` and `from_force`.

    Parameters
    ----------
    frf : Frf
        Measured with the accelerometer on the structure; any quantity, with phase.
    mass : float or str
        kg, zero or more; or a text with a unit, such as ``"50 g"``.
    drive : Frf, optional
        A_kk, the drive-point FRF at the accelerometer, measured with it.
    to_response, from_force : Frf, optional
        A_ik and A_kj, measured with the accelerometer at k.

    Returns
    -------
    Frf
        In the quantity of `frf`. Its `variance`, if known, follows from that of `frf`, without the errors of the other
        FRFs.

    Raises
    ------
    MeasurementError
        A negative or infinite mass, an FRF of the amplitude alone or of a rotation, FRFs on different lines, or one
        of `to_response` and `from_force` without the others.

    References
    ----------
    Cakar and Sanliturk, Elimination of transducer mass loading effects from frequency response functions, Mechanical
    Systems and Signal Processing 19 (2005).
    """
    return _with_mass(frf, mass, -1.0, drive, to_response, from_force)


def add_accelerometer_mass(
    frf: Frf,
    mass: float | str,
    *,
    drive: Frf | None = None,
    to_response: Frf | None = None,
    from_force: Frf | None = None,
) -> Frf:
    """Return the FRF as it is measured with an accelerometer on the structure.

    Parameters
    ----------
    frf : Frf
        FRF of the structure alone; any quantity, with phase.
    mass : float or str
        kg, zero or more; or a text with a unit, such as ``"50 g"``.
    drive, to_response, from_force : Frf, optional
        As in `remove_accelerometer_mass`, of the structure alone.

    Returns
    -------
    Frf
        In the quantity of `frf`: ``A_ij - m A_ik A_kj / (1 + m A_kk)``, the inverse of `remove_accelerometer_mass`.

    Raises
    ------
    MeasurementError
        As in `remove_accelerometer_mass`.
    """
    return _with_mass(frf, mass, 1.0, drive, to_response, from_force)


def _with_mass(
    frf: Frf, given: float | str, sign: float, drive: Frf | None, to_response: Frf | None, from_force: Frf | None
) -> Frf:
    mass = to_si(given, "kg") if isinstance(given, str) else given
    if not 0 <= mass <= _LARGEST_MASS:
        accepted = f"0 to {_LARGEST_MASS:g} kg"
        raise MeasurementError(Fault(frf.label, f"the accelerometer's mass is {mass!r} kg.", accepted))
    if mass > _HEAVIEST:
        warnings.warn(f"{frf.label}: the accelerometer has {mass:g} kg; were {mass:g} g meant?", stacklevel=4)
    if mass == 0:
        return frf
    for other in (frf, drive, to_response, from_force):
        if other is not None:
            _check(other, frf)
    _check_places(frf, drive, to_response, from_force)
    measured = frf.to("accelerance")
    values = measured.values
    if drive is None:
        denominator = 1.0 + sign * mass * values
        return _replace_values(measured, values / denominator, 1.0 / denominator**2).to(frf.quantity)
    denominator = 1.0 + sign * mass * drive.to("accelerance").values
    if to_response is None or from_force is None:
        return _replace_values(measured, values / denominator, 1.0 / denominator).to(frf.quantity)
    detour = to_response.to("accelerance").values * from_force.to("accelerance").values
    return _replace_values(measured, values - sign * mass * detour / denominator, np.ones_like(values)).to(frf.quantity)


def _check_places(frf: Frf, drive: Frf | None, to_response: Frf | None, from_force: Frf | None) -> None:
    """Compare the DOFs in the files of the FRFs with the places of response i, force j and accelerometer k.

    Raises
    ------
    MeasurementError
        They contradict each other, or the FRF at the accelerometer cannot be that of a drive point.
    """
    sensor, response, force = map(ModelDof, ("the accelerometer", "the response", "the force"))
    if drive is None:
        if to_response is not None or from_force is not None:
            raise MeasurementError(Fault(frf.label, "the drive-point FRF at the accelerometer is missing."))
        if frf.by_moment:
            problem = f"this is a {frf.kind}, no drive-point FRF: that at the accelerometer is missing."
            raise MeasurementError(Fault(frf.label, problem))
        if any(contradictions([Role(frf, sensor, sensor)])):
            problem = f"the FRF is from {frf.force} to {frf.response}, and the mass is taken off a drive point."
            remedy = f"Give the drive-point FRF at the accelerometer too: `drive=`. {IGNORE}"
            raise MeasurementError(Fault(frf.label, problem, remedy=remedy))
        check_roles([Role(frf, sensor, sensor)])
        return
    if (to_response is None) != (from_force is None):
        problem = "an accelerometer at a third point needs the FRF to the response and the FRF from the force."
        raise MeasurementError(Fault(frf.label, problem))
    at_sensor = Role(drive, sensor, sensor)
    if to_response is None or from_force is None:
        at_response, at_force = [at_sensor, Role(frf, sensor, force)], [at_sensor, Role(frf, response, sensor)]
        is_at_force = any(contradictions(at_response, distinct=False))
        check_roles(at_force if is_at_force else at_response, distinct=False)
        return
    others = [Role(to_response, response, sensor), Role(from_force, sensor, force)]
    check_roles([Role(frf, response, force), at_sensor, *others], distinct=False)


def _check(other: Frf, frf: Frf) -> None:
    lines, wanted = other.frequency, frf.frequency
    if other.rotation:
        problem = f"this is a {other.kind}; the accelerometer's mass can be removed from displacements."
        raise MeasurementError(Fault(other.label, problem))
    if not other.has_phase:
        raise MeasurementError(
            Fault(
                other.label,
                "the accelerometer's mass acts on amplitude and phase, and this is an amplitude alone.",
                remedy="Export the FRF as real and imaginary part, or leave the mass at 0.",
            )
        )
    if lines.shape != wanted.shape or not np.allclose(lines, wanted, rtol=1e-9, atol=0):
        raise MeasurementError(Fault(other.label, f"its lines are not those of {frf.label}."))


def _replace_values(frf: Frf, values: NDArray[np.complex128], derivative: NDArray[np.complex128]) -> Frf:
    """Return the FRF with other values, and the variance that follows from their derivative by the old ones."""
    variance = frf.random_variance
    if variance is not None and np.all(np.isfinite(variance)):
        return replace(frf, values=values, variance=variance * np.abs(derivative) ** 2)
    return replace(frf, values=values)
