"""Checks of joints: what they declare, and what their matrices are over the parameters' ranges."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import StructuralMatrices, joint_faults
from dovetail.testing.linear_algebra import asymmetry, least_effort, least_eigenvalue, relative_difference
from dovetail.testing.outcomes import Nonconformity, NotApplicable
from dovetail.testing.specimens import FREQUENCY, JointSpecimen

__all__: list[str] = []

PARTS = {"M": "mass", "K": "stiffness", "C": "viscous damping", "D": "structural damping"}
_ROUNDING = 1e-9
_LEAST_EFFORT = 1e-7
_DERIVATIVE = 1e-5
_FEW = 4


def check_ports_parameters_and_dofs_are_declared(specimen: JointSpecimen) -> None:
    """Ports, parameters and DOFs belong together; nothing else can be asked before that holds."""
    for fault in joint_faults(specimen.component):
        raise Nonconformity(f"the joint {fault.problem}", fault.accepted and f"Give {fault.accepted}.")
    if not specimen.component.ports:
        raise Nonconformity("the joint has no port.", "Give it a Port for each part that it attaches to.")


def check_matrices_have_the_shape_of_the_dofs(specimen: JointSpecimen) -> None:
    """`matrices` returns StructuralMatrices of (n, d, d) arrays for any number n of parameter vectors."""
    size = specimen.component.size
    for count in (len(specimen.theta), 1):
        answer = specimen.component.matrices(specimen.theta[:count].copy())
        if not isinstance(answer, StructuralMatrices):
            raise Nonconformity(f"matrices returned {type(answer).__name__}.", "Return a dovetail.StructuralMatrices.")
        if answer.K.shape != (count, size, size):
            raise Nonconformity(
                f"for {count} parameter vectors matrices returned arrays of shape {answer.K.shape}, and the joint "
                f"declares {size} DOFs.",
                "Begin with StructuralMatrices.zeros(len(theta), self.size).",
            )


def check_matrices_are_finite(specimen: JointSpecimen) -> None:
    """No parameter vector of the ranges gives an infinite or undefined matrix."""
    for part, noun in PARTS.items():
        finite = np.isfinite(getattr(specimen.matrices, part)).all(axis=(1, 2))
        if not finite.all():
            vector = _shown(specimen, int(np.argmin(finite)))
            raise Nonconformity(
                f"the {noun} matrix is not finite for {vector}.", "Narrow the ranges, or mend matrices."
            )


def check_parameters_are_described(specimen: JointSpecimen) -> None:
    """Each parameter has a description, for who gives its range in a description."""
    bare = [parameter.name for parameter in specimen.component.parameters if not parameter.description.strip()]
    if bare:
        raise Nonconformity(f"without a description: {', '.join(bare)}.", "Give Parameter its sixth argument.")


def check_own_ranges_are_accepted(specimen: JointSpecimen) -> None:
    """`range_objections` has nothing against the joint's own ranges."""
    parameters = specimen.component.parameters
    objections = specimen.component.range_objections(
        {parameter.name: parameter.lower for parameter in parameters},
        {parameter.name: parameter.upper for parameter in parameters},
    )
    if not isinstance(objections, Mapping):
        raise Nonconformity(f"range_objections returned {type(objections).__name__}.", "Return a dict, {} for none.")
    for name, objection in objections.items():
        raise Nonconformity(f"it objects to its own range of {name}: {objection}", "Give the parameter another range.")


def check_matrices_are_symmetric(specimen: JointSpecimen) -> None:
    """Forces obey Newton's third law and Maxwell's reciprocity."""
    for part, noun in PARTS.items():
        if asymmetry(getattr(specimen.matrices, part)) > _ROUNDING:
            raise Nonconformity(f"the {noun} matrix is not symmetric.", "Fill [row, column] and [column, row] alike.")


def check_stiffness_is_positive_semidefinite(specimen: JointSpecimen) -> None:
    """No motion gives energy back."""
    _check_semidefinite(specimen, "K")


def check_mass_is_positive_semidefinite(specimen: JointSpecimen) -> None:
    """No motion has negative kinetic energy."""
    _check_semidefinite(specimen, "M")


