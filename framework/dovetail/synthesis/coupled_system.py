"""The coupled system of an assembly: which DOFs take part, and where substructures and joints have entries."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from dovetail.errors import DovetailError, PluginError
from dovetail.interfaces import plugin_errors
from dovetail.synthesis.condensation import boundary_dynamic_stiffness
from dovetail.synthesis.graph import Graph
from dovetail.synthesis.joint_evaluation import (
    Theta,
    depends_on_frequency,
    filled_entries,
    joint_matrices,
    joint_stiffness,
)

__all__ = ["CoupledSystem", "Point"]

Point = tuple[str, int]
"""A DOF of a substructure: its name and the DOF's number there."""


class CoupledSystem:
    """Substructures condensed to what joints and points need, and the joints between them.

    Parameters
    ----------
    graph : Graph
    frequency : (n_freq,) array
        Hz, positive.
    points : sequence of Point
        Where forces act and motion is read; the first is the drive point.
    probe_theta : mapping of str to (n, n_params) array
        A few parameter vectors that show which entries of the joints' matrices are ever filled.
    """

    def __init__(
        self, graph: Graph, frequency: NDArray[np.float64], points: Sequence[Point], probe_theta: Theta
    ) -> None:
        self.graph = graph
        self.frequency = np.asarray(frequency, dtype=np.float64)
        self.points = tuple(points)
        self.probe_theta = probe_theta
        self.condensed = self._condense()

    def _condense(self) -> dict[str, tuple[NDArray[np.intp], NDArray[np.complex128]]]:
        """Condense every substructure to the DOFs that joints and points need: global numbers and Z."""
        needed: dict[str, set[int]] = {name: set() for name in self.graph.substructures}
        for connection in self.graph.connections.values():
            for port in connection.attachments:
                needed[port.substructure].update(port.dofs)
        for name, dof in self.points:
            needed[name].add(dof)
        condensed = {}
        for name, substructure in self.graph.substructures.items():
            dofs = sorted(needed[name])
            if dofs and not substructure.grounded:
                numbers = self.graph.substructure_dofs(name)[dofs]
                with plugin_errors(substructure, f"substructure '{name}' ({substructure.name})"):
                    Z = boundary_dynamic_stiffness(substructure, dofs, self.frequency)
                moving = np.flatnonzero(numbers >= 0)
                condensed[name] = numbers[moving], Z[:, moving[:, None], moving]
        return condensed

    @cached_property
    def filled(self) -> dict[str, NDArray[np.bool_]]:
        """Local entries of each joint that any vector of `probe_theta` fills, (d, d)."""
        return {name: self._filled_entries(name) for name in self.graph.connections}

    def _filled_entries(self, name: str) -> NDArray[np.bool_]:
        model, theta = self.graph.connections[name].model, self.probe_theta[name]
        if depends_on_frequency(model):
            lines = self.frequency[[0, len(self.frequency) // 2, -1]]
            filled: NDArray[np.bool_] = (joint_stiffness(name, model, lines, theta) != 0).any(axis=(0, 1))
            return filled
        matrices = joint_matrices(name, model, theta)
        for matrix in (matrices.M, matrices.K, matrices.C, matrices.D):
            finite = np.isfinite(matrix).all()
            if not finite or np.abs(matrix - np.swapaxes(matrix, 1, 2)).max() > 1e-9 * np.abs(matrix).max():
                raise PluginError(f"joint '{name}' ({model.name}) gives matrices that are not finite and symmetric.")
        return filled_entries(matrices)

    @cached_property
    def _pattern(self) -> NDArray[np.bool_]:
        pattern = np.zeros((self.graph.size, self.graph.size), dtype=bool)
        for numbers, Z in self.condensed.values():
            rows, columns = np.nonzero((Z != 0).any(axis=0))
            pattern[numbers[rows], numbers[columns]] = True
        for name in self.graph.connections:
            numbers = self.graph.joint_dofs(name)
            moving = np.flatnonzero(numbers >= 0)
            rows, columns = np.nonzero(self.filled[name][np.ix_(moving, moving)])
            pattern[numbers[moving][rows], numbers[moving][columns]] = True
        return pattern | pattern.T

    @cached_property
    def active(self) -> NDArray[np.intp]:
        """Global DOFs that take part: the points' and all that are connected with them.

        Raises
        ------
        DovetailError
            A point does not move.
        """
        filled: NDArray[np.bool_] = np.asarray(self._pattern.any(axis=0))
        numbers = [int(self.graph.substructure_dofs(name)[dof]) for name, dof in self.points]
        _, group = connected_components(self._pattern, directed=False)
        reached = {int(group[number]) for number in numbers if number >= 0 and filled[number]}
        active = np.flatnonzero(filled & np.isin(group, list(reached)))
        for (name, dof), number in zip(self.points, numbers, strict=True):
            if number not in active:
                raise DovetailError(
                    f"{self.graph.substructures[name].dof_label(dof)} of '{name}' does not move: "
                    "it is held, or nothing gives it inertia or stiffness."
                )
        return active

    @property
    def pattern(self) -> NDArray[np.bool_]:
        """Where the system over the active DOFs has entries, (d, d)."""
        return self._pattern[np.ix_(self.active, self.active)]

    def index(self, point: Point) -> int:
        """Return the index of a point among the active DOFs."""
        return int(np.searchsorted(self.active, self.graph.substructure_dofs(point[0])[point[1]]))

    def locate(self, numbers: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return which of some global DOFs are active, and their indices among the active ones."""
        local = np.flatnonzero(np.isin(numbers, self.active))
        return local, np.searchsorted(self.active, numbers[local])

    def dynamic_stiffness(self, theta: Theta, lines: NDArray[np.intp] | slice) -> NDArray[np.complex128]:
        """Return Z over the active DOFs at some lines.

        Parameters
        ----------
        theta : mapping of str to (1, n_params) array
            One parameter vector.
        lines : array of int or slice
            Which of the frequencies.

        Returns
        -------
        (n_lines, d, d) complex array
        """
        frequency, size = self.frequency[lines], len(self.active)
        system = np.zeros((len(frequency), size, size), dtype=np.complex128)
        for numbers, Z in self.condensed.values():
            local, indices = self.locate(numbers)
            _scatter(system, indices, Z[lines][:, local[:, None], local])
        for name, connection in self.graph.connections.items():
            local, indices = self.locate(self.graph.joint_dofs(name))
            Z = joint_stiffness(name, connection.model, frequency, theta[name])[0]
            _scatter(system, indices, Z[:, local[:, None], local])
        return system


def _scatter(system: NDArray[np.complex128], indices: NDArray[np.intp], Z: NDArray[np.complex128]) -> None:
    """Add Z to rows and columns of the system. An index that occurs twice is a merged DOF."""
    for local_row, row in enumerate(indices):
        for local_column, column in enumerate(indices):
            system[:, row, column] += Z[:, local_row, local_column]
