"""The entries of substructures and joints at each slot of the elimination, as columns of the kernel's arrays."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.interfaces import JointModel, StructuralMatrices
from dovetail.synthesis.codegen.layout import MATRICES, Derivative, SpectralDerivative, Term
from dovetail.synthesis.coupled_system import CoupledSystem
from dovetail.synthesis.elimination import Program
from dovetail.synthesis.joint_evaluation import (
    Theta,
    depends_on_frequency,
    filled_entries,
    joint_jacobian,
    joint_matrices,
    joint_stiffness,
    joint_stiffness_jacobian,
)

__all__ = ["KernelInputs", "SpectralInputs"]


@dataclass(frozen=True, eq=False)
class _Columns:
    """The entries of a joint's matrix and the columns to which they belong.

    Parameters
    ----------
    entries : array of (int, int)
        Local rows and columns, (n_entries, 2).
    columns : array of int
    repeated : bool
        Whether a column occurs twice, where local DOFs are merged.
    """

    entries: NDArray[np.intp]
    columns: NDArray[np.intp]
    repeated: bool

    def add(self, total: NDArray[np.float64], matrices: NDArray[np.float64], weights: NDArray[np.float64]) -> None:
        values = matrices[:, self.entries[:, 0], self.entries[:, 1]] * weights
        if self.repeated:
            np.add.at(total.T, self.columns, values.T)
        else:
            total[:, self.columns] += values


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

    @cached_property
    def static(self) -> tuple[tuple[tuple[int, int], ...], NDArray[np.float64]]:
        """Non-zero rows of the substructures: slot and part (0 real, 1 imaginary), and values (n_rows, n_freq)."""
        Z_slots = np.zeros((self._program.slots, len(self._system.frequency)), dtype=np.complex128)
        for numbers, Z in self._system.condensed.values():
            local, indices = self._system.locate(numbers)
            for row, column, slot in self._entries(indices, np.ones((len(indices),) * 2, dtype=bool)):
                Z_slots[slot] += Z[:, local[row], local[column]]
        halves = np.stack([Z_slots.real, Z_slots.imag], axis=1)
        keys = tuple((int(slot), int(half)) for slot, half in np.argwhere(halves.any(axis=-1)))
        return keys, np.array([halves[key] for key in keys]).reshape(len(keys), -1)

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """Slot and matrix of each column of the joints."""
        terms = {
            (slot, matrix)
            for name, filled in self._filled.items()
            for matrix in MATRICES
            for _, slot in self.local_slots(name, filled[matrix])
        }
        return tuple(sorted(terms))

    @cached_property
    def derivatives(self) -> tuple[Derivative, ...]:
        """Parameter, slot and matrix of each column of the derivatives."""
        derivatives = {
            (parameter, slot, matrix)
            for parameter, name, filled in self._filled_derivatives
            for matrix in MATRICES
            for _, slot in self.local_slots(name, filled[matrix])
        }
        return tuple(sorted(derivatives))

    @property
    def parameters(self) -> int:
        """Number of parameters by which to differentiate."""
        return sum(len(columns) for columns in self._jacobian_columns.values())

    @cached_property
    def _filled(self) -> dict[str, dict[str, NDArray[np.bool_]]]:
        """Entries of each matrix of each joint that any vector of the system's `probe_theta` fills."""
        return {
            name: _filled_by_matrix(joint_matrices(name, connection.model, self._system.probe_theta[name]))
            for name, connection in self._system.graph.connections.items()
            if not depends_on_frequency(connection.model)
        }

    @cached_property
    def _filled_derivatives(self) -> list[tuple[int, str, dict[str, NDArray[np.bool_]]]]:
        """The same for the derivative by each parameter: its number, its joint, and the entries of each matrix."""
        filled, parameter = [], 0
        for name, columns in self._jacobian_columns.items():
            model = self._system.graph.connections[name].model
            if columns and not depends_on_frequency(model):
                jacobian = joint_jacobian(name, model, self._system.probe_theta[name])
                filled += [(parameter + i, name, _filled_by_matrix(jacobian[c])) for i, c in enumerate(columns)]
            parameter += len(columns)
        return filled

    def _entries(self, indices: NDArray[np.intp], filled: NDArray[np.bool_]) -> list[tuple[int, int, int]]:
        """Local (row, column, slot) that make up the lower triangle; both halves where two local DOFs are merged."""
        entries = []
        for row, column in zip(*np.nonzero(filled), strict=True):
            slot = int(self._slot_of[indices[row], indices[column]])
            if slot >= 0 and (column <= row or indices[row] == indices[column]):
                entries.append((int(row), int(column), slot))
        return entries

    def local_slots(self, name: str, filled: NDArray[np.bool_]) -> list[tuple[tuple[int, int], int]]:
        """Local row and column, and slot, of a joint's filled entries."""
        local, indices = self._system.locate(self._system.graph.joint_dofs(name))
        entries = self._entries(indices, filled[np.ix_(local, local)])
        return [((int(local[row]), int(local[column])), slot) for row, column, slot in entries]

    def _columns(self, name: str, filled: NDArray[np.bool_], column_of: dict[int, int]) -> _Columns:
        pairs = self.local_slots(name, filled)
        columns = np.array([column_of[slot] for _, slot in pairs], dtype=np.intp)
        entries = np.array([entry for entry, _ in pairs], dtype=np.intp).reshape(-1, 2)
        return _Columns(entries, columns, len(set(columns.tolist())) < len(columns))

    @cached_property
    def _term_columns(self) -> list[tuple[str, str, _Columns, NDArray[np.float64]]]:
        """Joint, matrix, columns and factors of one."""
        by_matrix: dict[str, dict[int, int]] = {matrix: {} for matrix in MATRICES}
        for column, (slot, matrix) in enumerate(self.terms):
            by_matrix[matrix][slot] = column
        term_columns = []
        for name, filled in self._filled.items():
            for matrix in MATRICES:
                columns = self._columns(name, filled[matrix], by_matrix[matrix])
                if len(columns.columns):
                    term_columns.append((name, matrix, columns, np.ones(len(columns.columns))))
        return term_columns

    @cached_property
    def _weight_columns(self) -> list[tuple[int, str, str, _Columns, NDArray[np.float64]]]:
        """Parameter, joint, matrix, columns and factors of -x^T dZ x, of which the lower triangle is summed."""
        by_key: dict[tuple[int, str], dict[int, int]] = {}
        for column, (parameter, slot, matrix) in enumerate(self.derivatives):
            by_key.setdefault((parameter, matrix), {})[slot] = column
        off_diagonal = self._program.rows != self._program.columns
        slots = np.array([slot for _, slot, _ in self.derivatives], dtype=np.intp)
        weight_columns = []
        for parameter, name, filled in self._filled_derivatives:
            for matrix in MATRICES:
                columns = self._columns(name, filled[matrix], by_key.get((parameter, matrix), {}))
                if len(columns.columns):
                    factors = np.where(off_diagonal[slots[columns.columns]], -2.0, -1.0)
                    weight_columns.append((parameter, name, matrix, columns, factors))
        return weight_columns

    def gather(self, theta: Theta, count: int) -> NDArray[np.float64]:
        """Return the sum over the joints for each term, (n, n_terms).

        Raises
        ------
        DovetailError
            A joint fills entries of its matrices for some parameters only.
        """
        total = np.zeros((count, len(self.terms)))
        matrices: dict[str, StructuralMatrices] = {}
        for name in self._filled:
            model = self._system.graph.connections[name].model
            matrices[name] = joint_matrices(name, model, theta[name])
            stray = filled_entries(matrices[name]) & ~self._system.filled[name]
            if stray.any():
                row, column = np.argwhere(stray)[0]
                raise DovetailError(
                    f"joint '{name}' ({model.name}) fills the entry ({row}, {column}) of its matrices for some "
                    "parameters only; it must be filled for all, or for none."
                )
        for name, matrix, columns, ones in self._term_columns:
            columns.add(total, getattr(matrices[name], matrix), ones)
        if not np.isfinite(total).all():
            raise DovetailError("a joint's matrices are not finite for these parameters.")
        return total

    def gather_weights(self, theta: Theta, count: int) -> NDArray[np.float64]:
        """Return the derivatives of the terms by the parameters, (n, n_derivatives), signed for -x^T dZ x."""
        total = np.zeros((count, len(self.derivatives)))
        jacobians = {
            name: joint_jacobian(name, self._system.graph.connections[name].model, theta[name])
            for name in dict.fromkeys(name for _, name, _ in self._filled_derivatives)
        }
        theta_columns = {name: iter(columns) for name, columns in self._jacobian_columns.items()}
        column_of = {parameter: next(theta_columns[name]) for parameter, name, _ in self._filled_derivatives}
        for parameter, name, matrix, columns, factors in self._weight_columns:
            columns.add(total, getattr(jacobians[name][column_of[parameter]], matrix), factors)
        return total