def check_damping_is_positive_semidefinite(specimen: JointSpecimen) -> None:
    """No motion is fed with energy."""
    _check_semidefinite(specimen, "C")
    _check_semidefinite(specimen, "D")


def check_each_vector_of_a_batch_is_treated_alone(specimen: JointSpecimen) -> None:
    """A batch gives what a loop over its vectors gives."""
    for row in range(len(specimen.theta)):
        alone = specimen.component.matrices(specimen.theta[row : row + 1].copy())
        for part, noun in PARTS.items():
            together = getattr(specimen.matrices, part)[row]
            if relative_difference(getattr(alone, part)[0], together) > _ROUNDING:
                problem = f"the {noun} matrix for {_shown(specimen, row)} is another one in a batch than alone."
                raise Nonconformity(
                    problem, "Use the vectors' own axis: theta is (n, n_params), matrices are (n, d, d)."
                )


def check_the_same_entries_are_filled(specimen: JointSpecimen) -> None:
    """An entry is filled for all parameter values or for none: the elimination is planned once."""
    for part, noun in PARTS.items():
        filled = getattr(specimen.matrices, part)[2:] != 0  # the first two are the corners of the ranges
        changing = filled.any(axis=0) != filled.all(axis=0)
        if changing.any():
            row, column = np.argwhere(changing)[0]
            problem = f"entry ({row}, {column}) of the {noun} matrix is zero for some parameters only."
            raise Nonconformity(problem, "Fill it for all parameter values, with a smooth function of them.")


def check_every_parameter_acts(specimen: JointSpecimen) -> None:
    """A parameter that changes nothing cannot be identified."""
    if not specimen.component.parameters:
        raise NotApplicable("the joint has no parameters.")
    middle = specimen.theta[2:3]
    before = specimen.component.dynamic_stiffness(FREQUENCY, middle.copy())
    for column, parameter in enumerate(specimen.component.parameters):
        changed = middle.copy()
        changed[0, column] = parameter.from_unit(np.array(0.75))
        if (specimen.component.dynamic_stiffness(FREQUENCY, changed) == before).all():
            raise Nonconformity(f"'{parameter.name}' changes nothing.", "Use it in matrices, or leave it out.")


def check_jacobian_meets_differences(specimen: JointSpecimen) -> None:
    """`matrices_jacobian` is the derivative of `matrices`, held against central differences."""
    parameters, theta = specimen.component.parameters, specimen.theta[2 : 2 + _FEW]
    if not parameters:
        raise NotApplicable("the joint has no parameters.")
    jacobian = specimen.component.matrices_jacobian(theta.copy())
    if len(jacobian) != len(parameters):
        problem = f"matrices_jacobian returned {len(jacobian)} derivatives for {len(parameters)} parameters."
        raise Nonconformity(problem, "Return StructuralMatrices for each parameter, in their order.")
    for column, parameter in enumerate(parameters):
        above, below, width = _moved(specimen, theta, column)
        high, low = specimen.component.matrices(above), specimen.component.matrices(below)
        for part, noun in PARTS.items():
            differences = (getattr(high, part) - getattr(low, part)) / width
            error = np.abs(getattr(jacobian[column], part) - differences).max()
            if not error <= _DERIVATIVE * np.abs(differences).max() + _noise(getattr(high, part), width):
                problem = f"the derivative of the {noun} matrix by '{parameter.name}' is wrong by {error:.3g}."
                raise Nonconformity(problem, "Mend matrices_jacobian, or leave it to the base class.")


def check_translation_costs_nothing(specimen: JointSpecimen) -> None:
    """All parts moved alike feel no force: a joint acts between them, not against the ground."""
    _check_costs_nothing(specimen, 0, "moving")


def check_rotation_costs_nothing(specimen: JointSpecimen) -> None:
    """All parts turned alike feel no moment, for some displacements of their nodes: those of a rigid body."""
    _check_costs_nothing(specimen, 1, "turning")


