"""What joints that depend on frequency contribute to each slot of the elimination, and its derivatives."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.interfaces import JointModel
from dovetail.synthesis.contributions import Contributions
from dovetail.synthesis.elimination import Program
from dovetail.synthesis.layout import GeneralDerivative
from dovetail.synthesis.system import (
    CoupledSystem,
    Theta,
    depends_on_frequency,
    joint_stiffness,
    joint_stiffness_jacobian,
)

__all__ = ["GeneralContributions"]

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
