"""Checks of joints: their declarations, and their matrices over the whole ranges of the parameters."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import DIRECTIONS, StructuralMatrices, joint_faults
from dovetail.testing.answers import PARTS
from dovetail.testing.linear_algebra import asymmetry, least_effort, least_eigenvalue, loosest, relative_difference
from dovetail.testing.outcomes import Nonconformity, NotApplicable
from dovetail.testing.specimens import FREQUENCY, JointSpecimen
from dovetail.units import dimension

_ROUNDING = 1e-9
"""Relative to the largest entry: sums in another order differ by about 1e-15 for each of up to a thousand terms."""
_SINGLE = 1e-3
"""Relative to the largest entry, for parameters in single precision: 6e-8, with a margin for powers and differences."""
_LEAST_EFFORT = 1e-7
"""Relative to the efforts of single DOFs: a joint's stiffnesses differ by up to 1e8, so that rounding leaves 1e-8."""
_AT_REST = 1e-3
"""Frequency [Hz] at which inertia is negligible in a frequency-dependent dynamic stiffness."""
_LOOSE = 1e-12
"""Smallest singular value of scaled matrices below which a motion is taken to be free."""
_BATCHES = 24
"""Number of batches of each size, spread over the vectors."""


def check_ports_parameters_and_dofs_are_declared(specimen: JointSpecimen) -> None:
    """Ports, parameters and DOFs are declared and consistent, which all other checks require."""
    for fault in joint_faults(specimen.component):
        raise Nonconformity(f"the joint {fault.problem}", fault.accepted and f"Give {fault.accepted}.")
    if not specimen.component.ports:
        raise Nonconformity("the joint has no port.", "Give it a JointPort for each part that it attaches to.")


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
    """All matrices are finite for all parameter vectors within the ranges."""
    for part, noun in PARTS.items():
        finite = np.isfinite(getattr(specimen.matrices, part)).all(axis=(1, 2))
        if not finite.all():
            vector = specimen.shown(specimen.theta[int(np.argmin(finite))])
            raise Nonconformity(
                f"the {noun} matrix is not finite for {vector}.", "Narrow the ranges, or correct matrices."
            )


def check_dynamic_stiffness_has_its_shape(specimen: JointSpecimen) -> None:
    """`dynamic_stiffness` is (n, n_freq, d, d), complex, and finite from 1 Hz to 20 kHz."""
    size = specimen.component.size
    few = 4
    for frequency, count in ((specimen.lines, few), (specimen.lines[:1], 1), (specimen.lines, 1)):
        Z = specimen.component.dynamic_stiffness(frequency.copy(), specimen.some(count).copy())
        wanted = (count, len(frequency), size, size)
        if not isinstance(Z, np.ndarray) or Z.shape != wanted or Z.dtype.kind != "c" or not np.isfinite(Z).all():
            problem = f"dynamic_stiffness returned {getattr(Z, 'dtype', type(Z))} of shape {getattr(Z, 'shape', '?')}"
            finite = ", with values that are not finite" if getattr(Z, "shape", None) == wanted else ""
            remedy = f"Return a finite complex array, {wanted} for {count} vectors and {len(frequency)} lines."
            raise Nonconformity(f"{problem}{finite}.", remedy)


def check_parameters_are_described(specimen: JointSpecimen) -> None:
    """Each parameter has a description, for users who set its range."""
    bare = [parameter.name for parameter in specimen.component.parameters if not parameter.description.strip()]
    if bare:
        raise Nonconformity(f"without a description: {', '.join(bare)}.", "Give Parameter its sixth argument.")


def check_parameters_are_in_si_units(specimen: JointSpecimen) -> None:
    """Each parameter has an SI unit without a prefix, as descriptions, results and figures require."""
    for parameter in specimen.component.parameters:
        if dimension(parameter.unit)[0] != 1.0:
            problem = f"'{parameter.name}' is in {parameter.unit}."
            raise Nonconformity(problem, "Use N/m, N m/rad, N s/m, kg, kg m^2, m, Hz, 1; descriptions may write kN/m.")


def check_matrices_are_symmetric(specimen: JointSpecimen) -> None:
    """All matrices are symmetric: Newton's third law and Maxwell's reciprocity."""
    for part, noun in PARTS.items():
        if asymmetry(getattr(specimen.matrices, part)) > _ROUNDING:
            raise Nonconformity(f"the {noun} matrix is not symmetric.", "Fill [row, column] and [column, row] equally.")


def check_stiffness_is_positive_semidefinite(specimen: JointSpecimen) -> None:
    """No motion has negative strain energy."""
    _check_semidefinite(specimen, "K")


def check_mass_is_positive_semidefinite(specimen: JointSpecimen) -> None:
    """No motion has negative kinetic energy."""
    _check_semidefinite(specimen, "M")


def check_damping_is_positive_semidefinite(specimen: JointSpecimen) -> None:
    """No motion gains energy from damping."""
    _check_semidefinite(specimen, "C")
    _check_semidefinite(specimen, "D")


