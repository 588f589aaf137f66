"""Checks of substructures: nodes, matrices, and receptance by physics and against the matrices."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import DIRECTIONS, Node, SparseMatrices, StructuralMatrices, SubstructureModel
from dovetail.testing.linear_algebra import asymmetry, least_effort, least_eigenvalue, relative_difference
from dovetail.testing.outcomes import Nonconformity, NotApplicable
from dovetail.testing.specimens import FREQUENCY, SubstructureSpecimen, dense

__all__: list[str] = []

_PARTS = {"M": "mass", "K": "stiffness", "C": "viscous damping", "D": "structural damping"}
_ROUNDING = 1e-9
_SOLVED = 1e-6
_FACTORS = (2, 4)


def check_nodes_are_distinct(specimen: SubstructureSpecimen) -> None:
    """There are nodes, with labels of their own and positions, by which a description names them."""
    nodes = specimen.component.nodes
    if not isinstance(nodes, tuple) or not nodes or not all(isinstance(node, Node) for node in nodes):
        raise Nonconformity(f"nodes is {nodes!r:.60}.", "Return a tuple of dovetail.Node, one at least.")
    labels = [node.label for node in nodes]
    if len(set(labels)) < len(labels):
        raise Nonconformity("two nodes have the same label.", "Let labels differ; positions may be the same.")
    if not all(np.isfinite(float(node.position)) for node in nodes):
        raise Nonconformity("the position of a node is not finite.", "Give positions in metres.")


def check_matrices_have_the_shape_of_the_nodes(specimen: SubstructureSpecimen) -> None:
    """`matrices` returns matrices over the DOFs x and rz of every node, and inner ones behind them, or None."""
    matrices, least = specimen.matrices, len(DIRECTIONS) * len(specimen.component.nodes)
    if matrices is None:
        return
    if not isinstance(matrices, (StructuralMatrices, SparseMatrices)):
        raise Nonconformity(f"matrices returned {type(matrices).__name__}.", "Return a dovetail.StructuralMatrices.")
    shape = matrices.K.shape
    if len(shape) != 2 or shape[0] != shape[1] or shape[0] < least:
        problem = f"matrices returned arrays of shape {shape} for {least // 2} nodes."
        raise Nonconformity(problem, f"Give two DOFs to each node, x then rz: ({least}, {least}) or more.")
    for part, noun in _PARTS.items():
        if not np.isfinite(dense(getattr(matrices, part))).all():
            raise Nonconformity(f"the {noun} matrix is not finite.", "Check the options where they enter.")


def check_receptance_has_its_shape(specimen: SubstructureSpecimen) -> None:
    """`receptance` is a finite complex (n_freq, n, n) array for n DOFs."""
    _moving(specimen)
    count, H = len(specimen.dofs), specimen.receptance
    wanted = (len(FREQUENCY), count, count)
    if not isinstance(H, np.ndarray) or H.shape != wanted or H.dtype.kind != "c" or not np.isfinite(H).all():
        problem = f"receptance returned {getattr(H, 'dtype', type(H))} of shape {getattr(H, 'shape', '?')}."
        raise Nonconformity(problem, f"Return a finite complex array, {wanted} for {count} DOFs.")


def check_mass_is_symmetric_and_positive(specimen: SubstructureSpecimen) -> None:
    """No motion has negative kinetic energy."""
    _check_semidefinite(specimen, "M")


def check_stiffness_is_symmetric_and_positive(specimen: SubstructureSpecimen) -> None:
    """No motion gives energy back."""
    _check_semidefinite(specimen, "K")


def check_damping_is_symmetric_and_positive(specimen: SubstructureSpecimen) -> None:
    """No motion is fed with energy."""
    _check_semidefinite(specimen, "C")
    _check_semidefinite(specimen, "D")


def check_rigid_body_modes(specimen: SubstructureSpecimen) -> None:
    """A free part moves, and turns where its nodes turn, without effort; one that says `held` does not."""
    K = dense(_matrices(specimen).K)
    _moving(specimen)
    motions = {"displaced": np.tile([1.0, 0.0], len(specimen.component.nodes))}
    outer = np.arange(len(motions["displaced"]))
    if (np.diag(K)[outer[1::2]] > 0).all():
        positions = np.array([node.position for node in specimen.component.nodes])
        motions["turned"] = np.stack([positions - positions.mean(), np.ones(len(positions))], axis=1).ravel()
    costly = [name for name, motion in motions.items() if least_effort(K, outer, motion) > _ROUNDING]
    if specimen.component.held and not costly:
        raise Nonconformity("the part says that it is held, but nothing holds it.", "Leave `held` as it is.")
    if costly and not specimen.component.held:
        problem = f"{costly[0]} as a rigid body the part resists with its stiffness."
        raise Nonconformity(
            problem, "Rows of K times a rigid-body motion give zero; say `held` where the part is not free."
        )


def check_receptance_is_reciprocal(specimen: SubstructureSpecimen) -> None:
    """The motion at i by a force at j is that at j by a force at i."""
    _moving(specimen)
    if _scaled_asymmetry(specimen.receptance) > _SOLVED:
        raise Nonconformity(
            "the receptance matrix is not symmetric.", "Mend receptance, or symmetrise what was measured."
        )


def check_receptance_is_passive(specimen: SubstructureSpecimen) -> None:
    """Whatever the forces, they put energy in: the imaginary part of the receptance is nowhere positive."""
    _moving(specimen)
    for line, H in zip(FREQUENCY, specimen.receptance, strict=True):
        scale = 1.0 / np.sqrt(np.abs(np.diag(H)))
        scaled = scale[:, None] * H * scale
        least = float(np.linalg.eigvalsh(-0.5 * (scaled.imag + scaled.imag.T)).min())
        if least < -_SOLVED:
            raise Nonconformity(
                f"at {line:.4g} Hz some forces take energy out of the part.",
                "With exp(i omega t), loss makes the imaginary part of a receptance negative.",
            )


def check_receptance_meets_the_matrices(specimen: SubstructureSpecimen) -> None:
    """`receptance` is the inverse of the dynamic stiffness that `matrices` gives."""
    matrices = _matrices(specimen)
    _moving(specimen)
    M, K, C, D = (dense(getattr(matrices, part)) for part in "MKCD")
    active = np.union1d(np.flatnonzero(((M != 0) | (K != 0) | (C != 0) | (D != 0)).any(axis=0)), specimen.dofs)
    rows = np.searchsorted(active, specimen.dofs)
    for line, receptance in zip(FREQUENCY, specimen.receptance, strict=True):
        omega = 2.0 * np.pi * line
        Z = ((K - omega**2 * M) + 1j * (D + omega * C))[np.ix_(active, active)]
        scale = 1.0 / np.sqrt(np.abs(np.diag(Z)))
        inverse = scale[:, None] * np.linalg.inv(scale[:, None] * Z * scale) * scale
        wanted = inverse[np.ix_(rows, rows)]
        size = np.sqrt(np.outer(np.abs(np.diag(wanted)), np.abs(np.diag(wanted))))
        if relative_difference(receptance / size, wanted / size) > _SOLVED:
            problem = f"at {line:.4g} Hz receptance is not what the matrices give."
            raise Nonconformity(problem, "Leave receptance to the base class, or make both say the same.")


def check_dofs_can_be_asked_for_in_any_order(specimen: SubstructureSpecimen) -> None:
    """The receptance between some DOFs, in their order, is a part of that between all."""
    _moving(specimen)
    order = np.arange(len(specimen.dofs))[::-2]
    part = specimen.component.receptance(FREQUENCY.copy(), [specimen.dofs[index] for index in order])
    if relative_difference(part, specimen.receptance[:, order[:, None], order]) > _SOLVED:
        problem = "the receptance between some DOFs is not that part of the receptance between more of them."
        raise Nonconformity(problem, "Give rows and columns in the order of `dofs`.")


def check_each_line_is_treated_alone(specimen: SubstructureSpecimen) -> None:
    """The receptance at a line does not depend on the lines asked for beside it."""
    _moving(specimen)
    few = [1, 4, 7]
    alone = specimen.component.receptance(FREQUENCY[few], specimen.dofs)
    if relative_difference(alone, specimen.receptance[few]) > _SOLVED:
        raise Nonconformity(
            "at some lines alone the receptance is another one.", "Compute or interpolate line by line."
        )


def check_refinement_converges(specimen: SubstructureSpecimen) -> None:
    """A mesh twice and four times as fine changes the answer less and less."""
    _matrices(specimen)
    finer = [specimen.component.refined(factor) for factor in _FACTORS]
    if finer == [None, None]:
        raise NotApplicable("the part has no mesh to refine.")
    if not all(isinstance(part, SubstructureModel) for part in finer):
        raise Nonconformity("refined returned no substructure.", "Return the same part with a finer mesh.")
    parts = [specimen.component, *(part for part in finer if part is not None)]
    if not len(parts[0].nodes) < len(parts[1].nodes) < len(parts[2].nodes):
        raise Nonconformity("refined returned a part without more nodes.", "Multiply its elements by the factor.")
    coarse, fine, finest = (_at_the_ends(part) for part in parts)
    first, second = relative_difference(coarse, finest), relative_difference(fine, finest)
    if not second < 0.5 * first + _SOLVED:
        problem = (
            f"twice as fine its receptance is off by {second:.2g} of that four times as fine; unrefined by {first:.2g}."
        )
        raise Nonconformity(problem, "Check how the matrices depend on the length of an element.")


def check_dofs_have_labels(specimen: SubstructureSpecimen) -> None:
    """Messages name each DOF, and no two alike."""
    labels = [specimen.component.dof_label(dof) for dof in range(2 * len(specimen.component.nodes))]
    if len(set(labels)) < len(labels) or not all(isinstance(label, str) and label for label in labels):
        raise Nonconformity("dof_label names two DOFs alike, or not at all.", "Leave dof_label to the base class.")


def check_inputs_are_left_unchanged(specimen: SubstructureSpecimen) -> None:
    """`frequency` and `dofs` belong to the caller."""
    _moving(specimen)
    frequency, dofs = FREQUENCY.copy(), list(specimen.dofs)
    specimen.component.receptance(frequency, dofs)
    if not np.array_equal(frequency, FREQUENCY) or dofs != specimen.dofs:
        raise Nonconformity("receptance changed what it was given.", "Compute with copies.")


def check_answers_are_fresh(specimen: SubstructureSpecimen) -> None:
    """Who writes into an answer does not change the next one."""
    _moving(specimen)
    kept = specimen.receptance.copy()
    first = specimen.component.receptance(FREQUENCY.copy(), specimen.dofs)
    if first.flags.writeable:
        first[...] = -1.0
    matrices = specimen.component.matrices()
    if matrices is not None and isinstance(matrices.K, np.ndarray) and matrices.K.flags.writeable:
        matrices.K[...] = -1.0
    if not np.array_equal(specimen.component.receptance(FREQUENCY.copy(), specimen.dofs), kept):
        raise Nonconformity("the same question got another answer the second time.", "Return new or read-only arrays.")


def _matrices(specimen: SubstructureSpecimen) -> StructuralMatrices | SparseMatrices:
    if specimen.matrices is None:
        raise NotApplicable("the part is known by its FRFs only.")
    return specimen.matrices


def _moving(specimen: SubstructureSpecimen) -> None:
    if specimen.component.grounded:
        raise NotApplicable("the part does not move.")


def _check_semidefinite(specimen: SubstructureSpecimen, part: str) -> None:
    matrix = dense(getattr(_matrices(specimen), part))
    if asymmetry(matrix) > _ROUNDING:
        raise Nonconformity(
            f"the {_PARTS[part]} matrix is not symmetric.", "Fill [row, column] and [column, row] alike."
        )
    if least_eigenvalue(matrix) < -_ROUNDING:
        raise Nonconformity(f"the {_PARTS[part]} matrix is not positive semi-definite.", "Look for a wrong sign.")


def _unit_free(H: NDArray[Any]) -> NDArray[Any]:
    scale = 1.0 / np.sqrt(np.abs(np.diag(H)))
    return np.asarray(scale[:, None] * H * scale)


def _scaled_asymmetry(H: NDArray[np.complex128]) -> float:
    return max(asymmetry(_unit_free(line)) for line in H)


def _at_the_ends(part: SubstructureModel) -> NDArray[np.complex128]:
    positions = [node.position for node in part.nodes]
    ends = [2 * int(np.argmin(positions)), 2 * int(np.argmax(positions))]
    return part.receptance(FREQUENCY.copy(), ends)
