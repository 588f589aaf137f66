"""The entries of joints at each slot of the elimination, as columns of the kernel's arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import NDArray

from dovetail.interfaces import Superposition, plugin_errors
from dovetail.interfaces.superposition import NAMES
from dovetail.synthesis.codegen.layout import MATRICES, Derivative, Term
from dovetail.synthesis.coupled_system import JointStructure, PlacedJoint
from dovetail.synthesis.joint_evaluation import (
    JointSparsity,
    MatrixRows,
    Sparsity,
    Theta,
    UnplannedEntries,
    depends_on_frequency,
    joint_jacobian,
    joint_matrices,
    superposition,
)

_Set = tuple[tuple[int, ...], int, NDArray[np.bool_]]
"""First part of the keys of a set of matrices, before slot and matrix; its index, and its entries (4, d, d)."""
_BLOCK_BYTES = 16e6
"""Memory of the functions that are evaluated at a time."""


@dataclass(frozen=True, eq=False)
class MatrixColumns:
    """Entries of a joint's matrices and the columns to which they belong.

    Parameters
    ----------
    matrices, entries : arrays of int
        As `MatrixRows.at` takes them.
    columns : array of int
    factors : array
        By which each entry is multiplied.
    repeated : bool
        Whether a column occurs more than once, because local DOFs are merged.
    """

    matrices: NDArray[np.intp]
    entries: NDArray[np.intp]
    columns: NDArray[np.intp]
    factors: NDArray[np.float64]
    repeated: bool

    def add(self, total: NDArray[np.float64], rows: MatrixRows) -> None:
        """Add the entries to sums (n_columns, n)."""
        values = rows.at(self.matrices, self.entries) * self.factors[:, np.newaxis]
        if self.repeated:
            np.add.at(total, self.columns, values)
        else:
            total[self.columns] += values


class SuperposedJoints:
    """Entries of joints whose matrices are superpositions, or of their derivatives, as products.

    Parameters
    ----------
    placed : mapping of str to PlacedJoint
    joints : mapping of str to Superposition
    columns : mapping of str to MatrixColumns
        Of each of these joints: where its entries belong in the kernel's array.
    count : int
        Number of columns of this array.
    differentiated : mapping of str to list of int, optional
        Columns of each joint's theta by which to differentiate, for an array of derivatives.
    """

    def __init__(
        self,
        placed: Mapping[str, PlacedJoint],
        joints: Mapping[str, Superposition],
        columns: Mapping[str, MatrixColumns],
        count: int,
        differentiated: Mapping[str, Sequence[int]] | None = None,
    ) -> None:
        self._placed, self._joints, self._count = placed, joints, count
        self._slopes = differentiated is not None
        self._pairs = {name: self._pairs_of(joint, differentiated, name) for name, joint in joints.items()}
        blocks = [self._coefficients(name, columns[name]) for name in joints]
        total = scipy.sparse.csr_array((count, 0))
        self._constant = np.zeros((count, 1))
        for joint, block in zip(joints.values(), blocks, strict=True):
            varying = block.shape[1] - (len(joint.linear) if self._slopes else 0)
            self._constant += block[:, varying:].sum(axis=1).reshape(-1, 1)
            total = scipy.sparse.hstack([total, block[:, :varying]])
        self._entries = scipy.sparse.csr_array(total)
        self._entries.sort_indices()
        self._unplanned = {name: self._unplanned_pairs(name) for name in joints}

    @staticmethod
    def _pairs_of(
        joint: Superposition, differentiated: Mapping[str, Sequence[int]] | None, name: str
    ) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return function and set of matrices of each row of the product: set 0, or a derivative; -1 for no set."""
        if differentiated is None:
            functions = np.arange(joint.entries.shape[1])
            return functions, np.zeros_like(functions)
        functions, parameters = joint.pairs
        return functions, np.where(np.isin(parameters, differentiated[name]), parameters, -1)

    def _coefficients(self, name: str, columns: MatrixColumns) -> scipy.sparse.csr_array:
        """Return the factors (n_columns, n_pairs) of a joint's functions or slopes in the kernel's columns."""
        joint, (functions, sets) = self._joints[name], self._pairs[name]
        pair_of = np.full((int(sets.max(initial=0)) + 1, joint.entries.shape[1]), -1)
        pair_of[sets[sets >= 0], functions[sets >= 0]] = np.flatnonzero(sets >= 0)
        number, place = np.divmod(columns.matrices, len(MATRICES))
        place = np.array([NAMES.index(name) for name in MATRICES])[place]
        chosen = scipy.sparse.coo_array(joint.entries[place * joint.size**2 + columns.entries])
        pair = pair_of[number[chosen.row], chosen.col]
        acts = pair >= 0
        at = columns.columns[chosen.row[acts]], pair[acts]
        values = columns.factors[chosen.row[acts]] * chosen.data[acts]
        return scipy.sparse.csr_array(scipy.sparse.coo_array((values, at), shape=(self._count, len(functions))))

    def _unplanned_pairs(self, name: str) -> NDArray[np.intp]:
        """Return the pairs of a joint with entries that are not planned for."""
        functions, sets = self._pairs[name]
        planned = self._placed[name].sparsity
        filled = planned.derivatives if self._slopes else planned.matrices[np.newaxis]
        return np.array(
            [
                pair
                for pair, (function, number) in enumerate(zip(functions, sets, strict=True))
                if number >= 0 and (self._joints[name].filled([function], MATRICES) & ~filled[number]).any()
            ],
            dtype=np.intp,
        )

    def gather(self, theta: Theta, count: int) -> NDArray[np.float64]:
        """Return the sums over these joints (n_columns, n).

        Raises
        ------
        UnplannedEntries
            Entries for which the system is not planned are filled.
        """
        total = np.empty((self._count, count))
        size = max(1, int(_BLOCK_BYTES / (8 * max(1, self._entries.shape[1]))))
        for first in range(0, count, size):
            block = slice(first, min(first + size, count))
            values = [self._values(name, vectors[block]) for name, vectors in theta.items() if name in self._joints]
            total[:, block] = self._constant
            if self._entries.shape[1]:
                total[:, block] += self._entries @ np.concatenate(values)
        return total

    def _values(self, name: str, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the functions of a joint, or the slopes that are not constant, checked."""
        joint, model = self._joints[name], self._placed[name].model
        with plugin_errors(model, f"{model.kind} '{name}' ({model.name})"):
            values = joint.slopes(theta) if self._slopes else joint.functions(theta)
        if len(self._unplanned[name]):
            acts = np.ones(len(self._pairs[name][0]), dtype=np.bool_)
            acts[: len(values)] = values.any(axis=1)
            self._require(name, self._unplanned[name][acts[self._unplanned[name]]])
        return values

    def _require(self, name: str, pairs: NDArray[np.intp]) -> None:
        """Raise `UnplannedEntries` if there are some pairs of a joint for whose entries the system is not planned."""
        if not len(pairs):
            return
        planned, joint = self._placed[name].sparsity, self._joints[name]
        matrices, derivatives = planned.matrices.copy(), planned.derivatives.copy()
        for pair in pairs:
            function, number = (int(array[pair]) for array in self._pairs[name])
            entries = derivatives[number] if self._slopes else matrices
            entries |= joint.filled([function], MATRICES)
        raise UnplannedEntries({name: JointSparsity(matrices, derivatives)})


@lru_cache(maxsize=16)
def kernel_inputs(structure: JointStructure) -> KernelInputs:
    """Return the inputs from a system's joints; those of the same joints on other lines or with other parts again."""
    return KernelInputs(structure)


class KernelInputs:
    """The kernel's inputs from joints with constant matrices.

    Parameters
    ----------
    structure : JointStructure
    """

    def __init__(self, structure: JointStructure) -> None:
        self._program, self._jacobian_columns = structure.program, structure.jacobian_columns
        self._placed = {joint.name: joint for joint in structure.joints}

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """Slot and matrix of each column of the joints."""
        terms = {
            (slot, matrix)
            for name in self._names
            for matrix, filled in zip(MATRICES, self._placed[name].sparsity.matrices, strict=True)
            for _, slot in self.local_slots(name, filled)
        }
        return tuple(sorted(terms))

    @cached_property
    def derivatives(self) -> tuple[Derivative, ...]:
        """Parameter, slot and matrix of each column of the derivatives."""
        derivatives = {
            (parameter, slot, matrix)
            for parameter, name, column in self._differentiated
            for matrix, filled in zip(MATRICES, self._placed[name].sparsity.derivatives[column], strict=True)
            for _, slot in self.local_slots(name, filled)
        }
        return tuple(sorted(derivatives))

    @cached_property
    def parameter_of_derivatives(self) -> NDArray[np.intp]:
        """(n_derivatives,) the parameter of each column of the derivatives."""
        return np.array([parameter for parameter, _, _ in self.derivatives], dtype=np.intp)

    @property
    def parameters(self) -> int:
        """Number of parameters by which to differentiate."""
        return sum(len(columns) for columns in self._jacobian_columns.values())

    @cached_property
    def _names(self) -> list[str]:
        """The joints with constant matrices."""
        return [name for name, joint in self._placed.items() if not depends_on_frequency(joint.model)]

    @cached_property
    def _differentiated(self) -> list[tuple[int, str, int]]:
        """Index of each parameter of these joints, its joint, and its column in the joint's theta."""
        every = [(name, column) for name, columns in self._jacobian_columns.items() for column in columns]
        return [(number, name, column) for number, (name, column) in enumerate(every) if name in self._names]

    def local_slots(self, name: str, filled: NDArray[np.bool_]) -> list[tuple[tuple[int, int], int]]:
        """Return local row and column, and slot, of a joint's filled entries."""
        local = self._placed[name].local
        entries = self._program.entries(self._placed[name].indices, filled[np.ix_(local, local)])
        return [((int(local[row]), int(local[column])), slot) for row, column, slot in entries]

    def _columns(
        self, name: str, sets: Sequence[_Set], keys: Sequence[tuple[int | str, ...]], factors: NDArray[np.float64]
    ) -> MatrixColumns:
        """Return the columns to which entries of a joint's sets of matrices belong, given the keys of all columns.

        A key is (*before, slot, matrix); there is a factor for each slot.
        """
        column_of = {key: column for column, key in enumerate(keys)}
        chosen = [
            (len(MATRICES) * number + place, len(filled[place]) * row + column, column_of[*before, slot, matrix], slot)
            for before, number, filled in sets
            for place, matrix in enumerate(MATRICES)
            for (row, column), slot in self.local_slots(name, filled[place])
        ]
        matrices, entries, columns, slots = np.array(chosen, dtype=np.intp).reshape(-1, 4).T
        return MatrixColumns(matrices, entries, columns, factors[slots], len(set(columns.tolist())) < len(columns))

    @cached_property
    def _term_columns(self) -> dict[str, MatrixColumns]:
        """Columns to which the entries of each joint's matrices belong."""
        ones, sets = (
            np.ones(self._program.slots),
            {n: [((), 0, self._placed[n].sparsity.matrices)] for n in self._names},
        )
        return {name: self._columns(name, joint, self.terms, ones) for name, joint in sets.items()}

    @cached_property
    def _weight_columns(self) -> dict[str, MatrixColumns]:
        """Columns of the entries of its derivatives, with the factors of -x^T dZ x, summed over the lower triangle."""
        factors = np.where(self._program.rows != self._program.columns, -2.0, -1.0)
        sets: dict[str, list[_Set]] = {}
        for parameter, name, column in self._differentiated:
            filled = self._placed[name].sparsity.derivatives[column]
            sets.setdefault(name, []).append(((parameter,), column, filled))
        return {name: self._columns(name, joint, self.derivatives, factors) for name, joint in sets.items()}

    @cached_property
    def _superpositions(self) -> dict[str, Superposition]:
        """The joints whose matrices are superpositions of constant ones."""
        every = {name: superposition(name, self._placed[name].model) for name in self._names}
        return {name: superposed for name, superposed in every.items() if superposed is not None}

    @cached_property
    def _superposed(self) -> SuperposedJoints:
        return SuperposedJoints(self._placed, self._superpositions, self._term_columns, len(self.terms))

    @cached_property
    def _superposed_weights(self) -> SuperposedJoints:
        joints = {name: joint for name, joint in self._superpositions.items() if name in self._weight_columns}
        columns = self._weight_columns
        return SuperposedJoints(self._placed, joints, columns, len(self.derivatives), self._jacobian_columns)

    def gather(self, theta: Theta, count: int) -> NDArray[np.float64]:
        """Return the sum over the joints for each term, (n, n_terms).

        Raises
        ------
        UnplannedEntries
            A joint fills entries of a matrix that have no term.
        """
        total, columns = self._superposed.gather(theta, count), self._term_columns
        dense = {name: self._placed[name] for name in columns if name not in self._superpositions}
        matrices = {name: joint_matrices(name, joint.model, theta[name]) for name, joint in dense.items()}
        sparsity = {name: joint.sparsity for name, joint in dense.items()}
        require(sparsity, {name: sparsity[name].with_matrices(rows.filled[0]) for name, rows in matrices.items()})
        for name, rows in matrices.items():
            columns[name].add(total, rows)
        return np.ascontiguousarray(total.T)

    def gather_weights(self, theta: Theta, count: int) -> NDArray[np.float64]:
        """Return the derivatives of the terms by the parameters, (n, n_derivatives), signed for -x^T dZ x.

        Raises
        ------
        UnplannedEntries
            A joint fills entries of a derivative that have no column.
        """
        total, weight_columns = self._superposed_weights.gather(theta, count), self._weight_columns
        dense = {name: self._placed[name] for name in weight_columns if name not in self._superpositions}
        jacobians = {name: joint_jacobian(name, joint.model, theta[name]) for name, joint in dense.items()}
        sparsity, filled = {name: joint.sparsity for name, joint in dense.items()}, {}
        for name, rows in jacobians.items():
            columns = self._jacobian_columns[name]
            filled[name] = sparsity[name].with_derivatives(columns, rows.filled[columns])
        require(sparsity, filled)
        for name, rows in jacobians.items():
            weight_columns[name].add(total, rows)
        return np.ascontiguousarray(total.T)


def require(planned: Sparsity, filled: Sparsity) -> None:
    """Raise `UnplannedEntries` unless a system is planned for the entries that joints fill."""
    unplanned = {name: sparsity for name, sparsity in filled.items() if not planned[name].covers(sparsity)}
    if unplanned:
        raise UnplannedEntries(unplanned)