def check_each_vector_of_a_batch_is_treated_alone(specimen: JointSpecimen) -> str:
    """Batches of 1, 2, 3 and 500, and of as many vectors as parameters or DOFs, give the same as one large batch."""
    component, many = specimen.component, len(specimen.theta)
    for count in sorted({1, 2, 3, len(component.parameters), component.size, 500}):
        first = np.linspace(0, max(0, many - count), _BATCHES).astype(int)
        for start in dict.fromkeys(first.tolist()) if 0 < count <= many else ():
            rows = np.arange(start, start + count)[::-1]
            answer = component.matrices(specimen.theta[rows])
            for part, noun in PARTS.items():
                expected = getattr(specimen.matrices, part)[rows]
                if relative_difference(getattr(answer, part), expected) > _ROUNDING:
                    problem = f"the {noun} matrix of a vector differs between batches of {count} and {many}."
                    remedy = "Use the vectors' own axis: theta is (n, n_params), matrices are (n, d, d)."
                    raise Nonconformity(problem, remedy)
    start_time = time.perf_counter()
    component.matrices(specimen.theta.copy())
    return f"{many} vectors took {1e3 * (time.perf_counter() - start_time):.2g} ms"


def check_theta_may_be_any_array(specimen: JointSpecimen) -> None:
    """Parameters may be in any array: its type, its memory layout and a read-only flag do not matter."""
    parameters = specimen.component.parameters
    theta = specimen.vectors(np.random.default_rng(0).uniform(0.1, 0.9, (9, len(parameters))))
    read_only = theta.copy()
    read_only.flags.writeable = False
    kinds: dict[str, NDArray[Any]] = {
        "in Fortran order": np.asfortranarray(theta),
        "with other numbers between": np.repeat(theta, 2, axis=0)[::2],
        "that is read-only": read_only,
        "in single precision": theta.astype(np.float32),
    }
    least, greatest = (np.array([getattr(p, end) for p in parameters], dtype=float) for end in ("lower", "upper"))
    if (np.ceil(least) <= np.floor(greatest)).all():
        kinds["of whole numbers"] = np.clip(np.round(theta), np.ceil(least), np.floor(greatest)).astype(np.int64)
    for kind, array in kinds.items():
        same = np.array(array, dtype=np.float64, order="C")
        answer, wanted = specimen.component.matrices(array), specimen.component.matrices(same)
        limit = _SINGLE if array.dtype == np.float32 else _ROUNDING
        if any(relative_difference(getattr(answer, part), getattr(wanted, part)) > limit for part in PARTS):
            problem = f"for an array {kind} matrices gives other results than for the same numbers."
            raise Nonconformity(problem, "Begin with theta = numpy.asarray(theta, dtype=float), and use its axes.")
    specimen.component.matrices_jacobian(read_only)
    specimen.component.dynamic_stiffness(FREQUENCY.copy(), read_only)


def check_every_port_and_dof_is_used(specimen: JointSpecimen) -> None:
    """Each port and each internal DOF has an entry in a matrix, and no internal DOF moves without a force."""
    component, first = specimen.component, 0
    Z = specimen.stiffness(specimen.lines, specimen.some(64))
    filled = (Z != 0).any(axis=(0, 1, 2))
    filled[[dof for pair in component.merged_dofs for dof in pair]] = True
    for port in component.ports:
        dofs = slice(first, first := first + len(port.directions) * port.nodes)
        if not filled[dofs].any():
            raise Nonconformity(f"no matrix has an entry for the port '{port.name}'.", "Attach it, or remove it.")
    if not filled[first:].all():
        number = first + int(np.argmin(filled[first:]))
        raise Nonconformity(f"no matrix has an entry for the joint's own DOF {number}.", "Lower internal_dofs.")
    if (loosest(Z[:, :, first:, first:]) < _LOOSE).all():
        problem = "DOFs of the joint's own can move without any force."
        raise Nonconformity(problem, "Connect them to the ports with springs, or give them masses.")


def check_translation_costs_nothing(specimen: JointSpecimen) -> None:
    """A common translation of all parts needs no force: a joint acts between them, not against the ground."""
    _check_costs_nothing(specimen, "moving", DIRECTIONS[:3])


def check_rotation_costs_nothing(specimen: JointSpecimen) -> None:
    """A common rotation of all parts, with the displacements of a rigid body, needs no moment."""
    _check_costs_nothing(specimen, "turning", DIRECTIONS[3:])


def check_contact_dofs_are_pairs(specimen: JointSpecimen) -> None:
    """`contact_dofs`, for ``assembly.rigid()``, are pairs of displacements or pairs of rotations."""
    size = specimen.component.size
    try:
        pairs = specimen.component.contact_dofs
    except NotImplementedError as error:
        raise NotApplicable("the joint does not define its contact_dofs, and so cannot be taken as rigid.") from error
    for pair in pairs:
        whole = isinstance(pair, tuple) and len(pair) == 2 and all(isinstance(dof, (int, np.integer)) for dof in pair)
        if not whole or not all(0 <= dof < size for dof in pair) or pair[0] == pair[1]:
            problem = f"{pair!r:.60} among contact_dofs is not a pair of two of the {size} local DOFs."
            raise Nonconformity(problem, "Give pairs of DOFs: port by port, node by node, direction by direction.")
        _check_direction(specimen, pair, "contact_dofs")