def check_contact_dofs_are_pairs(specimen: JointSpecimen) -> None:
    """`contact_dofs` says which DOFs meet, for ``assembly.rigid()``."""
    size = specimen.component.size
    for pair in specimen.component.contact_dofs:
        whole = isinstance(pair, tuple) and len(pair) == 2 and all(isinstance(dof, (int, np.integer)) for dof in pair)
        if not whole or not all(0 <= dof < size for dof in pair) or pair[0] == pair[1]:
            problem = f"{pair!r:.60} among contact_dofs is not a pair of two of the {size} local DOFs."
            raise Nonconformity(problem, "Give pairs of DOFs: port by port, node by node, x then rz.")


def check_dynamic_stiffness_has_its_shape(specimen: JointSpecimen) -> None:
    """`dynamic_stiffness` is (n, n_freq, d, d), complex and finite."""
    Z, size = _stiffness(specimen), specimen.component.size
    wanted = (_FEW, len(FREQUENCY), size, size)
    if not isinstance(Z, np.ndarray) or Z.shape != wanted or Z.dtype.kind != "c" or not np.isfinite(Z).all():
        problem = f"dynamic_stiffness returned {getattr(Z, 'dtype', type(Z))} of shape {getattr(Z, 'shape', '?')}."
        raise Nonconformity(
            problem, f"Return a finite complex array, {wanted} for {_FEW} vectors and {len(FREQUENCY)} Hz."
        )


def check_dynamic_stiffness_is_symmetric_and_passive(specimen: JointSpecimen) -> None:
    """A law of its own is reciprocal too, and gives back no energy at any frequency."""
    _only_with_own_law(specimen)
    Z = _stiffness(specimen)
    if asymmetry(Z) > _ROUNDING:
        raise Nonconformity("dynamic_stiffness is not symmetric.", "Fill [row, column] and [column, row] alike.")
    if least_eigenvalue(Z.imag) < -_ROUNDING:
        problem = (
            "the imaginary part of dynamic_stiffness is not positive semi-definite, so the joint feeds the motion."
        )
        raise Nonconformity(problem, "With exp(i omega t) a damper is + i omega c, and a lossy spring k (1 + i eta).")


def check_dynamic_stiffness_treats_lines_and_vectors_alone(specimen: JointSpecimen) -> None:
    """One line and one vector alone give what they give among others."""
    Z = _stiffness(specimen)
    for line in range(len(FREQUENCY)):
        alone = specimen.component.dynamic_stiffness(FREQUENCY[line : line + 1].copy(), specimen.theta[2:3].copy())
        if relative_difference(alone[0, 0], Z[0, line]) > _ROUNDING:
            problem = f"at {FREQUENCY[line]:.4g} Hz alone dynamic_stiffness is another one than among other lines."
            raise Nonconformity(problem, "Use the axes (n, n_freq, d, d) of theta and frequency.")


def check_dynamic_stiffness_jacobian_meets_differences(specimen: JointSpecimen) -> None:
    """`dynamic_stiffness_jacobian` of a law of its own is its derivative, held against central differences."""
    _only_with_own_law(specimen)
    component, theta = specimen.component, specimen.theta[2 : 2 + _FEW]
    jacobian = list(component.dynamic_stiffness_jacobian(FREQUENCY.copy(), theta.copy()))
    if len(jacobian) != len(component.parameters):
        problem = f"it returned {len(jacobian)} derivatives for {len(component.parameters)} parameters."
        raise Nonconformity(problem, "Return an array for each parameter, in their order.")
    for column, parameter in enumerate(component.parameters):
        above, below, width = _moved(specimen, theta, column)
        high, low = (component.dynamic_stiffness(FREQUENCY.copy(), moved) for moved in (above, below))
        differences = (high - low) / width[..., None]
        error = np.abs(jacobian[column] - differences).max()
        if not error <= _DERIVATIVE * np.abs(differences).max() + _noise(high, width):
            problem = f"the derivative of dynamic_stiffness by '{parameter.name}' is wrong by {error:.3g}."
            raise Nonconformity(problem, "Mend dynamic_stiffness_jacobian, or leave it to the base class.")


