"""The entries of substructures and joints at each slot of the elimination, as columns of the kernel's arrays."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import JointModel
from dovetail.synthesis.codegen.layout import MATRICES, Derivative, SpectralDerivative, Term
from dovetail.synthesis.coupled_system import CoupledSystem
from dovetail.synthesis.elimination import Program
from dovetail.synthesis.joint_evaluation import (
    JointSparsity,
    MatrixRows,
    Theta,
    UnplannedEntries,
    depends_on_frequency,
    filled_entries,
    joint_jacobian,
    joint_matrices,
    joint_stiffness,
    joint_stiffness_jacobian,
)

_Set = tuple[tuple[int, ...], int, NDArray[np.bool_]]
"""First part of the keys of a set of matrices, before slot and matrix; its index, and its entries (4, d, d)."""


@dataclass(frozen=True, eq=False)
class _Columns:
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


class KernelInputs:
    """The kernel's inputs from substructures and from joints with constant matrices.

    Parameters
    ----------
    system : CoupledSystem
    program : Program
        Over the system's active DOFs.
    jacobian_columns : mapping of str to list of int
        Columns of each joint's theta by which to differentiate.
    """

    def __init__(self, system: CoupledSystem, program: Program, jacobian_columns: Mapping[str, list[int]]) -> None:
        self._system = system
        self._program = program
        self._jacobian_columns = jacobian_columns
        self._slot_of = np.full((len(system.active),) * 2, -1, dtype=np.intp)
        for slot, (row, column) in enumerate(zip(program.rows, program.columns, strict=True)):
            self._slot_of[row, column] = self._slot_of[column, row] = slot

    def static(self) -> tuple[tuple[tuple[int, int], ...], NDArray[np.float64]]:
        """Return slot and part (0 real, 1 imaginary) of the substructures' non-zero rows; the rows (n_rows, n_freq)."""
        halves = np.zeros((self._program.slots, 2, len(self._system.frequency)))
        for boundary in self._system.condensed.values():
            local, indices = self._system.locate(boundary.numbers)
            entry = boundary.entry[np.ix_(local, local)]
            for row, column, slot in self._entries(indices, entry >= 0):
                halves[slot] += boundary.values[entry[row, column]].view(np.float64).reshape(-1, 2).T
        keys = tuple((int(slot), int(half)) for slot, half in np.argwhere(halves.any(axis=-1)))
        return keys, np.array([halves[key] for key in keys]).reshape(len(keys), len(self._system.frequency))

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """Slot and matrix of each column of the joints."""
        terms = {
            (slot, matrix)
            for name in self._names
            for matrix, filled in zip(MATRICES, self._system.sparsity[name].matrices, strict=True)
            for _, slot in self.local_slots(name, filled)
        }
        return tuple(sorted(terms))

    @cached_property
    def derivatives(self) -> tuple[Derivative, ...]:
        """Parameter, slot and matrix of each column of the derivatives."""
        derivatives = {
            (parameter, slot, matrix)
            for parameter, name, column in self._differentiated
            for matrix, filled in zip(MATRICES, self._system.sparsity[name].derivatives[column], strict=True)
            for _, slot in self.local_slots(name, filled)
        }
        return tuple(sorted(derivatives))

    @property
    def parameters(self) -> int:
        """Number of parameters by which to differentiate."""
        return sum(len(columns) for columns in self._jacobian_columns.values())

    @cached_property
    def _names(self) -> list[str]:
        """The joints with constant matrices."""
        connections = self._system.graph.connections
        return [name for name, connection in connections.items() if not depends_on_frequency(connection.model)]

    @cached_property
    def _differentiated(self) -> list[tuple[int, str, int]]:
        """Index of each parameter of these joints, its joint, and its column in the joint's theta."""
        every = [(name, column) for name, columns in self._jacobian_columns.items() for column in columns]
        return [(number, name, column) for number, (name, column) in enumerate(every) if name in self._names]

    def _entries(self, indices: NDArray[np.intp], filled: NDArray[np.bool_]) -> list[tuple[int, int, int]]:
        """Return (row, column, slot) of the lower triangle, and of both halves if two local DOFs are merged."""
        entries = []
        for row, column in zip(*np.nonzero(filled), strict=True):
            slot = int(self._slot_of[indices[row], indices[column]])
            if slot >= 0 and (column <= row or indices[row] == indices[column]):
                entries.append((int(row), int(column), slot))
        return entries

    def local_slots(self, name: str, filled: NDArray[np.bool_]) -> list[tuple[tuple[int, int], int]]:
        """Return local row and column, and slot, of a joint's filled entries."""
        local, indices = self._system.locate(self._system.graph.joint_dofs(name))
        entries = self._entries(indices, filled[np.ix_(local, local)])
        return [((int(local[row]), int(local[column])), slot) for row, column, slot in entries]

    def _columns(
        self, name: str, sets: Sequence[_Set], keys: Sequence[tuple[int | str, ...]], factors: NDArray[np.float64]
    ) -> _Columns:
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
        return _Columns(matrices, entries, columns, factors[slots], len(set(columns.tolist())) < len(columns))

    @cached_property
    def _term_columns(self) -> dict[str, _Columns]:
        """Columns to which the entries of each joint's matrices belong."""
        sparsity, ones = self._system.sparsity, np.ones(self._program.slots)
        return {name: self._columns(name, [((), 0, sparsity[name].matrices)], self.terms, ones) for name in self._names}

    @cached_property
    def _weight_columns(self) -> dict[str, _Columns]:
        """Columns of the entries of its derivatives, with the factors of -x^T dZ x, summed over the lower triangle."""
        factors = np.where(self._program.rows != self._program.columns, -2.0, -1.0)
        sets: dict[str, list[_Set]] = {}
        for parameter, name, column in self._differentiated:
            filled = self._system.sparsity[name].derivatives[column]
            sets.setdefault(name, []).append(((parameter,), column, filled))
        return {name: self._columns(name, joint, self.derivatives, factors) for name, joint in sets.items()}

    def gather(self, theta: Theta, count: int) -> NDArray[np.float64]:
        """Return the sum over the joints for each term, (n, n_terms).

        Raises
        ------
        UnplannedEntries
            A joint fills entries of a matrix that have no term.
        """
        connections, sparsity = self._system.graph.connections, self._system.sparsity
        matrices = {name: joint_matrices(name, connections[name].model, theta[name]) for name in self._names}
        require(self._system, {name: sparsity[name].with_matrices(rows.filled[0]) for name, rows in matrices.items()})
        total = np.zeros((len(self.terms), count))
        for name, columns in self._term_columns.items():
            columns.add(total, matrices[name])
        return np.ascontiguousarray(total.T)

    def gather_weights(self, theta: Theta, count: int) -> NDArray[np.float64]:
        """Return the derivatives of the terms by the parameters, (n, n_derivatives), signed for -x^T dZ x.

        Raises
        ------
        UnplannedEntries
            A joint fills entries of a derivative that have no column.
        """
        connections, jacobians, filled = self._system.graph.connections, {}, {}
        for name in self._weight_columns:
            jacobians[name] = joint_jacobian(name, connections[name].model, theta[name])
            columns = self._jacobian_columns[name]
            filled[name] = self._system.sparsity[name].with_derivatives(columns, jacobians[name].filled[columns])
        require(self._system, filled)
        total = np.zeros((len(self.derivatives), count))
        for name, weight_columns in self._weight_columns.items():
            weight_columns.add(total, jacobians[name])
        return np.ascontiguousarray(total.T)


