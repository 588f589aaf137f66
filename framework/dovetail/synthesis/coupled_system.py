"""The coupled system of an assembly: its active DOFs, and the entries of substructures and joints."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.interfaces import JointModel, SubstructureModel, plugin_errors
from dovetail.synthesis.condensation import BoundaryStiffness, boundary_stiffness
from dovetail.synthesis.elimination import Program
from dovetail.synthesis.graph import Graph, Point, connected_with
from dovetail.synthesis.joint_evaluation import (
    JointSparsity,
    Sparsity,
    Theta,
    UnplannedEntries,
    depends_on_frequency,
    filled_entries,
    joint_matrices,
    joint_stiffness,
)
from dovetail.synthesis.relative_coordinates import in_coordinates, relative_coordinates, stiff_springs

_MOST_KEPT = 16e6
"""Bytes of all condensed stiffnesses that are kept with their substructure."""
_LATEST: WeakKeyDictionary[SubstructureModel, dict[tuple[object, ...], BoundaryStiffness]] = WeakKeyDictionary()
"""The latest condensed stiffnesses of each substructure by their DOFs and frequencies, the last one used at the end."""


class Within(NamedTuple):
    """Lines from which others are chosen.

    Attributes
    ----------
    frequency : (n,) array
        Hz.
    alone : set of str
        Substructures that are condensed at the other lines only.
    """

    frequency: NDArray[np.float64]
    alone: AbstractSet[str] = frozenset()


def condense(
    graph: Graph,
    frequency: NDArray[np.float64],
    points: Sequence[Point],
    disturbed: Mapping[str, int] | None = None,
    *,
    within: Within | None = None,
) -> dict[str, BoundaryStiffness]:
    """Condense every substructure to the DOFs that joints and points need.

    Parameters
    ----------
    graph : Graph
    frequency : (n_freq,) array
        Hz, positive.
    points : sequence of Point
    disturbed : mapping of str to int, optional
        Substructures whose dense matrices are disturbed by rounding errors, and the number of the random draw.
    within : Within, optional
        Lines of which these are some, at all of which substructures are condensed unless that takes too much memory.

    Returns
    -------
    dict of str to BoundaryStiffness
        By the substructure's name, without held DOFs.
    """
    needed: dict[str, set[int]] = {name: set() for name in graph.substructures}
    for joint in graph.connections:
        for name, attached in graph.attached_dofs(joint):
            needed[name].update(attached)
    for name, dof in points:
        needed[name].add(dof)
    condensed = {}
    for name, substructure in graph.substructures.items():
        dofs = graph.boundary(name, needed[name])
        if dofs and not substructure.grounded:
            numbers, motion = graph.motion(name, dofs)
            with plugin_errors(substructure, f"substructure '{name}' ({substructure.name})"):
                draw = None if disturbed is None else disturbed.get(name)
                whole = None if within is None or name in within.alone else within.frequency
                boundary = _chosen_stiffness(substructure, dofs, frequency, draw, whole)
            condensed[name] = (boundary if motion is None else boundary.moved_by(motion.toarray())).numbered(numbers)
    return condensed


def _chosen_stiffness(
    substructure: SubstructureModel,
    dofs: Sequence[int],
    frequency: NDArray[np.float64],
    draw: int | None,
    whole: NDArray[np.float64] | None,
) -> BoundaryStiffness:
    """Return the condensed stiffness at some lines, taken from that at the whole lines from which they are chosen.

    It is condensed at these lines alone where there is no whole, it would not be kept, or does not contain them.
    """
    if whole is not None and 8 * len(dofs) * (len(dofs) + 1) * len(whole) <= _MOST_KEPT:
        lines = np.minimum(np.searchsorted(whole, frequency), len(whole) - 1)
        if np.array_equal(whole[lines], frequency):
            return _latest_stiffness(substructure, dofs, whole, draw).at(lines)
    return _latest_stiffness(substructure, dofs, frequency, draw)


def _latest_stiffness(
    substructure: SubstructureModel, dofs: Sequence[int], frequency: NDArray[np.float64], draw: int | None
) -> BoundaryStiffness:
    """Return the condensed stiffness, without computing it again if it is among the latest of this substructure.

    Assemblies that differ in one part, as in a search for causes, condense that part only.
    """
    wanted, kept = (tuple(dofs), draw, frequency.tobytes()), _LATEST.setdefault(substructure, {})
    if (stiffness := kept.pop(wanted, None)) is None:
        stiffness = boundary_stiffness(substructure, dofs, frequency, draw)
        if stiffness.values.nbytes > _MOST_KEPT:
            return stiffness
        stiffness.values.setflags(write=False)
    kept[wanted] = stiffness
    stored = list(kept.items())  # another thread may change them
    excess = sum(each.values.nbytes for _, each in stored) - _MOST_KEPT
    for key, oldest in stored:
        if excess <= 0.0:
            break
        kept.pop(key, None)
        excess -= oldest.values.nbytes
    return stiffness


@dataclass(frozen=True, eq=False)
class PlacedJoint:
    """A joint, and where its DOFs are among the active ones of the coupled system.

    Parameters
    ----------
    name : str
    model : JointModel
    sparsity : JointSparsity
    local, indices : (n,) arrays of int
        Its DOFs that are active, by its own numbers and by those of the system.
    """

    name: str
    model: JointModel
    sparsity: JointSparsity
    local: NDArray[np.intp]
    indices: NDArray[np.intp]

    @property
    def key(self) -> tuple[object, ...]:
        """What two joints have in common that are the same at the same place."""
        arrays = (self.sparsity.matrices, self.sparsity.derivatives, self.local, self.indices)
        return (self.name, self.model, *(array.tobytes() for array in arrays))


@dataclass(frozen=True, eq=False)
class JointStructure:
    """The joints of a coupled system and its elimination, without the lines and the substructures.

    Two are equal if they lead to the same inputs of a kernel.

    Parameters
    ----------
    joints : tuple of PlacedJoint
    program : Program
        Over the system's active DOFs.
    jacobian_columns : mapping of str to list of int
        Columns of each joint's theta by which to differentiate.
    """

    joints: tuple[PlacedJoint, ...]
    program: Program
    jacobian_columns: Mapping[str, list[int]]

    @cached_property
    def _key(self) -> tuple[object, ...]:
        columns = tuple((name, *columns) for name, columns in self.jacobian_columns.items())
        return (self.program, columns, *(joint.key for joint in self.joints))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, JointStructure) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)


class CoupledSystem:
    """Substructures, condensed to the DOFs that joints and points need, and the joints between them.

    Parameters
    ----------
    graph : Graph
    frequency : (n_freq,) array
        Hz, positive.
    points : sequence of Point
        DOFs at which forces act or motion is computed.
    condensed : mapping
        The substructures, as `condense` returns them.
    sparsity : Sparsity
        The non-zero entries of the joints' matrices and derivatives.
    """

    def __init__(
        self,
        graph: Graph,
        frequency: NDArray[np.float64],
        points: Sequence[Point],
        condensed: Mapping[str, BoundaryStiffness],
        sparsity: Sparsity,
    ) -> None:
        self.graph = graph
        self.frequency = frequency
        self.points = tuple(points)
        self.condensed = condensed
        self.sparsity = sparsity

    @cached_property
    def _pattern(self) -> NDArray[np.bool_]:
        pattern = np.zeros((self.graph.size, self.graph.size), dtype=bool)
        for boundary in self.condensed.values():
            rows, columns = np.nonzero(boundary.entry >= 0)
            pattern[boundary.numbers[rows], boundary.numbers[columns]] = True
        for name in self.graph.connections:
            numbers = self.graph.joint_dofs(name)
            moving = np.flatnonzero(numbers >= 0)
            rows, columns = np.nonzero(self.sparsity[name].filled[np.ix_(moving, moving)])
            pattern[numbers[moving][rows], numbers[moving][columns]] = True
        return pattern | pattern.T

    @cached_property
    def active(self) -> NDArray[np.intp]:
        """Global DOFs of the points, and all those that are connected with them.

        Raises
        ------
        DovetailError
            A point does not move.
        """
        numbers = [int(self.graph.substructure_dofs(name)[dof]) for name, dof in self.points]
        points = np.isin(np.arange(self.graph.size), numbers)
        active = np.flatnonzero(connected_with(points & self._pattern.any(axis=0), self._pattern))
        for (name, dof), number in zip(self.points, numbers, strict=True):
            if number not in active:
                raise DovetailError(
                    f"{self.graph.substructures[name].dof_label(dof)} of '{name}' does not move: "
                    "it is fixed, or has neither inertia nor stiffness."
                )
        return active

    @property
    def pattern(self) -> NDArray[np.bool_]:
        """Which entries of the system of active DOFs, (d, d), are filled."""
        return self._pattern[np.ix_(self.active, self.active)]

    def index(self, point: Point) -> int:
        """Return the index of a point among the active DOFs."""
        return int(np.searchsorted(self.active, self.graph.substructure_dofs(point[0])[point[1]]))

    def locate(self, numbers: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return which of some global DOFs are active, and their indices among the active ones."""
        local = np.flatnonzero(np.isin(numbers, self.active))
        return local, np.searchsorted(self.active, numbers[local])

    @cached_property
    def joints(self) -> tuple[PlacedJoint, ...]:
        """The joints at their places."""
        return tuple(
            PlacedJoint(name, connection.model, self.sparsity[name], *self.locate(self.graph.joint_dofs(name)))
            for name, connection in self.graph.connections.items()
        )

    def substructure_rows(self, program: Program) -> tuple[tuple[tuple[int, int], ...], Iterator[NDArray[np.float64]]]:
        """Return slot and part (0 real, 1 imaginary) of the substructures' non-zero rows, and these rows (n_freq,)."""
        values = defaultdict[int, list[NDArray[np.complex128]]](list)
        for boundary in self.condensed.values():
            local, indices = self.locate(boundary.numbers)
            entry = boundary.entry[np.ix_(local, local)]
            for row, column, slot in program.entries(indices, entry >= 0):
                values[slot].append(boundary.values[entry[row, column]])

        def row_of(slot: int, half: int) -> NDArray[np.float64]:
            parts = [each.view(np.float64)[half::2] for each in values[slot]]
            return np.asarray(np.sum(parts, axis=0)) if len(parts) > 1 else parts[0]

        keys = tuple((slot, half) for slot in sorted(values) for half in (0, 1) if row_of(slot, half).any())
        return keys, (row_of(*key) for key in keys)

    def dynamic_stiffness(self, theta: Theta, lines: NDArray[np.intp] | slice) -> NDArray[np.complex128]:
        """Return Z (n_lines, d, d) of the active DOFs at some lines; see `in_relative_coordinates`."""
        Z, T = self.in_relative_coordinates(theta, lines)
        back = np.linalg.inv(T)
        return np.asarray(back.T @ Z @ back)

    def in_relative_coordinates(
        self, theta: Theta, lines: NDArray[np.intp] | slice
    ) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
        """Return T^T Z T of the active DOFs at some lines, and T, with coordinates relative across stiff springs.

        Parameters
        ----------
        theta : mapping of str to (1, n_params) array
            One parameter vector.
        lines : array of int or slice
            Indices of the frequencies.

        Returns
        -------
        stiffness : (n_lines, d, d) complex array
        T : (d, d) array
            Zeros and ones; see `relative_coordinates`.

        Raises
        ------
        UnplannedEntries
            A joint has entries that are not planned for.
        """
        frequency, size = self.frequency[lines], len(self.active)
        system = np.zeros((len(frequency), size, size), dtype=np.complex128)
        for boundary in self.condensed.values():
            local, indices = self.locate(boundary.numbers)
            _scatter(system, indices, boundary.dense(lines)[:, local[:, None], local])
        joints: list[tuple[NDArray[np.intp], NDArray[np.complex128]]] = []
        springs: list[tuple[float, int, int]] = []
        others = np.diagonal(system[len(system) // 2])
        for joint in self.joints:
            Z = joint_stiffness(joint.name, joint.model, frequency, theta[joint.name])[0]
            self._require(joint.name, Z, theta[joint.name])
            joints.append((joint.indices, Z[:, joint.local[:, None], joint.local]))
            numbers = np.full(len(Z[0]), -1)
            numbers[joint.local] = joint.indices
            springs += stiff_springs(Z[len(Z) // 2], numbers, others)
        T = relative_coordinates(size, springs)
        if springs:
            system = T.T @ system @ T
        for indices, Z in joints:
            system += in_coordinates(Z, T[indices])
        return system, T

    def _require(self, name: str, Z: NDArray[np.complex128], theta: NDArray[np.float64]) -> None:
        """Raise `UnplannedEntries` if a joint's dynamic stiffness has entries that are not planned for."""
        filled, sparsity, model = filled_entries(Z), self.sparsity[name], self.graph.connections[name].model
        if (filled & ~sparsity.filled).any():
            constant = not depends_on_frequency(model)
            matrices = joint_matrices(name, model, theta).filled[0] if constant else filled[np.newaxis]
            raise UnplannedEntries({name: sparsity.with_matrices(matrices)})


def _scatter(system: NDArray[np.complex128], indices: NDArray[np.intp], Z: NDArray[np.complex128]) -> None:
    """Add Z to rows and columns of the system; an index that occurs twice is a merged DOF.

    Entries of merged DOFs are summed first, so that a stiff spring between them cancels and leaves no rounding errors
    in softer entries.
    """
    distinct, place = np.unique(indices, return_inverse=True)
    merged = np.zeros((len(Z), len(distinct), len(distinct)), dtype=np.complex128)
    for local_row, row in enumerate(place):
        for local_column, column in enumerate(place):
            merged[:, row, column] += Z[:, local_row, local_column]
    system[:, distinct[:, None], distinct] += merged