def check_inputs_are_left_unchanged(specimen: JointSpecimen) -> None:
    """`theta` and `frequency` belong to the caller."""
    theta, frequency = specimen.theta.copy(), FREQUENCY.copy()
    specimen.component.matrices(theta)
    specimen.component.matrices_jacobian(theta)
    specimen.component.dynamic_stiffness(frequency, theta)
    if not np.array_equal(theta, specimen.theta) or not np.array_equal(frequency, FREQUENCY):
        raise Nonconformity(
            "the joint changed the arrays that it was given.", "Compute with copies: theta = theta.copy()."
        )


def check_answers_are_fresh(specimen: JointSpecimen) -> None:
    """Who writes into matrices that were returned does not change the next answer."""
    first = specimen.component.matrices(specimen.theta.copy())
    kept = {part: getattr(first, part).copy() for part in PARTS}
    for part in PARTS:
        if getattr(first, part).flags.writeable:
            getattr(first, part)[...] = -1.0
    again = specimen.component.matrices(specimen.theta.copy())
    if any(not np.array_equal(getattr(again, part), kept[part]) for part in PARTS):
        raise Nonconformity("the same parameters gave other matrices the second time.", "Return new arrays each time.")


def _shown(specimen: JointSpecimen, row: int) -> str:
    values = zip(specimen.component.parameters, specimen.theta[row], strict=True)
    return ", ".join(f"{parameter.name} = {value:.4g} {parameter.unit}" for parameter, value in values)


def _moved(
    specimen: JointSpecimen, theta: NDArray[np.float64], column: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return parameter vectors a little above and below, and the width (n, 1, 1) between them."""
    parameter = specimen.component.parameters[column]
    step = 1e-4 * np.maximum(np.abs(theta[:, column]), 1e-2 * (parameter.upper - parameter.lower))
    above, below = theta.copy(), theta.copy()
    above[:, column] += step
    below[:, column] -= step
    return above, below, (above - below)[:, column, None, None]


def _noise(values: NDArray[Any], width: NDArray[np.float64]) -> float:
    """Return what rounding may leave of a difference quotient."""
    return float(1e-14 * np.abs(values).max() / width.min())


def _check_semidefinite(specimen: JointSpecimen, part: str) -> None:
    for row, matrix in enumerate(getattr(specimen.matrices, part)):
        if least_eigenvalue(matrix) < -_ROUNDING:
            problem = f"the {PARTS[part]} matrix is not positive semi-definite for {_shown(specimen, row)}."
            raise Nonconformity(
                problem, "Look for a wrong sign; a spring adds k to two diagonal entries and -k between."
            )


def _only_with_own_law(specimen: JointSpecimen) -> None:
    if not specimen.own_law:
        raise NotApplicable("dynamic_stiffness follows from the matrices, which are checked.")


def _stiffness(specimen: JointSpecimen) -> NDArray[np.complex128]:
    return specimen.component.dynamic_stiffness(FREQUENCY.copy(), specimen.theta[2 : 2 + _FEW].copy())


def _check_costs_nothing(specimen: JointSpecimen, axis: int, verb: str) -> None:
    """Find the motion with the least effort in which all port nodes share one of their DOFs, and demand none.

    In a translation the rotations of the nodes are zero; in a rotation their displacements are free, since a joint
    does not know where its nodes are. DOFs of the joint's own are always free.
    """
    component = specimen.component
    if len(component.ports) < 2:
        raise NotApplicable("the joint has a single port, and so acts against the ground.")
    on_ports = component.size - component.internal_dofs
    held = np.arange(on_ports) if axis == 0 else np.arange(1, on_ports, 2)
    motion = (held % 2 == axis).astype(np.float64)
    for row in range(len(specimen.theta)):
        total = np.zeros((component.size, component.size))
        for part in "KCD":
            matrix = getattr(specimen.matrices, part)[row]
            total += 0.5 * (matrix + matrix.T) / (np.abs(matrix).max(initial=0.0) or 1.0)
        if least_effort(total, held, motion) > _LEAST_EFFORT:
            problem = f"{verb} all its parts alike takes effort, for {_shown(specimen, row)}."
            remedy = (
                "Act on differences: a spring k between DOFs i and j is k at (i, i), (j, j) and -k at (i, j), (j, i)."
            )
            raise Nonconformity(problem, remedy)