def _filled_by_matrix(matrices: StructuralMatrices) -> dict[str, NDArray[np.bool_]]:
    return {matrix: (getattr(matrices, matrix) != 0).any(axis=0) for matrix in MATRICES}


class SpectralInputs:
    """The kernel's inputs from joints that depend on frequency and give their own dynamic stiffness.

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
            name: inputs.local_slots(name, system.filled[name])
            for name, connection in system.graph.connections.items()
            if depends_on_frequency(connection.model)
        }

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
        """Return roughly how much memory the evaluation of one sample takes."""
        largest = max((self._model(name).size ** 2 for name in self._entries), default=0)
        rows = len(self.slots) + (len(self.derivatives) if derivatives else 0)
        temporaries = 6 if derivatives else 3
        return 16 * len(self._system.frequency) * (rows + temporaries * largest)

    def gather(self, theta: Theta, count: int) -> NDArray[np.float64]:
        """Return the sum over these joints at each slot, (n, n_slots, 2, n_freq).

        Raises
        ------
        DovetailError
            A joint fills entries of its dynamic stiffness for some parameters or lines only.
        """
        frequency = self._system.frequency
        total = np.zeros((count, len(self.slots), 2, len(frequency)))
        row_of = {slot: row for row, slot in enumerate(self.slots)}
        for name, entries in self._entries.items():
            Z = joint_stiffness(name, self._model(name), frequency, theta[name])
            stray = (Z != 0).any(axis=(0, 1)) & ~self._system.filled[name]
            if stray.any():
                row, column = np.argwhere(stray)[0]
                raise DovetailError(
                    f"joint '{name}' ({self._model(name).name}) fills the entry ({row}, {column}) of its dynamic "
                    "stiffness for some parameters or frequencies only; it must be filled for all, or for none."
                )
            for (row, column), slot in entries:
                total[:, row_of[slot], 0] += Z[..., row, column].real
                total[:, row_of[slot], 1] += Z[..., row, column].imag
        return total

    def gather_weights(self, theta: Theta, count: int) -> NDArray[np.float64]:
        """Return the derivatives by the parameters, (n, n_derivatives, 2, n_freq), signed for -x^T dZ x."""
        total = np.zeros((count, len(self.derivatives), 2, len(self._system.frequency)))
        row_of = {key: row for row, key in enumerate(self.derivatives)}
        for name, parameter, dZ in self._stiffness_derivatives(theta):
            for (row, column), slot in self._entries[name]:
                weight = -2.0 if self._off_diagonal[slot] else -1.0
                total[:, row_of[parameter, slot], 0] += weight * dZ[..., row, column].real
                total[:, row_of[parameter, slot], 1] += weight * dZ[..., row, column].imag
        return total

    def _stiffness_derivatives(self, theta: Theta) -> Iterator[tuple[str, int, NDArray[np.complex128]]]:
        """Yield joint, parameter number and derivative, one derivative at a time to save memory."""
        for name in self._entries:
            if numbers := self._parameter_numbers(name):
                derivatives = joint_stiffness_jacobian(name, self._model(name), self._system.frequency, theta[name])
                for column, dZ in enumerate(derivatives):
                    if column in numbers:
                        yield name, numbers[column], dZ

    def _parameter_numbers(self, name: str) -> dict[int, int]:
        """Return the number among all parameters of each column of a joint by which to differentiate."""
        before = 0
        for joint, columns in self._jacobian_columns.items():
            if joint == name:
                return {column: before + index for index, column in enumerate(columns)}
            before += len(columns)
        return {}

    def _model(self, name: str) -> JointModel:
        return self._system.graph.connections[name].model
