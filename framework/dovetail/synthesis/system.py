"""The coupled system of an assembly: which DOFs take part, and where substructures and joints have entries."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from dovetail.errors import DovetailError, PluginError
from dovetail.interfaces import JointModel, StructuralMatrices, blamed_on
from dovetail.synthesis.condensation import boundary_dynamic_stiffness
from dovetail.synthesis.graph import Graph

__all__ = [
    "CoupledSystem",
    "Point",
    "Theta",
    "depends_on_frequency",
    "filled_entries",
    "joint_jacobian",
    "joint_matrices",
    "joint_stiffness",
    "joint_stiffness_jacobian",
]

Point = tuple[str, int]
"""A DOF of a substructure: its name and the DOF's number there."""
Theta = Mapping[str, NDArray[np.float64]]
"""All parameters of each joint, (n, n_params), by the joint's name."""


class CoupledSystem:
    """Substructures condensed to what joints and points need, and the joints between them.

    Parameters
    ----------
    graph : Graph
    frequency : (n_freq,) array
        Hz, positive.
    points : sequence of Point
        Where forces act and motion is read; the first is the drive point.
    probe : mapping of str to (n, n_params) array
        A few parameter vectors that show which entries of the joints' matrices are ever filled.
    """

    def __init__(self, graph: Graph, frequency: NDArray[np.float64], points: Sequence[Point], probe: Theta) -> None:
        self.graph = graph
        self.frequency = np.asarray(frequency, dtype=np.float64)
        self.points = tuple(points)
        self.probe = probe
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
                with blamed_on(substructure, f"substructure '{name}' ({substructure.name})"):
                    Z = boundary_dynamic_stiffness(substructure, dofs, self.frequency)
                moving = np.flatnonzero(numbers >= 0)
                condensed[name] = numbers[moving], Z[:, moving[:, None], moving]
        return condensed

    @cached_property
    def filled(self) -> dict[str, NDArray[np.bool_]]:
        """Local entries of each joint that any probe fills, (d, d)."""
        return {name: self._filled(name) for name in self.graph.connections}

    def _filled(self, name: str) -> NDArray[np.bool_]:
        model, probe = self.graph.connections[name].model, self.probe[name]
        if depends_on_frequency(model):
            lines = self.frequency[[0, len(self.frequency) // 2, -1]]
            filled: NDArray[np.bool_] = (joint_stiffness(name, model, lines, probe) != 0).any(axis=(0, 1))
            return filled
        matrices = joint_matrices(name, model, probe)
        for part in (matrices.M, matrices.K, matrices.C, matrices.D):
            if not np.isfinite(part).all() or np.abs(part - np.swapaxes(part, 1, 2)).max() > 1e-9 * np.abs(part).max():
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

    def place(self, point: Point) -> int:
        """Return the place of a point among the active DOFs."""
        return int(np.searchsorted(self.active, self.graph.substructure_dofs(point[0])[point[1]]))

    def located(self, numbers: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return which of some global DOFs take part, and their places among the active ones."""
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
            local, places = self.located(numbers)
            _scatter(system, places, Z[lines][:, local[:, None], local])
        for name, connection in self.graph.connections.items():
            local, places = self.located(self.graph.joint_dofs(name))
            Z = joint_stiffness(name, connection.model, frequency, theta[name])[0]
            _scatter(system, places, Z[:, local[:, None], local])
        return system


def joint_matrices(name: str, model: JointModel, theta: NDArray[np.float64]) -> StructuralMatrices:
    """Return a joint's matrices for parameter vectors (n, n_params).

    Raises
    ------
    PluginError
        The model fails, or returns something else than (n, d, d) matrices.
    """
    label = _label(name, model)
    with blamed_on(model, label):
        matrices = model.matrices(theta)
    _check_matrices(label, model, matrices, len(theta))
    return matrices


def joint_jacobian(name: str, model: JointModel, theta: NDArray[np.float64]) -> Sequence[StructuralMatrices]:
    """Return the derivatives of a joint's matrices by each of its parameters, for (n, n_params) vectors.

    Raises
    ------
    PluginError
        The model fails, or returns something else than one set of (n, d, d) matrices a parameter.
    """
    label = _label(name, model)
    with blamed_on(model, label):
        derivatives = tuple(model.matrices_jacobian(theta))
    if len(derivatives) != len(model.parameters):
        found = f"{label} returns {len(derivatives)} derivatives of its matrices"
        raise PluginError(f"{found}, not one for each of its {len(model.parameters)} parameters.")
    for matrices in derivatives:
        _check_matrices(label, model, matrices, len(theta))
    return derivatives


def joint_stiffness(
    name: str, model: JointModel, frequency: NDArray[np.float64], theta: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Return a joint's dynamic stiffness (n, n_freq, d, d) for parameter vectors (n, n_params).

    Raises
    ------
    PluginError
        The model fails, or returns something else than finite numbers of this shape.
    """
    label = _label(name, model)
    with blamed_on(model, label):
        stiffness = np.asarray(model.dynamic_stiffness(frequency, theta), dtype=np.complex128)
    _check_stiffness(label, model, stiffness, (len(theta), len(frequency)))
    return stiffness


def joint_stiffness_jacobian(
    name: str, model: JointModel, frequency: NDArray[np.float64], theta: NDArray[np.float64]
) -> Iterator[NDArray[np.complex128]]:
    """Yield the derivative (n, n_freq, d, d) of a joint's dynamic stiffness by each of its parameters.

    Raises
    ------
    PluginError
        The model fails, or gives something else than one array of finite numbers of this shape a parameter.
    """
    label, count, shape = _label(name, model), 0, (len(theta), len(frequency))
    with blamed_on(model, label):
        derivatives = iter(model.dynamic_stiffness_jacobian(frequency, theta))
    while True:
        with blamed_on(model, label):
            given = next(derivatives, None)
            derivative = None if given is None else np.asarray(given, dtype=np.complex128)
        if derivative is None:
            break
        _check_stiffness(label, model, derivative, shape)
        count += 1
        yield derivative
    if count != len(model.parameters):
        found = f"{label} returns {count} derivatives of its dynamic stiffness"
        raise PluginError(f"{found}, not one for each of its {len(model.parameters)} parameters.")


def _check_stiffness(label: str, model: JointModel, stiffness: NDArray[np.complex128], count: tuple[int, int]) -> None:
    wanted = (*count, model.size, model.size)
    if stiffness.shape != wanted:
        raise PluginError(f"{label} returns a dynamic stiffness of shape {stiffness.shape}, not {wanted}.")
    if not np.isfinite(stiffness).all():
        raise PluginError(f"{label} returns a dynamic stiffness that is not finite.")


def _label(name: str, model: JointModel) -> str:
    return f"joint '{name}' ({model.name})"


def _check_matrices(label: str, model: JointModel, matrices: object, count: int) -> None:
    if not isinstance(matrices, StructuralMatrices):
        raise PluginError(f"{label} returns {type(matrices).__name__}, not StructuralMatrices.")
    wanted = (count, model.size, model.size)
    if matrices.K.shape != wanted:
        raise PluginError(f"{label} returns matrices of shape {matrices.K.shape}, not {wanted}.")


def depends_on_frequency(model: JointModel) -> bool:
    """Return whether a joint gives its dynamic stiffness itself, in place of M, K, C and D."""
    return type(model).dynamic_stiffness is not JointModel.dynamic_stiffness


def filled_entries(matrices: StructuralMatrices) -> NDArray[np.bool_]:
    """Return the entries of (n, d, d) matrices that any sample fills, (d, d)."""
    filled = [(matrix != 0).any(axis=0) for matrix in (matrices.M, matrices.K, matrices.C, matrices.D)]
    either: NDArray[np.bool_] = np.logical_or.reduce(filled)
    return either


def _scatter(system: NDArray[np.complex128], places: NDArray[np.intp], Z: NDArray[np.complex128]) -> None:
    """Add Z to the rows and columns `places`, which may repeat."""
    for row, place in enumerate(places):
        for column, other in enumerate(places):
            system[:, place, other] += Z[:, row, column]
