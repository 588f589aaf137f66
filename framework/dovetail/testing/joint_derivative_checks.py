"""Checks of joints: derivatives by the parameters, and whether each parameter can be distinguished from the others."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import PluginError
from dovetail.interfaces import Declaration, JointModel, StructuralMatrices
from dovetail.synthesis.joint_evaluation import depends_on_frequency
from dovetail.testing.answers import PARTS
from dovetail.testing.linear_algebra import condensed, relative_difference, unit_free
from dovetail.testing.outcomes import Nonconformity, NotApplicable, Reservation
from dovetail.testing.specimens import FREQUENCY, JointSpecimen


@dataclass(frozen=True)
class Settings:
    """How derivatives are compared with differences.

    Attributes
    ----------
    vectors, vectors_of_laws : int
        Number of parameter vectors, half of them corners, for matrices and for a frequency-dependent dynamic stiffness,
        which has many lines.
    steps : tuple of float
        Steps relative to the parameter. The differences are of second order, with errors of about 1e-8 of the
        derivative for the shorter step and 1e-6 for the longer one; rounding leaves 1e-12.
    disagreement : float
        Largest relative difference between the two steps and between both sides; above it there is a kink, such as a
        stop, where no derivative exists.
    wrong : float
        Smallest relative error of a wrong derivative.
    rounding : float
        Rounding error of one value, relative to the scale of the entry.
    small : float
        Step relative to the parameter that double precision resolves and single precision (6e-8) does not.
    shown : float
        Largest factor between the change by a small step and the proportional part of that by the longer of `steps`.
    single : float
        Difference between a single vector and a batch, relative to the largest entry of a derivative.
    secant : float
        Steps with which parameters are distinguished, relative to their ranges.
    dependent : float
        Smallest eigenvalue of the Gram matrix of normalised changes below which they are dependent: an angle of 1e-5,
        which no measurement resolves.
    timed : int
        Number of calls of which the shortest is reported.
    """

    vectors: int = 96
    vectors_of_laws: int = 24
    steps: tuple[float, float] = (1e-4, 1e-3)
    disagreement: float = 1e-4
    wrong: float = 1e-5
    rounding: float = 1e-14
    small: float = 1e-8
    shown: float = 10.0
    single: float = 1e-6
    secant: float = 0.05
    dependent: float = 1e-10
    timed: int = 3


SETTINGS = Settings()
_Call = Callable[[NDArray[np.float64]], object]
_Function = Callable[[NDArray[np.float64]], NDArray[np.complex128] | NDArray[np.float64]]


def check_every_parameter_acts(specimen: JointSpecimen) -> None:
    """Every parameter changes the dynamic stiffness; otherwise it cannot be identified."""
    _only_with_parameters(specimen)
    theta = specimen.some(SETTINGS.vectors)
    before = specimen.stiffness(FREQUENCY, theta)
    for column, parameter in enumerate(specimen.component.parameters):
        changed = theta.copy()
        changed[:, column] = np.roll(theta[:, column], 1)
        if np.array_equal(specimen.stiffness(FREQUENCY, changed), before):
            raise Nonconformity(f"'{parameter.name}' changes nothing.", "Use it in matrices, or remove it.")


def check_small_steps_show(specimen: JointSpecimen) -> None:
    """A relative change of 1e-8 of a parameter changes the matrices in proportion: no rounding, table or steps."""
    _only_with_parameters(specimen)
    law = depends_on_frequency(specimen.component)
    theta = specimen.some(SETTINGS.vectors_of_laws if law else SETTINGS.vectors)
    before = _matrices_or_stiffness(specimen, theta)
    for column, parameter in enumerate(specimen.component.parameters):
        inward = np.where(parameter.to_unit(theta[:, column]) < 0.5, 1.0, -1.0)
        size = np.maximum(np.abs(theta[:, column]), 1e-3 * (parameter.upper - parameter.lower))
        changes = []
        for factor in (SETTINGS.small, SETTINGS.steps[1]):
            moved = theta.copy()
            moved[:, column] += factor * inward * size
            changes.append((_matrices_or_stiffness(specimen, moved) - before).reshape(len(theta), -1))
        flat = np.abs(before).reshape(len(theta), -1)
        greatest = np.abs(changes[1] / np.where(flat > 0, flat, np.inf)).argmax(axis=1)
        small, large, value = (array[np.arange(len(theta)), greatest] for array in (*changes, flat))
        expected = np.abs(large) * SETTINGS.small / SETTINGS.steps[1]
        telling = expected > 100.0 * np.finfo(float).eps * value
        ratio = np.abs(small[telling]) / expected[telling]
        wrong = (ratio < 1.0 / SETTINGS.shown) | (ratio > SETTINGS.shown)
        far = theta.copy()
        far[:, column] += SETTINGS.secant * inward * (parameter.upper - parameter.lower)
        acts = (_matrices_or_stiffness(specimen, far) != before).reshape(len(theta), -1).any(axis=1)
        still = acts & ~(changes[1] != 0).any(axis=1)  # by a longer step it acts: a table, not a stop
        if 2 * wrong.sum() > telling.sum() or 2 * still.sum() > acts.sum():
            problem = f"small steps of '{parameter.name}' have no proportional effect: its values are rounded."
            raise Nonconformity(problem, "Compute in double precision, and interpolate tables.")


def check_parameters_are_distinguishable(specimen: JointSpecimen) -> None:
    """At the ports no parameter has the same effect as others at all lines; else only a combination is identifiable."""
    parameters = specimen.component.parameters
    if len(parameters) < 2:
        raise NotApplicable("the joint has fewer than two parameters.")
    on_ports = specimen.component.size - specimen.component.internal_dofs
    theta = specimen.some(SETTINGS.vectors)
    before = condensed(specimen.stiffness(specimen.lines, theta), on_ports)
    scale = np.abs(np.diagonal(before, axis1=-2, axis2=-1)).max(axis=1)
    changes = []
    for column, parameter in enumerate(parameters):
        fraction = parameter.to_unit(theta[:, column])
        moved = theta.copy()
        moved[:, column] = parameter.from_unit(fraction + np.where(fraction < 0.5, 1.0, -1.0) * SETTINGS.secant)
        change = condensed(specimen.stiffness(specimen.lines, moved), on_ports) - before
        flat = unit_free(change, scale[:, None, :]).reshape(len(theta), -1)
        norm = np.linalg.norm(flat, axis=1, keepdims=True)
        changes.append(flat / np.where(norm > 0, norm, 1.0))
    parameters = tuple(each for each, change in zip(parameters, changes, strict=True) if change.any())
    stacked = np.stack([change for change in changes if change.any()], axis=1)
    values, vectors = np.linalg.eigh((stacked @ np.conj(np.swapaxes(stacked, 1, 2))).real)
    if (values[:, 0] < SETTINGS.dependent).all():
        weights = np.abs(vectors[..., 0]).min(axis=0)
        names = [each.name for each, weight in zip(parameters, weights, strict=True) if weight > 1e-3]
        problem = (
            f"at the ports {', '.join(names) or 'some parameters'} cannot be distinguished: they have the same effect."
        )
        raise Reservation(problem, "Replace them by one parameter, or fix one in each description.")


def check_jacobian_meets_differences(specimen: JointSpecimen) -> None:
    """`matrices_jacobian` agrees with differences of `matrices`, also in the corners of the ranges."""
    _only_with_parameters(specimen)
    theta = specimen.some(SETTINGS.vectors)
    jacobian = specimen.component.matrices_jacobian(theta.copy())
    if len(jacobian) != len(specimen.component.parameters):
        problem = f"it returned {len(jacobian)} derivatives for {len(specimen.component.parameters)} parameters."
        raise Nonconformity(problem, "Return StructuralMatrices for each parameter, in their order.")
    derivatives = (np.stack([getattr(each, part) for part in PARTS], axis=1) for each in jacobian)
    _check_derivatives(specimen, theta, lambda vectors: _stacked(specimen, vectors), derivatives, "structural matrices")


def check_jacobian_treats_each_vector_alone(specimen: JointSpecimen) -> None:
    """Derivatives of a single vector are the same as in a large batch."""
    _only_with_parameters(specimen)
    theta = specimen.some(300)
    many = [_copied(each) for each in specimen.component.matrices_jacobian(theta.copy())]
    for row in (0, len(theta) // 3, len(theta) - 1):
        derivatives = specimen.component.matrices_jacobian(theta[row : row + 1].copy())
        for parameter, derivative, batch in zip(specimen.component.parameters, derivatives, many, strict=True):
            for part in PARTS:
                if relative_difference(getattr(derivative, part)[0], getattr(batch, part)[row]) > SETTINGS.single:
                    problem = (
                        f"the derivative of {part} by '{parameter.name}' differs between a batch and a single vector."
                    )
                    raise Nonconformity(problem, "Use the vectors' own axis: derivatives are (n, d, d) each.")


def check_declared_matrices_are_true(specimen: JointSpecimen) -> str:
    """The matrices are linear in `linear_parameters`, and the rest is what `scaled_matrices` gives, if declared."""
    _only_with_parameters(specimen)
    joint = specimen.component
    if specimen.own_law:
        raise NotApplicable("FRFs come from the joint's dynamic stiffness, not from its matrices.")
    try:
        joint.declaration.verify()
        declared = joint.superposition
    except PluginError as error:
        raise Nonconformity(error.faults[0].problem, error.faults[0].remedy) from error
    theta = specimen.some(SETTINGS.vectors)
    if declared is not None:
        return f"the matrices of an FRF take {_microseconds(declared.functions, declared.slopes, theta)}"
    linear = [name for name in joint.declaration.names if _looks_linear(joint.declaration, name)]
    whole = f"the matrices of an FRF take {_microseconds(joint.matrices, joint.matrices_jacobian, theta)}"
    undeclared = [name for name in linear if name not in joint.declaration.linear]
    if not undeclared:
        return whole
    whole += f"; linear_parameters does not name {', '.join(undeclared)}, in which the matrices look linear"
    possible = replace(joint.declaration, linear=linear).superposition()
    if possible is None:
        return whole
    return f"{whole}, and with them they would take {_microseconds(possible.functions, possible.slopes, theta)}"


def _looks_linear(declaration: Declaration, name: str) -> bool:
    try:
        replace(declaration, linear=[name]).verify()
    except PluginError:
        return False
    return True


def _microseconds(values: _Call, derivatives: _Call, theta: NDArray[np.float64]) -> str:
    """Return the least time of one parameter vector in a batch, for values and derivatives together."""
    times = []
    for _ in range(SETTINGS.timed):
        start = time.perf_counter()
        values(theta.copy())
        derivatives(theta.copy())
        times.append(time.perf_counter() - start)
    return f"{1e6 * min(times) / len(theta):.2g} us"


def check_dynamic_stiffness_jacobian_meets_differences(specimen: JointSpecimen) -> None:
    """`dynamic_stiffness_jacobian` agrees with differences of `dynamic_stiffness`, from 1 Hz to 20 kHz."""
    _only_with_parameters(specimen)
    overridden = specimen.model.dynamic_stiffness_jacobian is not JointModel.dynamic_stiffness_jacobian  # type: ignore[attr-defined]
    if not specimen.own_law and not overridden:
        raise NotApplicable("it follows from the derivatives of the matrices, which are checked.")
    theta, lines = specimen.some(SETTINGS.vectors_of_laws), specimen.lines
    jacobian = list(specimen.component.dynamic_stiffness_jacobian(lines.copy(), theta.copy()))
    if len(jacobian) != len(specimen.component.parameters):
        problem = f"it returned {len(jacobian)} derivatives for {len(specimen.component.parameters)} parameters."
        raise Nonconformity(problem, "Return an array for each parameter, in their order.")
    _check_derivatives(
        specimen, theta, lambda vectors: specimen.stiffness(lines, vectors), jacobian, "dynamic stiffness"
    )


def _check_derivatives(
    specimen: JointSpecimen,
    theta: NDArray[np.float64],
    function: _Function,
    derivatives: Iterable[NDArray[np.complex128] | NDArray[np.float64]],
    noun: str,
) -> None:
    """Compare derivatives (n, ..., d, d) with differences, entry by entry, where the differences agree."""
    values_at_theta = function(theta)
    diagonal = np.sqrt(np.abs(np.diagonal(values_at_theta, axis1=-2, axis2=-1)))
    scale = diagonal[..., :, None] * diagonal[..., None, :] + np.abs(values_at_theta)
    for column, (parameter, derivative) in enumerate(zip(specimen.component.parameters, derivatives, strict=True)):
        differences, noise, smooth = _differences(specimen, theta, column, function, values_at_theta, scale)
        error = np.abs(derivative - differences)
        wrong = smooth & ~(error <= SETTINGS.wrong * np.abs(differences) + noise)
        if wrong.any():
            at = np.unravel_index(int(np.argmax(np.where(wrong, error, -1.0))), wrong.shape)
            problem = (
                f"the derivative of the {noun} by '{parameter.name}' is {derivative[at]:.6g} in entry "
                f"{tuple(int(index) for index in at[-2:])} for {specimen.shown(theta[at[0]])}; differences give "
                f"{differences[at]:.6g}."
            )
            raise Nonconformity(problem, "Correct the derivative, or inherit it from the base class.")


def _differences(
    specimen: JointSpecimen,
    theta: NDArray[np.float64],
    column: int,
    function: _Function,
    values_at_theta: NDArray[np.complex128] | NDArray[np.float64],
    scale: NDArray[np.float64],
) -> tuple[NDArray[np.complex128], NDArray[np.float64], NDArray[np.bool_]]:
    """Return one-sided differences within the range, their rounding errors, and where they can be trusted."""
    parameter = specimen.component.parameters[column]
    at, width = theta[:, column], parameter.upper - parameter.lower
    size = np.minimum(np.maximum(np.abs(at), 1e-2 * width), 100.0 * width)
    best = np.zeros(values_at_theta.shape, dtype=np.complex128)
    noise = SETTINGS.rounding * scale / _broad(SETTINGS.steps[0] * size, values_at_theta)
    smooth = np.ones(values_at_theta.shape, dtype=np.bool_)
    taken = np.zeros(len(theta), dtype=np.bool_)
    for sign in (1.0, -1.0):
        for factor in SETTINGS.steps:
            step = sign * factor * size
            inside = (at + 2.0 * step >= parameter.lower) & (at + 2.0 * step <= parameter.upper)
            near, far = theta[inside], theta[inside]
            near[:, column] += step[inside]
            far[:, column] += 2.0 * step[inside]
            if not inside.any():
                continue
            values = 4.0 * function(near) - function(far) - 3.0 * values_at_theta[inside]
            difference = values / _broad(2.0 * step[inside], values_at_theta)
            first = inside & ~taken
            best[first] = difference[first[inside]]
            taken |= inside
            close = np.abs(difference - best[inside]) <= SETTINGS.disagreement * np.abs(difference) + noise[inside]
            smooth[inside] &= close
    smooth[~taken] = False
    return best, 100.0 * noise, smooth


def _broad(values: NDArray[np.float64], like: NDArray[np.complex128] | NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (n,) values with as many axes as an (n, ...) array."""
    return values.reshape(-1, *(1,) * (like.ndim - 1))


def _stacked(specimen: JointSpecimen, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return copies of M, K, C and D, (n, 4, d, d)."""
    matrices = specimen.component.matrices(theta.copy())
    return np.stack([getattr(matrices, part) for part in PARTS], axis=1)


def _matrices_or_stiffness(specimen: JointSpecimen, theta: NDArray[np.float64]) -> NDArray[Any]:
    """Return what determines FRFs: the matrices, or the dynamic stiffness of a joint that depends on frequency."""
    if depends_on_frequency(specimen.component):
        return specimen.stiffness(FREQUENCY, theta)
    return _stacked(specimen, theta)


def _copied(matrices: StructuralMatrices) -> StructuralMatrices:
    return StructuralMatrices(*(np.array(getattr(matrices, part)) for part in "MKCD"))


def _only_with_parameters(specimen: JointSpecimen) -> None:
    if not specimen.component.parameters:
        raise NotApplicable("the joint has no parameters.")