def require(system: CoupledSystem, filled: Mapping[str, JointSparsity]) -> None:
    """Raise `UnplannedEntries` unless the system is planned for the entries that joints fill."""
    unplanned = {name: sparsity for name, sparsity in filled.items() if not system.sparsity[name].covers(sparsity)}
    if unplanned:
        raise UnplannedEntries(unplanned)


class SpectralInputs:
    """The kernel's inputs from joints that depend on frequency and provide their dynamic stiffness.

    Parameters
    ----------
    system : CoupledSystem
    program : Program
        Over the system's active DOFs.
    jacobian_columns : mapping of str to list of int
        Columns of each joint's theta by which to differentiate.
    inputs : KernelInputs
        Of the same system and program.
    """

    def __init__(
        self, system: CoupledSystem, program: Program, jacobian_columns: Mapping[str, list[int]], inputs: KernelInputs
    ) -> None:
        self._system = system
        self._off_diagonal = program.rows != program.columns
        self._jacobian_columns = jacobian_columns
        self._entries = {
            name: inputs.local_slots(name, system.sparsity[name].filled)
            for name, connection in system.graph.connections.items()
            if depends_on_frequency(connection.model)
        }

    @property
    def joints(self) -> tuple[str, ...]:
        """The joints that depend on frequency."""
        return tuple(self._entries)

    @cached_property
    def slots(self) -> tuple[int, ...]:
        """Slots at which these joints have entries."""
        return tuple(sorted({slot for entries in self._entries.values() for _, slot in entries}))

    @cached_property
    def derivatives(self) -> tuple[SpectralDerivative, ...]:
        """Parameter and slot of each row of the derivatives."""
        derivatives = {
            (parameter, slot)
            for name, entries in self._entries.items()
            for parameter in self._parameter_numbers(name).values()
            for _, slot in entries
        }
        return tuple(sorted(derivatives))

    def bytes_per_sample(self, *, derivatives: bool) -> int:
        """Return an estimate of the memory that the evaluation of one sample takes."""
        largest = max((self._model(name).size ** 2 for name in self._entries), default=0)
        rows = len(self.slots) + (len(self.derivatives) if derivatives else 0)
        temporaries = 12 if derivatives else 3
        return 16 * len(self._system.frequency) * (rows + temporaries * largest)

    def gather(self, theta: Theta, count: int) -> NDArray[np.float64]:
        """Return the sum over these joints at each slot, (n, n_slots, 2, n_freq).

        Raises
        ------
        UnplannedEntries
            A joint fills entries of its dynamic stiffness for which there is no slot.
        """
        frequency = self._system.frequency
        total = np.zeros((count, len(self.slots), 2, len(frequency)))
        row_of = {slot: row for row, slot in enumerate(self.slots)}
        for name, entries in self._entries.items():
            Z = joint_stiffness(name, self._model(name), frequency, theta[name])
            require(self._system, {name: self._system.sparsity[name].with_matrices(filled_entries(Z)[np.newaxis])})
            for (row, column), slot in entries:
                total[:, row_of[slot], 0] += Z[..., row, column].real
                total[:, row_of[slot], 1] += Z[..., row, column].imag
        return total

    def gather_weights(self, theta: Theta, count: int) -> NDArray[np.float64]:
        """Return the derivatives by the parameters, (n, n_derivatives, 2, n_freq), signed for -x^T dZ x.

        Raises
        ------
        UnplannedEntries
            A joint fills entries of a derivative for which there is no slot.
        """
        total = np.zeros((count, len(self.derivatives), 2, len(self._system.frequency)))
        row_of = {key: row for row, key in enumerate(self.derivatives)}
        for name, parameter, dZ in self._stiffness_derivatives(theta):
            for (row, column), slot in self._entries[name]:
                weight = -2.0 if self._off_diagonal[slot] else -1.0
                total[:, row_of[parameter, slot], 0] += weight * dZ[..., row, column].real
                total[:, row_of[parameter, slot], 1] += weight * dZ[..., row, column].imag
        return total

    def _stiffness_derivatives(self, theta: Theta) -> Iterator[tuple[str, int, NDArray[np.complex128]]]:
        """Yield joint, parameter index and derivative, one derivative at a time to save memory."""
        for name in self._entries:
            if numbers := self._parameter_numbers(name):
                derivatives = joint_stiffness_jacobian(name, self._model(name), self._system.frequency, theta[name])
                for column, dZ in enumerate(derivatives):
                    if column in numbers:
                        filled = filled_entries(dZ)[np.newaxis, np.newaxis]
                        require(self._system, {name: self._system.sparsity[name].with_derivatives([column], filled)})
                        yield name, numbers[column], dZ

    def _parameter_numbers(self, name: str) -> dict[int, int]:
        """Return the index among all parameters for each column of a joint by which to differentiate."""
        before = 0
        for joint, columns in self._jacobian_columns.items():
            if joint == name:
                return {column: before + index for index, column in enumerate(columns)}
            before += len(columns)
        return {}

    def _model(self, name: str) -> JointModel:
        return self._system.graph.connections[name].model
