"""What substructures and joints contribute to each slot of the elimination, as columns of arrays for the kernel."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.interfaces import JointModel, StructuralMatrices
from dovetail.synthesis.codegen.layout import Derivative, GeneralDerivative, Term
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

__all__ = ["Contributions", "GeneralContributions"]

_PARTS = "KDCM"


@dataclass(frozen=True, eq=False)
class _Columns:
    """Which entries of a joint's matrices go to which columns.

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


class Contributions:
    """The bookkeeping between a coupled system and its elimination program.

    Parameters
    ----------
    system : CoupledSystem
    program : Program
        Over the system's active DOFs.
    sought : mapping of str to list of int
        Parameters of each joint by which to differentiate, as columns of its theta.
    """

    def __init__(self, system: CoupledSystem, program: Program, sought: dict[str, list[int]]) -> None:
        self._system = system
        self._program = program
        self._sought = sought
        self._slot_of = np.full((len(system.active),) * 2, -1, dtype=np.intp)
        for slot, (row, column) in enumerate(zip(program.rows, program.columns, strict=True)):
            self._slot_of[row, column] = self._slot_of[column, row] = slot

    @cached_property
    def static(self) -> tuple[tuple[tuple[int, int], ...], NDArray[np.float64]]:
        """Slot and part of each non-zero row that substructures contribute, and the rows (n_rows, n_freq)."""
        values = np.zeros((self._program.slots, len(self._system.frequency)), dtype=np.complex128)
        for numbers, Z in self._system.condensed.values():
            local, places = self._system.located(numbers)
            for row, column, slot in self._entries(places, np.ones((len(places),) * 2, dtype=bool)):
                values[slot] += Z[:, local[row], local[column]]
        parts = np.stack([values.real, values.imag], axis=1)
        keys = tuple((int(slot), int(part)) for slot, part in np.argwhere(parts.any(axis=-1)))
        return keys, np.array([parts[key] for key in keys]).reshape(len(keys), -1)

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """Slot and part of each column that joints contribute."""
        found = {
            (slot, part)
            for name, filled in self._filled_parts.items()
            for part in _PARTS
            for _, slot in self.local_slots(name, filled[part])
        }
        return tuple(sorted(found))

    @cached_property
    def derivatives(self) -> tuple[Derivative, ...]:
        """Parameter, slot and part of each column of the derivatives."""
        found: set[Derivative] = set()
        for parameter, name, filled in self._filled_derivatives:
            for part in _PARTS:
                found.update((parameter, slot, part) for _, slot in self.local_slots(name, filled[part]))
        return tuple(sorted(found))

    @property
    def parameters(self) -> int:
        """Number of parameters by which to differentiate."""
        return sum(len(columns) for columns in self._sought.values())

    @cached_property
    def _filled_parts(self) -> dict[str, dict[str, NDArray[np.bool_]]]:
        """Entries of each part of each joint's matrices that any probe fills."""
        found = {}
        for name, connection in self._system.graph.connections.items():
            if not depends_on_frequency(connection.model):
                found[name] = _filled_by_part(joint_matrices(name, connection.model, self._system.probe[name]))
        return found

    @cached_property
    def _filled_derivatives(self) -> list[tuple[int, str, dict[str, NDArray[np.bool_]]]]:
        """The same for the derivative by each sought parameter."""
        found, parameter = [], 0
        for name, columns in self._sought.items():
            model = self._system.graph.connections[name].model
            general = depends_on_frequency(model)
            jacobian = joint_jacobian(name, model, self._system.probe[name]) if columns and not general else ()
            for column in columns:
                if not general:
                    found.append((parameter, name, _filled_by_part(jacobian[column])))
                parameter += 1
        return found

    def _entries(self, places: NDArray[np.intp], filled: NDArray[np.bool_]) -> list[tuple[int, int, int]]:
        """Local (row, column, slot) that make up the lower triangle; both halves where two local DOFs are merged."""
        entries = []
        for row, column in zip(*np.nonzero(filled), strict=True):
            slot = int(self._slot_of[places[row], places[column]])
            if slot >= 0 and (column <= row or places[row] == places[column]):
                entries.append((int(row), int(column), slot))
        return entries

    def local_slots(self, name: str, filled: NDArray[np.bool_]) -> list[tuple[tuple[int, int], int]]:
        """Local row and column, and slot, of a joint's filled entries."""
        local, places = self._system.located(self._system.graph.joint_dofs(name))
        entries = self._entries(places, filled[np.ix_(local, local)])
        return [((int(local[row]), int(local[column])), slot) for row, column, slot in entries]

    def _columns(self, name: str, filled: NDArray[np.bool_], column_of: dict[int, int]) -> _Columns:
        pairs = self.local_slots(name, filled)
        columns = np.array([column_of[slot] for _, slot in pairs], dtype=np.intp)
        entries = np.array([entry for entry, _ in pairs], dtype=np.intp).reshape(-1, 2)
        return _Columns(entries, columns, len(set(columns.tolist())) < len(columns))

    @cached_property
    def _term_columns(self) -> list[tuple[str, str, _Columns, NDArray[np.float64]]]:
        by_part: dict[str, dict[int, int]] = {part: {} for part in _PARTS}
        for column, (slot, part) in enumerate(self.terms):
            by_part[part][slot] = column
        found = [
            (name, part, self._columns(name, filled[part], by_part[part]))
            for name, filled in self._filled_parts.items()
            for part in _PARTS
        ]
        return [
            (name, part, columns, np.ones(len(columns.columns)))
            for name, part, columns in found
            if len(columns.columns)
        ]

    @cached_property
    def _weight_columns(self) -> list[tuple[int, str, str, _Columns, NDArray[np.float64]]]:
        """Parameter, joint, part, columns and the factors of -x^T dZ x, of which the lower triangle is summed."""
        by_key: dict[tuple[int, str], dict[int, int]] = {}
        for column, (parameter, slot, part) in enumerate(self.derivatives):
            by_key.setdefault((parameter, part), {})[slot] = column
        twice = self._program.rows != self._program.columns
        slots = np.array([slot for _, slot, _ in self.derivatives], dtype=np.intp)
        found = []
        for parameter, name, filled in self._filled_derivatives:
            for part in _PARTS:
                columns = self._columns(name, filled[part], by_key.get((parameter, part), {}))
                if len(columns.columns):
                    factors = np.where(twice[slots[columns.columns]], -2.0, -1.0)
                    found.append((parameter, name, part, columns, factors))
        return found

    def gather(self, theta: Theta, count: int) -> NDArray[np.float64]:
        """Return what the joints contribute to each term, (n, n_terms).

        Raises
        ------
        DovetailError
            A joint fills entries of its matrices for some parameters only.
        """
        total = np.zeros((count, len(self.terms)))
        matrices: dict[str, StructuralMatrices] = {}
        for name in self._filled_parts:
            model = self._system.graph.connections[name].model
            matrices[name] = joint_matrices(name, model, theta[name])
            stray = filled_entries(matrices[name]) & ~self._system.filled[name]
            if stray.any():
                row, column = np.argwhere(stray)[0]
                raise DovetailError(
                    f"joint '{name}' ({model.name}) fills the entry ({row}, {column}) of its matrices for some "
                    "parameters only; it must be filled for all, or for none."
                )
        for name, part, columns, ones in self._term_columns:
            columns.add(total, getattr(matrices[name], part), ones)
        if not np.isfinite(total).all():
            raise DovetailError("a joint's matrices are not finite for these parameters.")
        return total

    def gather_weights(self, theta: Theta, count: int) -> NDArray[np.float64]:
        """Return the derivatives of the terms by the sought parameters, (n, n_derivatives), signed for -x^T dZ x."""
        total = np.zeros((count, len(self.derivatives)))
        jacobians = {
            name: joint_jacobian(name, self._system.graph.connections[name].model, theta[name])
            for name, columns in self._sought.items()
            if columns and not depends_on_frequency(self._system.graph.connections[name].model)
        }
        own = {name: iter(columns) for name, columns in self._sought.items()}
        column_of = {parameter: next(own[name]) for parameter, name, _ in self._filled_derivatives}
        for parameter, name, part, columns, factors in self._weight_columns:
            columns.add(total, getattr(jacobians[name][column_of[parameter]], part), factors)
        return total


