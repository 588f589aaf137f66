"""Condensation of a substructure to the dynamic stiffness of its boundary, at each frequency.

The method depends on what the substructure provides: small matrices or chains of elements, large sparse matrices, or
receptances only.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError, Fault, PluginError
from dovetail.interfaces import NodeDofs, SparseMatrices, StructuralMatrices, SubstructureModel, plugin_errors
from dovetail.interfaces.matrices import refusing_complex_values
from dovetail.synthesis.elimination import plan_elimination, run_elimination
from dovetail.synthesis.sparse_condensation import PartitionedMatrices, condense_on_basis


@dataclass(frozen=True)
class Settings:
    """Limits of the symbolic elimination and of the inversion of receptances."""

    few_dofs: int = 60
    """Number of DOFs up to which matrices are eliminated symbolically, however full they are."""
    many_dofs: int = 1500
    """Number of DOFs above which matrices are never eliminated symbolically."""
    chain_entries: int = 16
    """Mean number of entries in a row up to which matrices of a size between the two are eliminated symbolically."""
    asymmetry: float = 1e-8
    """Difference of two mirrored entries, over the matrix's largest entry, that may be due to rounding."""
    condition: float = 1e10
    """Condition number of a balanced receptance above which its inverse consists of rounding errors."""
    eliminated_lines: int = 2000
    """Largest number of lines that are eliminated at once: with more, the entries of a matrix leave the cache. From 250
    to 20,000, it takes least time for 12 parts of 4 random structures and the collet on 5,697 to 50,000 lines."""


SETTINGS = Settings()


@dataclass(frozen=True, eq=False)
class BoundaryStiffness:
    """Dynamic stiffness of a substructure at its boundary DOFs, stored sparsely: a chain fills a third of it or less.

    Parameters
    ----------
    numbers : (n,) int array
        Numbers of the boundary DOFs.
    entry : (n, n) int array
        Row of each entry in `values`, two entries may share one; -1 for an entry that is 0 at every frequency.
    values : (n_rows, n_freq) complex array
        The other entries.
    """

    numbers: NDArray[np.intp]
    entry: NDArray[np.intp]
    values: NDArray[np.complex128]

    @staticmethod
    def from_dense(Z: NDArray[np.complex128]) -> BoundaryStiffness:
        """Store the entries of Z (n_freq, n, n) that are not 0 at every frequency, numbered from 0."""
        filled = (Z != 0).any(axis=0)
        entry = np.where(filled, np.cumsum(filled).reshape(filled.shape) - 1, -1)
        return BoundaryStiffness(np.arange(len(entry)), entry, np.ascontiguousarray(Z[:, filled].T))

    def moved_by(self, motion: NDArray[np.float64]) -> BoundaryStiffness:
        """Return the stiffness of other coordinates (m,), by which the boundary moves as `motion` (n, m)."""
        Z = motion.T @ self.dense(slice(None)) @ motion
        return BoundaryStiffness.from_dense((Z + np.swapaxes(Z, 1, 2)) / 2.0)

    def numbered(self, numbers: NDArray[np.intp]) -> BoundaryStiffness:
        """Return the same boundary with global numbers (n,), without the DOFs that are held: those below 0."""
        moving = np.flatnonzero(numbers >= 0)
        return BoundaryStiffness(numbers[moving], self.entry[np.ix_(moving, moving)], self.values)

    def at(self, lines: NDArray[np.intp]) -> BoundaryStiffness:
        """Return the stiffness at some of the frequencies."""
        return BoundaryStiffness(self.numbers, self.entry, np.take(self.values, lines, axis=1))

    def dense(self, lines: NDArray[np.intp] | slice) -> NDArray[np.complex128]:
        """Return Z (n_lines, n, n) at some of the frequencies."""
        values = np.pad(self.values[:, lines], ((0, 1), (0, 0)))  # the last row is that of the entries that are 0
        return np.moveaxis(values[self.entry], -1, 0)


