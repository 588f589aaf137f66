"""Checks of substructures: nodes, matrices, the physics of the receptance, and its agreement with the matrices."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.documents.option_fields import numbers_within
from dovetail.interfaces import (
    PartNode,
    SparseMatrices,
    StructuralMatrices,
    SubstructureModel,
    node_faults,
    rigid_body_motions,
)
from dovetail.testing.answers import PARTS
from dovetail.testing.linear_algebra import asymmetry, dense, least_effort, least_eigenvalue, relative_difference
from dovetail.testing.outcomes import Nonconformity, NotApplicable, Reservation
from dovetail.testing.specimens import SubstructureSpecimen

_ROUNDING = 1e-9
"""Relative difference by rounding at most."""
_SOLVED = 1e-6
"""Relative difference that a solved system of equations may have."""
_TOLERANCE = 1e-3
"""Error of a condensation that would be visible in a measured FRF."""
_NEIGHBOURS = (0.99, 1.0, 1.02)
"""Values of an option in a batch of matrices, relative to its value; their differences from the first if that is 0."""


def check_nodes_are_distinct(specimen: SubstructureSpecimen) -> None:
    """There is at least one node, and nodes have different labels and finite positions."""
    nodes = specimen.component.nodes
    if not isinstance(nodes, tuple) or not nodes or not all(isinstance(node, PartNode) for node in nodes):
        raise Nonconformity(f"nodes is {nodes!r:.60}.", "Return a tuple of dovetail.PartNode, one at least.")
    labels = [node.label for node in nodes]
    if len(set(labels)) < len(labels):
        raise Nonconformity("two nodes have the same label.", "Use different labels; positions may be equal.")
    for fault in node_faults(nodes):
        raise Nonconformity(f"it {fault.problem}", f"Accepted: {fault.accepted}.")


def check_matrices_have_the_shape_of_the_nodes(specimen: SubstructureSpecimen) -> None:
    """`matrices` returns finite matrices of the DOFs of all nodes, followed by inner DOFs, or None."""
    matrices, least = specimen.matrices, specimen.component.node_dofs.size
    if matrices is None:
        return
    if not isinstance(matrices, (StructuralMatrices, SparseMatrices)):
        raise Nonconformity(f"matrices returned {type(matrices).__name__}.", "Return a dovetail.StructuralMatrices.")
    shape = matrices.K.shape
    if len(shape) != 2 or shape[0] != shape[1] or shape[0] < least:
        problem = f"matrices returned arrays of shape {shape} for {len(specimen.component.nodes)} nodes."
        raise Nonconformity(problem, f"Give each node a DOF in each of its directions: ({least}, {least}) or more.")
    for part, noun in PARTS.items():
        if not np.isfinite(dense(getattr(matrices, part))).all():
            raise Nonconformity(f"the {noun} matrix is not finite.", "Check the options where they enter.")


def check_every_node_and_dof_is_used(specimen: SubstructureSpecimen) -> None:
    """Each node, and each inner DOF, has an entry in a matrix."""
    matrices, dofs = part_matrices(specimen), specimen.component.node_dofs
    count = dofs.size
    _only_if_movable(specimen)
    filled = np.any([(dense(getattr(matrices, part)) != 0).any(axis=0) for part in PARTS], axis=0)
    own = [node for node in range(len(dofs.directions)) if node not in dofs.carriers]
    idle = ~np.array([filled[list(dofs.at_node(node))].any() for node in own])
    if idle.any():
        label = specimen.component.nodes[own[int(np.argmax(idle))]].label
        raise Nonconformity(f"no matrix has an entry for the node '{label}'.", "Connect it to the part, or remove it.")
    if not filled[count:].all():
        problem = f"no matrix has an entry for the inner DOF {count + int(np.argmin(filled[count:]))}."
        raise Nonconformity(problem, "Leave out DOFs with neither mass nor stiffness.")


def check_absent_dofs_and_tolerance_are_in_range(specimen: SubstructureSpecimen) -> None:
    """`absent_dofs` is a set of DOFs, empty for a part with matrices; `condensation_tolerance` is a small number."""
    absent, count = specimen.component.absent_dofs, specimen.component.node_dofs.size
    if not isinstance(absent, frozenset) or not all(isinstance(dof, int) and 0 <= dof < count for dof in absent):
        problem = f"absent_dofs is {absent!r:.60}, and the nodes have {count} DOFs."
        raise Nonconformity(problem, "Return a frozenset of DOFs of the nodes, as node_dofs numbers them.")
    if absent and specimen.matrices is not None:
        problem = "it names absent_dofs, and has matrices."
        raise Nonconformity(problem, "Leave rows and columns of zeros in the matrices instead.")
    tolerance = specimen.component.condensation_tolerance
    if isinstance(tolerance, bool) or not isinstance(tolerance, (int, float)) or not 0 <= tolerance <= _TOLERANCE:
        problem = f"condensation_tolerance is {tolerance!r:.40}."
        raise Nonconformity(problem, f"Return a relative error from 0 to {_TOLERANCE:g}.")


def check_constraints_are_of_a_part_with_frfs(specimen: SubstructureSpecimen) -> None:
    """`constraints` has a column for each DOF of the nodes, and no rows for a part with matrices."""
    rows, count = specimen.component.constraints, specimen.component.node_dofs.size
    if not isinstance(rows, np.ndarray) or rows.dtype != np.float64 or rows.ndim != 2 or rows.shape[1] != count:
        problem = f"constraints is {rows!r:.60}, and the nodes have {count} DOFs."
        raise Nonconformity(problem, f"Return an array of float64 of the shape (n, {count}).")
    if not np.isfinite(rows).all():
        raise Nonconformity("constraints has numbers that are not finite.")
    if len(rows) and specimen.matrices is not None:
        problem = "it has constraints, and matrices."
        raise Nonconformity(problem, "Return matrices of independent DOFs; nodes can carry others.")


def check_outline_is_sections_in_order(specimen: SubstructureSpecimen) -> None:
    """`outline` has start, stop, outer and inner diameter of consecutive sections, or is empty."""
    outline = specimen.component.outline
    try:
        start, stop, outer, inner = np.reshape(np.asarray(outline, dtype=np.float64), (-1, 4)).T
    except (TypeError, ValueError):
        raise Nonconformity(
            f"outline is {outline!r:.60}.", "Return (start, stop, outer, inner) of each section."
        ) from None
    sound = np.isfinite(outer).all() and (start < stop).all() and (inner >= 0).all() and (inner < outer).all()
    if not sound or not np.allclose(start[1:], stop[:-1], rtol=0.0, atol=1e-9):
        problem = "the sections of its outline do not follow each other, or have diameters that cannot be."
        raise Nonconformity(problem, "Let each begin where the one before ends, with 0 <= inner < outer, in metres.")


def check_receptance_has_its_shape(specimen: SubstructureSpecimen) -> str:
    """`receptance` is a finite complex (n_freq, n, n) array for n DOFs."""
    only_with_receptance(specimen)
    count = len(specimen.dofs)
    H = specimen.component.receptance(specimen.lines.copy(), list(specimen.dofs))
    wanted = (len(specimen.lines), count, count)
    if not isinstance(H, np.ndarray) or H.shape != wanted or H.dtype.kind != "c" or not np.isfinite(H).all():
        problem = f"receptance returned {getattr(H, 'dtype', type(H))} of shape {getattr(H, 'shape', '?')}."
        raise Nonconformity(problem, f"Return a finite complex array, {wanted} for {count} DOFs.")
    start = time.perf_counter()
    specimen.component.receptance(specimen.lines.copy(), list(specimen.dofs))
    return f"{len(specimen.lines)} lines took {1e3 * (time.perf_counter() - start):.2g} ms"


def check_mass_is_symmetric_and_positive(specimen: SubstructureSpecimen) -> None:
    """The mass matrix is symmetric and positive semi-definite, and a part with rotary inertia has mass."""
    _check_semidefinite(specimen, "M")
    rotations = specimen.component.node_dofs.rotations
    outer = np.diag(dense(part_matrices(specimen).M))[: len(rotations)]
    if (outer[rotations] > 0).any() and not (outer[~rotations] > 0).any():
        raise Nonconformity("it has rotary inertia but no mass.", "A node's rotations follow its displacements.")
    if not specimen.component.grounded and not specimen.has_receptance:
        raise Reservation(
            "a motion of the free part meets no mass.", "Give it mass, or use it between parts with mass."
        )


def check_stiffness_is_symmetric_and_positive(specimen: SubstructureSpecimen) -> None:
    """The stiffness matrix is symmetric and positive semi-definite: no motion has negative strain energy."""
    _check_semidefinite(specimen, "K")


def check_damping_is_symmetric_and_positive(specimen: SubstructureSpecimen) -> None:
    """Damping matrices are symmetric and positive semi-definite: no motion gains energy."""
    _check_semidefinite(specimen, "C")
    _check_semidefinite(specimen, "D")


def check_rigid_body_modes(specimen: SubstructureSpecimen) -> None:
    """Rigid-body motion of a free part needs no effort, except for a part that is `held`."""
    K = dense(part_matrices(specimen).K)
    _only_if_movable(specimen)
    nodes, rotations = specimen.component.nodes, specimen.component.node_dofs.rotations
    middle = np.mean([node.coordinates for node in nodes], axis=0)
    centred = [replace(node, point=tuple(np.subtract(node.coordinates, middle).tolist())) for node in nodes]
    whole, outer = rigid_body_motions(centred), np.arange(len(rotations))
    motions = [("displaced", whole[:, axis]) for axis in range(3) if whole[~rotations, axis].any()]
    if (np.diag(K)[outer[rotations]] > 0).all():
        motions += [("turned", whole[:, axis]) for axis in range(3, 6) if whole[rotations, axis].any()]
    costly = [name for name, motion in motions if float(least_effort(K, outer, motion)) > _ROUNDING]
    if specimen.component.held and not costly:
        raise Nonconformity(
            "the part sets `held`, but its rigid-body motion needs no force.", "Do not override `held`."
        )
    if costly and not specimen.component.held:
        problem = f"{costly[0]} as a rigid body needs a force."
        raise Nonconformity(
            problem, "Rows of K times a rigid-body motion give zero; override `held` if the part is not free."
        )


def check_receptance_is_reciprocal(specimen: SubstructureSpecimen) -> None:
    """The motion at i per force at j equals the motion at j per force at i."""
    only_with_receptance(specimen)
    if max(asymmetry(_unit_free(H)) for H in specimen.receptance) > _SOLVED:
        raise Nonconformity(
            "the receptance matrix is not symmetric.", "Mend receptance, or symmetrise what was measured."
        )


def check_receptance_is_passive(specimen: SubstructureSpecimen) -> None:
    """No forces take energy out of the part: the imaginary part of the receptance is negative semi-definite."""
    only_with_receptance(specimen)
    for line, H in zip(specimen.lines, specimen.receptance, strict=True):
        loss = -_unit_free(H).imag
        least = float(np.linalg.eigvalsh(0.5 * (loss + loss.T)).min())
        if least < -_SOLVED:
            raise Nonconformity(
                f"at {line:.4g} Hz some forces take energy out of the part.",
                "With exp(i omega t), loss makes the imaginary part of a receptance negative.",
            )


def check_receptance_meets_the_matrices(specimen: SubstructureSpecimen) -> None:
    """`receptance` is the inverse of the dynamic stiffness from `matrices`."""
    matrices = part_matrices(specimen)
    only_with_receptance(specimen)
    M, K, C, D = (dense(getattr(matrices, part)) for part in "MKCD")
    active = np.union1d(np.flatnonzero(((M != 0) | (K != 0) | (C != 0) | (D != 0)).any(axis=0)), specimen.dofs)
    rows = np.searchsorted(active, specimen.dofs)
    for line, receptance in zip(specimen.lines, specimen.receptance, strict=True):
        omega = 2.0 * np.pi * line
        Z = ((K - omega**2 * M) + 1j * (D + omega * C))[np.ix_(active, active)]
        scale = 1.0 / np.sqrt(np.abs(np.diag(Z)))
        inverse = scale[:, None] * np.linalg.inv(scale[:, None] * Z * scale) * scale
        wanted = inverse[np.ix_(rows, rows)]
        size = np.sqrt(np.outer(np.abs(np.diag(wanted)), np.abs(np.diag(wanted))))
        if relative_difference(receptance / size, wanted / size) > _SOLVED:
            problem = f"at {line:.4g} Hz receptance disagrees with the matrices."
            raise Nonconformity(problem, "Inherit receptance from the base class, or make both agree.")


def check_dofs_can_be_asked_for_in_any_order(specimen: SubstructureSpecimen) -> None:
    """The receptance between any sequence of DOFs, even with repetition, is the same part of that between all."""
    only_with_receptance(specimen)
    count = len(specimen.dofs)
    for order in (np.arange(count)[::-2], np.array([count - 1]), np.array([0, count - 1, 0])):
        part = specimen.component.receptance(specimen.lines.copy(), [specimen.dofs[index] for index in order])
        whole = specimen.receptance[:, order[:, None], order]
        if part.shape != whole.shape or relative_difference(part, whole) > _SOLVED:
            problem = "the receptance between some DOFs is not the part of that between all."
            raise Nonconformity(problem, "Order rows and columns as in `dofs`.")


def check_each_line_is_treated_alone(specimen: SubstructureSpecimen) -> None:
    """The receptance at a line is the same for one line and for many, which may be unsorted or repeated."""
    only_with_receptance(specimen)
    for order in ([1, 4, 7], [3], [6, 0, 2, 2, 5]):
        result, whole = specimen.component.receptance(specimen.lines[order], specimen.dofs), specimen.receptance[order]
        if result.shape != whole.shape or relative_difference(result, whole) > _SOLVED:
            problem = f"at {len(order)} of the lines, in another order, the receptance differs."
            raise Nonconformity(problem, "Compute or interpolate line by line.")


def check_dofs_and_frequencies_may_be_any_sequence(specimen: SubstructureSpecimen) -> None:
    """DOFs may be a list, a tuple or an array; frequencies may be integers or read-only."""
    only_with_receptance(specimen)
    whole = np.array([1500, 20, 333])
    read_only = whole.astype(np.float64)
    read_only.flags.writeable = False
    wanted = specimen.component.receptance(whole.astype(np.float64), list(specimen.dofs)).copy()
    for kind, frequency, dofs in (
        ("DOFs in a tuple", whole.astype(np.float64), tuple(specimen.dofs)),
        ("DOFs in an array", whole.astype(np.float64), np.array(specimen.dofs)),
        ("frequencies of whole numbers", whole, list(specimen.dofs)),
        ("frequencies that are read-only", read_only, list(specimen.dofs)),
    ):
        if relative_difference(specimen.component.receptance(frequency, dofs), wanted) > _SOLVED:  # type: ignore[arg-type]
            problem = f"for {kind} the receptance differs."
            raise Nonconformity(problem, "Begin with numpy.asarray(frequency, dtype=float) and numpy.asarray(dofs).")


def check_batched_matrices_are_those_of_each_value(specimen: SubstructureSpecimen) -> None:
    """`batched_matrices` returns the matrices of the part constructed with each value of its options, or None."""
    part = specimen.component
    near = np.array(_NEIGHBOURS)
    numbers = {".".join(map(str, number.path)): number.value for number in numbers_within(part.config)}
    every = {place: value * near if value else near - near[0] for place, value in numbers.items()}
    sets = [*({place: values} for place, values in every.items()), every]
    if sum(_check_batch(part, options) for options in sets if options) == 0:
        raise NotApplicable("the part gives no batch of matrices.")


def _check_batch(part: SubstructureModel, options: Mapping[str, NDArray[np.float64]]) -> bool:
    """Compare a batch with parts constructed with its values; return whether there is a batch."""
    try:
        rows = [dict(zip(options, row, strict=True)) for row in np.stack(list(options.values()), axis=1).tolist()]
        changed = [part.config.with_options(row).model_dump(by_alias=True) for row in rows]
        singles = [type(part)(type(part.config).model_validate(options)).matrices() for options in changed]
    except Exception:  # the part cannot have such options
        return False
    batch = part.batched_matrices({place: values.copy() for place, values in options.items()})
    if batch is None:
        return False
    places, shape = ", ".join(f"'{place}'" for place in options), (len(singles), *batch.K.shape[-2:])
    for index, single in enumerate(singles):
        for name, noun in PARTS.items():
            array = getattr(batch, name)
            if array.shape not in (shape, shape[1:]):
                problem = f"for {len(singles)} values of {places} the {noun} matrices have the shape {array.shape}."
                raise Nonconformity(problem, f"Return {shape}.")
            if relative_difference(np.broadcast_to(array, shape)[index], getattr(single, name)) > _ROUNDING:
                problem = f"for {rows[index]} the {noun} matrix differs from that of the part constructed with it."
                raise Nonconformity(problem, "Let every option enter the batch as it enters matrices().")
    return True


def check_dofs_have_labels(specimen: SubstructureSpecimen) -> None:
    """Each DOF has a different label for messages."""
    labels = [specimen.component.dof_label(dof) for dof in range(specimen.component.node_dofs.size)]
    if len(set(labels)) < len(labels) or not all(isinstance(label, str) and label for label in labels):
        raise Nonconformity("dof_label returns equal or empty labels.", "Inherit dof_label from the base class.")


def check_inputs_are_left_unchanged(specimen: SubstructureSpecimen) -> None:
    """The caller's `frequency` and `dofs` are not changed."""
    only_with_receptance(specimen)
    frequency, dofs = specimen.lines.copy(), list(specimen.dofs)
    specimen.component.receptance(frequency, dofs)
    if not np.array_equal(frequency, specimen.lines) or dofs != specimen.dofs:
        raise Nonconformity("receptance changed the caller's arrays.", "Compute with copies.")