def check_merged_dofs_have_one_direction(specimen: JointSpecimen) -> None:
    """Merged DOFs are pairs of displacements or pairs of rotations."""
    if not specimen.component.merged_dofs:
        raise NotApplicable("the joint merges no DOFs.")
    for pair in specimen.component.merged_dofs:
        _check_direction(specimen, pair, "merged_dofs")


def check_inputs_are_left_unchanged(specimen: JointSpecimen) -> None:
    """The caller's arrays `theta` and `frequency` are not changed."""
    vectors = specimen.some(16)
    theta, frequency = vectors.copy(), FREQUENCY.copy()
    specimen.component.matrices(theta)
    specimen.component.matrices_jacobian(theta)
    specimen.component.dynamic_stiffness(frequency, theta)
    if not np.array_equal(theta, vectors) or not np.array_equal(frequency, FREQUENCY):
        raise Nonconformity("the joint changed the caller's arrays.", "Compute with copies: theta = theta.copy().")


def check_results_are_new_arrays(specimen: JointSpecimen) -> None:
    """Writing into returned matrices does not change later ones."""
    first = specimen.component.matrices(specimen.theta.copy())
    kept = {part: getattr(first, part).copy() for part in PARTS}
    for part in PARTS:
        if getattr(first, part).flags.writeable:
            getattr(first, part)[...] = -1.0
    again = specimen.component.matrices(specimen.theta.copy())
    if any(not np.array_equal(getattr(again, part), kept[part]) for part in PARTS):
        raise Nonconformity(
            "a second call with the same parameters gave other matrices.", "Return new arrays each time."
        )


def _check_direction(specimen: JointSpecimen, pair: tuple[int, int], said: str) -> None:
    """Compare the directions of two DOFs of ports; those of internal DOFs are unknown."""
    dofs = specimen.component.node_dofs
    words = [dofs[dof][1] for dof in pair if dof < dofs.size]
    if len(set(words)) == 2:
        problem = f"the pair {pair} among {said} combines a DOF {words[0]} with a DOF {words[1]}."
        raise Nonconformity(problem, "Combine DOFs of one direction, see JointModel.node_dofs.")


def _check_semidefinite(specimen: JointSpecimen, part: str) -> None:
    least = least_eigenvalue(getattr(specimen.matrices, part))
    if (least < -_ROUNDING).any():
        vector = specimen.shown(specimen.theta[int(np.argmin(least))])
        problem = f"the {PARTS[part]} matrix is not positive semi-definite for {vector}."
        raise Nonconformity(problem, "Look for a wrong sign; a spring adds k to two diagonal entries and -k between.")


def _check_costs_nothing(specimen: JointSpecimen, verb: str, directions: Sequence[str]) -> None:
    """Find the motion with the least effort in which one DOF is the same for all port nodes; it must be zero.

    In a translation the rotations of the nodes are zero; in a rotation their displacements are free, since a joint
    does not know where its nodes are. Internal DOFs are always free.
    """
    component = specimen.component
    if len(component.ports) < 2:
        raise NotApplicable("the joint has a single port, and so acts against the ground.")
    dofs = component.node_dofs
    held = np.flatnonzero(dofs.rotations) if verb == "turning" else np.arange(dofs.size)
    motions = [np.array([dofs[int(dof)][1] == each for dof in held], dtype=np.float64) for each in directions]
    total = np.sum([_normalised(getattr(specimen.matrices, part)) for part in "KCD"], axis=0)
    if specimen.own_law:
        chosen = specimen.some(200)
        at_rest = specimen.stiffness(np.array([_AT_REST]), chosen)[:, 0].real
        total = np.concatenate([total, _normalised(at_rest)])
    efforts = [least_effort(total, held, motion) for motion in motions if motion.any()]
    if not efforts:
        raise NotApplicable("it does not act in such directions.")
    costly = np.max(efforts, axis=0) > _LEAST_EFFORT
    if costly.any():
        row = int(np.argmax(costly))
        vectors = [*specimen.theta, *(specimen.some(200) if specimen.own_law else ())]
        problem = f"{verb} all its parts equally takes a force, for {specimen.shown(vectors[row])}."
        remedy = "Act on differences: a spring k between DOFs i and j is k at (i, i), (j, j) and -k at (i, j), (j, i)."
        raise Nonconformity(problem, remedy)


def _normalised(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the symmetric parts of (n, d, d) matrices over their largest entries."""
    greatest = np.abs(matrices).max(axis=(1, 2), keepdims=True, initial=0.0)
    return np.asarray(0.5 * (matrices + np.swapaxes(matrices, 1, 2)) / np.where(greatest > 0, greatest, 1.0))