def boundary_stiffness(
    substructure: SubstructureModel, dofs: Sequence[int], frequency: NDArray[np.float64], draw: int | None = None
) -> BoundaryStiffness:
    """Condense a substructure to some of its DOFs.

    Parameters
    ----------
    substructure : SubstructureModel
    dofs : sequence of int
        The n boundary DOFs to keep.
    frequency : (n_freq,) array
        Hz.
    draw : int, optional
        Number of a random disturbance of dense matrices by their rounding errors.

    Returns
    -------
    BoundaryStiffness
        Z_bb - Z_bi Z_ii^-1 Z_ib, the Schur complement of the inner DOFs, numbered as in `dofs`. Without matrices it is
        the inverse of the receptance, which loses about six digits near the rigid-body modes.

    Raises
    ------
    DovetailError
        The matrices are invalid, or the receptance cannot be inverted.

    Notes
    -----
    Small matrices and chains of elements are eliminated symbolically, for all frequencies at once. Others are
    factorised at every frequency or, if the substructure has a tolerance, projected on a reduced basis.
    """
    matrices = substructure_matrices(substructure)
    if matrices is None:
        return BoundaryStiffness.from_dense(inverted_receptance(substructure, dofs, frequency))
    if draw is not None and isinstance(matrices, StructuralMatrices):
        matrices = _disturbed(matrices, draw)
    if isinstance(matrices, StructuralMatrices) and _is_fast_to_eliminate(matrices):
        return _condense_symbolically(matrices, dofs, frequency)
    if isinstance(matrices, StructuralMatrices):
        matrices = SparseMatrices(matrices.M, matrices.K, matrices.C, matrices.D)
    partitioned = PartitionedMatrices(matrices, dofs)
    tolerance = substructure.condensation_tolerance
    if not isinstance(tolerance, Real):
        where = f"substructure model '{substructure.name}'"
        raise PluginError(Fault(where, f"its condensation_tolerance is {tolerance!r:.60}.", "a number, 0 or more"))
    if tolerance > 0:
        return BoundaryStiffness.from_dense(condense_on_basis(partitioned, frequency, float(tolerance)).stiffness)
    return BoundaryStiffness.from_dense(partitioned.condense(frequency))


def _disturbed(matrices: StructuralMatrices, draw: int) -> StructuralMatrices:
    """Change each entry by at most one unit of its last digit; equal entries, as of equal elements, change equally.

    Each draw, a whole number, gives other changes.
    """
    changed = []
    for matrix in (matrices.M, matrices.K):
        part, _ = np.modf(1e6 * (draw + 1.0) * np.abs(np.frexp(matrix)[0]))
        changed.append(matrix * (1.0 + np.finfo(np.float64).eps * (2.0 * part - 1.0)))
    return StructuralMatrices(changed[0], changed[1], matrices.C, matrices.D)


def _is_fast_to_eliminate(matrices: StructuralMatrices) -> bool:
    if matrices.size <= SETTINGS.few_dofs or matrices.size > SETTINGS.many_dofs:
        return matrices.size <= SETTINGS.few_dofs
    return int(np.count_nonzero(matrices.K)) <= SETTINGS.chain_entries * matrices.size