def check_results_are_new_arrays(specimen: SubstructureSpecimen) -> None:
    """Writing into a returned array does not change later results."""
    only_with_receptance(specimen)
    kept = specimen.receptance.copy()
    first = specimen.component.receptance(specimen.lines.copy(), specimen.dofs)
    if first.flags.writeable:
        first[...] = -1.0
    matrices = specimen.component.matrices()
    if matrices is not None and isinstance(matrices.K, np.ndarray) and matrices.K.flags.writeable:
        matrices.K[...] = -1.0
    if not np.array_equal(specimen.component.receptance(specimen.lines.copy(), specimen.dofs), kept):
        raise Nonconformity("a second call with the same input gave another result.", "Return new or read-only arrays.")


def part_matrices(specimen: SubstructureSpecimen) -> StructuralMatrices | SparseMatrices:
    """Return the matrices of a part; the check does not apply to one that is known by its FRFs only."""
    if specimen.matrices is None:
        raise NotApplicable("the part is known by its FRFs only.")
    return specimen.matrices


def _only_if_movable(specimen: SubstructureSpecimen) -> None:
    if specimen.component.grounded:
        raise NotApplicable("the part does not move.")


def only_with_receptance(specimen: SubstructureSpecimen) -> None:
    """Leave the check out for a part that forces do not move by finite amounts."""
    _only_if_movable(specimen)
    if not specimen.has_receptance:
        raise NotApplicable("some motion of the uncoupled part needs no force, so it has no receptance.")


def _check_semidefinite(specimen: SubstructureSpecimen, part: str) -> None:
    matrix = dense(getattr(part_matrices(specimen), part))
    if asymmetry(matrix) > _ROUNDING:
        raise Nonconformity(
            f"the {PARTS[part]} matrix is not symmetric.", "Fill [row, column] and [column, row] equally."
        )
    if float(least_eigenvalue(matrix)) < -_ROUNDING:
        raise Nonconformity(f"the {PARTS[part]} matrix is not positive semi-definite.", "Look for a wrong sign.")


def _unit_free(H: NDArray[Any]) -> NDArray[Any]:
    """Return a matrix with rows and columns over the roots of its diagonal, so that x and rz compare."""
    scale = 1.0 / np.sqrt(np.abs(np.diag(H)))
    return np.asarray(scale[:, None] * H * scale)
