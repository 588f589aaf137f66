"""The receptance of a spindle's flange from impact tests on a holder whose model is known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from dovetail import (
    Assembly,
    Fault,
    Frf,
    MeasurementError,
    ModelDof,
    ParameterError,
    ReceptanceMatrix,
    Role,
    check_roles,
    remove_accelerometer_mass,
)
from dovetail.evaluation import Receptance, decouple, listing
from dovetail.pages import format_quantity

_STEP = 1e-6
"""Relative change of a test for finite differences."""

Rotations = Literal["model", "difference"]
ROTATIONS: tuple[Rotations, ...] = get_args(Rotations)


def spindle_flange(
    holder: Assembly,
    tests: tuple[Frf, Frf, Frf],
    points: tuple[float, float],
    flange: float,
    *,
    accelerometer_mass: float = 0.0,
    rotations: Rotations = "model",
) -> ReceptanceMatrix:
    """Decouple a calibration holder from the spindle (inverse RCSA).

    Parameters
    ----------
    holder : Assembly
        The holder beyond its flange, free-free; the substructure of its response is the one that was struck.
    tests : three Frf
        h_aa, h_ab and h_bb on the holder's frequencies: translations at the points a and b with the holder on the
        spindle. The accelerometer was at a, at a and at b.
    points : (float, float)
        Positions [m] of a (near the tip) and b on the holder.
    flange : float
        Position [m] where the holder ends and the spindle's flange begins.
    accelerometer_mass : float
        kg; its effect is removed from each test.
    rotations : {"model", "difference"}
        Source of the rotations: the holder's model, which needs no approximation; or first-order finite differences of
        the measured translations at a (Eq. 16), whose error is proportional to the distance from a to b.

    Returns
    -------
    ReceptanceMatrix
        Receptance of the spindle's flange without the holder, x and rz.

    Raises
    ------
    MeasurementError
        A test is on other lines, has no phase, is of a rotation or by a moment, or is not that of its points.
    ParameterError
        The holder has parameters to identify, a and b are the same node, a negative mass, or no such `rotations`.

    References
    ----------
    Processes 14 (2026) 1875, doi:10.3390/pr14121875, Eqs. 16 to 18; with ``"model"`` the same decoupling with two
    translations instead of a translation and a rotation.
    """
    if rotations not in ROTATIONS:
        raise ParameterError(Fault("rotations", f"there is no '{rotations}'.", " | ".join(ROTATIONS)))
    if not 0.0 <= accelerometer_mass < np.inf:
        problem = f"the accelerometer's mass is {accelerometer_mass:g} kg."
        raise ParameterError(Fault("accelerometer_mass", problem, "0 kg or more"))
    part = holder.description.response.substructure
    if holder.parameters:
        unknown = listing(parameter.name for parameter in holder.parameters)
        raise ParameterError(Fault(holder.name, f"the holder has unknown parameters: {unknown}.", "known values"))
    if holder.point(part, points[0]) == holder.point(part, points[1]):
        raise ParameterError(Fault("points", "the points a and b are the same.", "two points of the holder"))
    _check_tests(holder, tests, points)
    aa, ab, bb = _bare_receptances(tests, holder.frequency, accelerometer_mass)
    ends = [(part, flange, "x"), (part, flange, "rz")]
    if rotations == "model":
        measured = _symmetric(aa, ab, bb)
        chosen = [(part, points[0], "x"), (part, points[1], "x")]
    else:
        measured = difference_receptance(aa, ab, bb, points[1] - points[0])
        chosen = [(part, points[0], "x"), (part, points[0], "rz")]
    known = holder.receptance(None, [*chosen, *ends], [*chosen, *ends])
    tt, ti, it, ii = known[:, :2, :2], known[:, :2, 2:], known[:, 2:, :2], known[:, 2:, 2:]
    flange_receptance = decouple(measured, tt, ti, it, ii)
    symmetric = (flange_receptance + flange_receptance.swapaxes(1, 2)) / 2.0
    return ReceptanceMatrix(holder.frequency, symmetric, note=tests[0].note)


def error_gain(
    receptance: ReceptanceMatrix,
    holder: Assembly,
    tests: tuple[Frf, Frf, Frf],
    points: tuple[float, float],
    flange: float,
    **options: Any,
) -> NDArray[np.float64]:
    """Return the relative errors of the flange's receptance, divided by those of the tests.

    Parameters
    ----------
    receptance : ReceptanceMatrix
        Of the flange, as `spindle_flange` returns it.
    holder, tests, points, flange, **options
        As in `spindle_flange`.

    Returns
    -------
    (n_freq, 2) array
        For the drive-point receptances in x and rz, and independent errors of equal relative size in the three tests.
    """
    aa, ab, bb = tests
    other_aa, other_ab, other_bb = (replace(frf, values=(1.0 + _STEP) * frf.values) for frf in tests)
    disturbed = (other_aa, ab, bb), (aa, other_ab, bb), (aa, ab, other_bb)
    moved = np.stack([spindle_flange(holder, frfs, points, flange, **options).values for frfs in disturbed])
    changes = np.diagonal(moved, axis1=2, axis2=3) / np.diagonal(receptance.values, axis1=1, axis2=2) - 1.0
    return np.asarray(np.linalg.norm(changes / _STEP, axis=0))


def difference_receptance(
    aa: NDArray[np.complex128], ab: NDArray[np.complex128], bb: NDArray[np.complex128], distance: float
) -> NDArray[np.complex128]:
    """Return the receptance over x and rz at a from translations at a and b (Eq. 16, as in `spindle_flange`).

    Parameters
    ----------
    aa, ab, bb : (n_freq,) complex arrays
        m/N.
    distance : float
        From a to b [m], along the axis s of rz = dx/ds.

    Returns
    -------
    (n_freq, 2, 2) complex array
    """
    mixed, turning = (ab - aa) / distance, (aa - 2.0 * ab + bb) / distance**2
    return _symmetric(aa, mixed, turning)


def _check_tests(holder: Assembly, tests: tuple[Frf, Frf, Frf], points: tuple[float, float]) -> None:
    """Raise a MeasurementError if the tests cannot be those of the points a and b."""
    for frf in tests:
        if not frf.has_phase:
            raise MeasurementError(Fault(frf.label, "the coupling needs phases, but this FRF has only amplitudes."))
        if frf.rotation or frf.by_moment:
            raise MeasurementError(Fault(frf.label, f"it is a {frf.kind}.", "a displacement per force"))
        if frf.frequency.shape != holder.frequency.shape or not np.allclose(frf.frequency, holder.frequency):
            raise MeasurementError(Fault(frf.label, "the test is not on the lines of the holder's description."))
    part = holder.description.response.substructure
    labels = tuple(node.label for node in holder.description.substructures[part].nodes)
    a, b = (
        ModelDof(
            f"{name}, {format_quantity(position, 'm')}",
            part=part,
            label=labels[holder.description.placed_parts[part].node_dofs[holder.point(part, position)[1]][0]],
            labels=labels,
            position=position,
        )
        for name, position in zip(("a", "b"), points, strict=True)
    )
    aa, ab, bb = tests
    roles = [Role(aa, a, a), Role(ab, a, b), Role(bb, b, b)]
    check_roles(roles, substructures={n: not one.grounded for n, one in holder.description.substructures.items()})


def _bare_receptances(tests: tuple[Frf, Frf, Frf], frequency: NDArray[np.float64], mass: float) -> list[Receptance]:
    """Return the receptances h_aa, h_ab and h_bb without the effect of the accelerometer's mass."""
    aa, ab, bb = (replace(frf, frequency=frequency) for frf in tests)
    bare = (remove_accelerometer_mass(frf, mass, drive=drive) for frf, drive in ((aa, aa), (ab, aa), (bb, bb)))
    return [frf.to("receptance").values for frf in bare]


def _symmetric(aa: Receptance, ab: Receptance, bb: Receptance) -> Receptance:
    """Return symmetric matrices (n_freq, 2, 2) with these entries (n_freq,)."""
    return np.stack([np.stack([aa, ab], -1), np.stack([ab, bb], -1)], -2)