def _condense_symbolically(
    matrices: StructuralMatrices, dofs: Sequence[int], frequency: NDArray[np.float64]
) -> BoundaryStiffness:
    filled = (matrices.M != 0) | (matrices.K != 0) | (matrices.C != 0) | (matrices.D != 0)
    active = np.union1d(np.flatnonzero(filled.any(axis=0)), dofs)
    kept = np.searchsorted(active, dofs).tolist()
    program = plan_elimination(filled[np.ix_(active, active)], kept)
    rows, columns = active[program.rows], active[program.columns]
    M, K, C, D = (matrix[rows, columns, None] for matrix in (matrices.M, matrices.K, matrices.C, matrices.D))
    position = np.full(matrices.size, -1)
    position[list(dofs)] = np.arange(len(dofs))
    among_kept = (position[rows] >= 0) & (position[columns] >= 0)
    blocks = []
    for part in np.array_split(frequency, -(-len(frequency) // SETTINGS.eliminated_lines)):
        omega = 2.0 * np.pi * part
        slots = np.empty((len(rows), len(part)), dtype=np.complex128)
        slots.real, slots.imag = K - omega**2 * M, D + omega * C
        with np.errstate(divide="ignore", invalid="ignore"):  # a pivot that vanishes leaves no finite number
            run_elimination(program, slots)
        blocks.append(slots[among_kept])
    values = np.concatenate(blocks, axis=1)
    filled_entries = values.any(axis=1)
    rows, columns = position[rows[among_kept]][filled_entries], position[columns[among_kept]][filled_entries]
    values = values if filled_entries.all() else values[filled_entries]
    lost = ~np.isfinite(values).all(axis=0)
    if lost.any():
        sparse = SparseMatrices(matrices.M, matrices.K, matrices.C, matrices.D)
        values[:, lost] = PartitionedMatrices(sparse, dofs).condense(frequency[lost])[:, rows, columns].T
    entry = np.full((len(dofs), len(dofs)), -1)
    entry[rows, columns] = entry[columns, rows] = np.arange(len(values))
    return BoundaryStiffness(np.arange(len(dofs)), entry, values)


def substructure_matrices(substructure: SubstructureModel) -> StructuralMatrices | SparseMatrices | None:
    """Return the matrices of a substructure, or None for one that is known by its FRFs only.

    Raises
    ------
    PluginError
        They are too small for the substructure's nodes, not finite, not symmetric, or not matrices.
    """
    with refusing_complex_values():
        matrices = substructure.matrices()
    if matrices is None:
        return None
    where = f"substructure model '{substructure.name}'"
    if not isinstance(matrices, (StructuralMatrices, SparseMatrices)):
        raise PluginError(Fault(where, f"it returns {type(matrices).__name__}.", "StructuralMatrices, SparseMatrices"))
    least = NodeDofs.from_nodes(substructure.nodes).size
    if matrices.K.ndim != 2 or matrices.size < least:
        problem = (
            f"its matrices have the shape {matrices.K.shape}, but its {len(substructure.nodes)} nodes need {least}"
        )
        raise PluginError(Fault(where, f"{problem} DOFs."))
    for name in ("M", "K", "C", "D"):
        if problem := _problem(name, getattr(matrices, name)):
            raise PluginError(Fault(where, problem))
    return matrices


def _problem(name: str, matrix: Any) -> str:
    values = matrix if isinstance(matrix, np.ndarray) else matrix.data
    if not np.isfinite(values).all():
        return f"its matrix {name} has values that are not finite."
    if values.size and abs(matrix - matrix.T).max() > SETTINGS.asymmetry * abs(values).max():
        return f"its matrix {name} is not symmetric."
    return ""


def substructure_constraints(substructure: SubstructureModel) -> NDArray[np.float64]:
    """Return the linear functions (n, d) of a substructure's DOFs that are zero; (0, 0) if it declares none.

    Raises
    ------
    PluginError
        They are not finite numbers of this shape.
    """
    if type(substructure).constraints is SubstructureModel.constraints:
        return np.zeros((0, 0))
    with plugin_errors(substructure, f"substructure model '{substructure.name}'"):
        returned, count = substructure.constraints, substructure.node_dofs.size
        rows = returned if isinstance(returned, np.ndarray) else np.empty(0)
        if rows.dtype != np.float64 or rows.ndim != 2 or rows.shape[1] != count or not np.isfinite(rows).all():
            where = f"substructure model '{substructure.name}'"
            problem = f"its constraints are {returned!r:.60}."
            raise PluginError(Fault(where, problem, f"an array of numbers with {count} columns, one for each DOF"))
    return rows


def inverted_receptance(
    substructure: SubstructureModel, dofs: Sequence[int], frequency: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Invert the receptance of a substructure between some of its DOFs.

    Parameters
    ----------
    substructure : SubstructureModel
    dofs : sequence of int
        n DOFs.
    frequency : (n_freq,) array
        Hz.

    Returns
    -------
    (n_freq, n, n) complex array
        Zero at the substructure's `absent_dofs`.

    Raises
    ------
    PluginError
        The model does not return finite numbers of this shape.
    DovetailError
        The receptance is singular at a frequency, or so badly conditioned that its inverse consists of rounding errors.
    """
    absent = substructure.absent_dofs
    if not isinstance(absent, (Set, Sequence)) or isinstance(absent, str):
        where = f"substructure model '{substructure.name}'"
        raise PluginError(Fault(where, f"its absent_dofs are {absent!r:.60}.", "a frozenset of DOFs"))
    present = [index for index, dof in enumerate(dofs) if dof not in absent]
    stiffness = np.zeros((len(frequency), len(dofs), len(dofs)), dtype=np.complex128)
    if present:
        inverse = _invert(substructure, [int(dofs[index]) for index in present], frequency)
        stiffness[:, np.array(present)[:, None], present] = inverse
    return stiffness


def _invert(
    substructure: SubstructureModel, dofs: Sequence[int], frequency: NDArray[np.float64]
) -> NDArray[np.complex128]:
    where = f"substructure model '{substructure.name}'"
    returned = substructure.receptance(frequency, dofs)
    try:
        receptance = np.asarray(returned, dtype=np.complex128)
    except (TypeError, ValueError):
        raise PluginError(
            Fault(where, f"it returns {returned!r:.60} for its receptance.", "an array of numbers")
        ) from None
    expected = (len(frequency), len(dofs), len(dofs))
    if receptance.shape != expected:
        raise PluginError(Fault(where, f"it returns a receptance of the shape {receptance.shape}, not {expected}."))
    if not np.isfinite(receptance).all():
        raise PluginError(Fault(where, "it returns a receptance that is not finite."))
    scale = np.sqrt(np.abs(np.diagonal(receptance, axis1=1, axis2=2)))
    still = np.argwhere(scale == 0)
    if len(still):
        line, dof = still[0]
        label = substructure.dof_label(int(dofs[dof]))
        problem = f"its receptance at {label} is zero at {frequency[line]:g} Hz, as if it were fixed."
        raise DovetailError(Fault(where, problem, remedy="Replace this DOF by a joint to 'ground'."))
    balanced = receptance / (scale[:, :, None] * scale[:, None, :])
    condition = np.linalg.cond(balanced)
    worst = int(np.argmax(condition))
    if not condition[worst] < SETTINGS.condition:
        labels = ", ".join(substructure.dof_label(int(dof)) for dof in dofs)
        problem = f"its receptance between {labels} cannot be inverted at {frequency[worst]:g} Hz: "
        problem += f"rows depend on each other (condition {condition[worst]:.1e}, balanced)."
        remedy = "Displacement and rotation must come from independent measurements; check their positions."
        raise DovetailError(Fault(where, problem, f"a condition below {SETTINGS.condition:.0e}", remedy))
    inverse: NDArray[np.complex128] = np.linalg.inv(balanced) / (scale[:, :, None] * scale[:, None, :])
    return inverse