def _filled_by_part(matrices: StructuralMatrices) -> dict[str, NDArray[np.bool_]]:
    return {part: (getattr(matrices, part) != 0).any(axis=0) for part in _PARTS}


_Entries = list[tuple[tuple[int, int], int]]
"""Local row and column of a joint, and slot."""


class GeneralContributions:
    """The bookkeeping between joints that give their own dynamic stiffness and the elimination program.

    Parameters
    ----------
    system : CoupledSystem
    program : Program
        Over the system's active DOFs.
    sought : mapping of str to list of int
        Parameters of each joint by which to differentiate, as columns of its theta.
    contributions : Contributions
        Of the same system and program.
    """

    def __init__(
        self, system: CoupledSystem, program: Program, sought: Mapping[str, list[int]], contributions: Contributions
    ) -> None:
        self._system = system
        self._program = program
        self._sought = sought
        connections = system.graph.connections
        self._entries: dict[str, _Entries] = {
            name: contributions.local_slots(name, system.filled[name])
            for name, connection in connections.items()
            if depends_on_frequency(connection.model)
        }

    @cached_property
    def slots(self) -> tuple[int, ...]:
        """Slots to which these joints contribute."""
        return tuple(sorted({slot for entries in self._entries.values() for _, slot in entries}))

    @cached_property
    def derivatives(self) -> tuple[GeneralDerivative, ...]:
        """Parameter and slot of each row of the derivatives."""
        found = {
            (parameter, slot)
            for name, entries in self._entries.items()
            for parameter in self._numbers(name).values()
            for _, slot in entries
        }
        return tuple(sorted(found))

    def bytes_per_sample(self, *, derivatives: bool) -> int:
        """Return about how much memory the evaluation of one sample takes."""
        sizes = [self._model(name).size ** 2 for name in self._entries]
        rows = len(self.slots) + (len(self.derivatives) if derivatives else 0)
        held = 6 if derivatives else 3
        return 16 * len(self._system.frequency) * (rows + held * max(sizes, default=0))

    def gather(self, theta: Theta, count: int) -> NDArray[np.float64]:
        """Return what the joints contribute, (n, n_slots, 2, n_freq).

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
        """Return the derivatives by the sought parameters, (n, n_derivatives, 2, n_freq), signed for -x^T dZ x."""
        total = np.zeros((count, len(self.derivatives), 2, len(self._system.frequency)))
        row_of = {key: row for row, key in enumerate(self.derivatives)}
        twice = self._program.rows != self._program.columns
        for name, parameter, dZ in self._sought_derivatives(theta):
            for (row, column), slot in self._entries[name]:
                weight = -2.0 if twice[slot] else -1.0
                place = row_of[parameter, slot]
                total[:, place, 0] += weight * dZ[..., row, column].real
                total[:, place, 1] += weight * dZ[..., row, column].imag
        return total

    def _sought_derivatives(self, theta: Theta) -> Iterator[tuple[str, int, NDArray[np.complex128]]]:
        """Yield joint, parameter and derivative, one at a time."""
        for name in self._entries:
            if numbers := self._numbers(name):
                derivatives = joint_stiffness_jacobian(name, self._model(name), self._system.frequency, theta[name])
                for column, dZ in enumerate(derivatives):
                    if column in numbers:
                        yield name, numbers[column], dZ

    def _numbers(self, name: str) -> dict[int, int]:
        """Return the number among all sought parameters of each sought column of a joint."""
        before = 0
        for other, columns in self._sought.items():
            if other == name:
                return {column: before + place for place, column in enumerate(columns)}
            before += len(columns)
        return {}

    def _model(self, name: str) -> JointModel:
        return self._system.graph.connections[name].model
