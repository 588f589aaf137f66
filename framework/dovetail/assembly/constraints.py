"""Graphs in which DOFs move by others: rigid connections along skew axes, at points of rigid bodies, across distances.

A joint that merges DOFs along the assembly's axes gives them one number. Any other rigid connection is a set of linear
functions of DOFs that are zero, as is a part whose nodes move by fewer motions than they have DOFs. They are solved for
some DOFs, which then move by the others: u = T q. Each part and each joint is computed by q, as with T^T Z T, and no
large stiffness approximates a constraint.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, overload

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import NDArray

from dovetail.description.changed_joint import pair_functions
from dovetail.description.joint_coordinates import JointInCoordinates, LawInCoordinates
from dovetail.interfaces import JointModel, JointPort, NodeDofs, SparseMatrices, StructuralMatrices
from dovetail.synthesis import Connection, Graph, Point
from dovetail.synthesis.condensation import substructure_constraints
from dovetail.synthesis.graph import HELD
from dovetail.synthesis.joint_evaluation import depends_on_frequency

DEPENDENT = -2
"""Global number of a DOF that moves by others."""
_REDUNDANT = 1e-5
"""Largest coefficient of a function, of at most 1 at first, that follows from others: the points of facing nodes agree
within 1e-6 of the parts, so that two parts welded at two points would otherwise be held against turning."""
_ROUNDING = 1e-12
"""Distance of a coefficient from 0, 1 or -1, and size of a sum over its terms, that is due to rounding."""


class FollowingJoint(JointInCoordinates):
    """A joint at DOFs that move by others.

    Parameters
    ----------
    model : JointModel
    motion : (d, m) array
        The model's DOFs by those of this joint.
    """

    ports: tuple[JointPort, ...] = ()
    facing_ports = merged_dofs = contact_dofs = ()

    def __init__(self, model: JointModel, motion: NDArray[np.float64]) -> None:
        super().__init__(model)
        self._motion = motion

    @property
    def internal_dofs(self) -> int:
        """Number of its DOFs, whose global numbers the graph knows."""
        return int(self._motion.shape[1])

    @property
    def blocks(self) -> list[NDArray[np.float64]]:
        """The model's DOFs, all of them, by those of this joint."""
        return [self._motion]

    @overload
    def mapped(self, matrices: StructuralMatrices) -> StructuralMatrices: ...
    @overload
    def mapped(self, matrices: SparseMatrices) -> SparseMatrices: ...
    def mapped(self, matrices: StructuralMatrices | SparseMatrices) -> StructuralMatrices | SparseMatrices:
        """Return the matrices for the DOFs of this joint, with zeros where terms cancel, as between welded nodes."""
        moved = super().mapped(matrices)
        if isinstance(matrices, SparseMatrices) or isinstance(moved, SparseMatrices):
            return moved
        size = np.abs(self._motion)
        return StructuralMatrices(
            *(
                np.where(np.abs(entry) <= _ROUNDING * (size.T @ np.abs(terms) @ size), 0.0, entry)
                for entry, terms in ((getattr(moved, name), getattr(matrices, name)) for name in "MKCD")
            )
        )


class FollowingLaw(LawInCoordinates, FollowingJoint):
    """A `FollowingJoint` with a dynamic stiffness of its own dependence on frequency."""


@dataclass(frozen=True)
class ConstrainedGraph(Graph):
    """A graph in which some DOFs move by others.

    Parameters
    ----------
    substructures, connections : mappings
        As in `Graph`; joints at such DOFs act on those by which these move.
    plain : Graph
        The same parts and joints without the constraints.
    dependents : mapping of int to mapping of int to float
        Global DOFs of the plain graph that move by others, with their motion by these.
    """

    plain: Graph
    dependents: Mapping[int, Mapping[int, float]]

    @cached_property
    def _numbers(self) -> NDArray[np.intp]:
        """The number of each global DOF of the plain graph; `HELD` is the last entry, so that it stays what it is."""
        numbers = np.full(self.plain.size + 1, HELD, dtype=np.intp)
        free = np.setdiff1d(np.arange(self.plain.size), list(self.dependents))
        numbers[free] = np.arange(len(free))
        for dependent, motion in self.dependents.items():
            numbers[dependent] = DEPENDENT if motion else HELD
        return numbers

    @cached_property
    def _owners(self) -> dict[int, Point]:
        """A DOF of a substructure for each global DOF of the plain graph that is one."""
        owners: dict[int, Point] = {}
        for name in self.substructures:
            for dof, number in enumerate(self.plain.substructure_dofs(name).tolist()):
                owners.setdefault(number, (name, dof))
        return owners

    @property
    def size(self) -> int:
        """Number of global DOFs."""
        return self.plain.size - len(self.dependents)

    def with_connection(self, name: str, connection: Connection) -> Graph:
        """Return the graph with one more joint, or another one of this name."""
        return constrained(self.plain.with_connection(name, connection))

    def attached_dofs(self, name: str) -> tuple[tuple[str, tuple[int, ...]], ...]:
        """Return the substructure and its DOFs at each port of a joint, node by node, also those that follow others."""
        return self.plain.attached_dofs(name)

    def substructure_dofs(self, name: str) -> NDArray[np.intp]:
        """Return the global number of each DOF of a substructure; `HELD` or `DEPENDENT` if it has none."""
        return self._numbers[self.plain.substructure_dofs(name)]

    def joint_dofs(self, name: str) -> NDArray[np.intp]:
        """Return the global number of each local DOF of a joint; `HELD` where it does not move."""
        plain = self.plain.joint_dofs(name)
        return self._moved(plain)[0] if self._follow(plain) else self._numbers[plain]

    def terms(self, motion: Sequence[tuple[float, Point]]) -> Sequence[tuple[float, Point]]:
        """Return a weighted sum of DOFs as one of DOFs that have global numbers; of none if it is held."""
        numbers = [int(self.plain.substructure_dofs(name)[dof]) for _, (name, dof) in motion]
        if not any(number in self.dependents for number in numbers):
            return motion
        sums, sizes = dict[int, float](), dict[int, float]()
        for number, (weight, _) in zip(numbers, motion, strict=True):
            for independent, share in self.dependents.get(number, {number: 1.0}).items() if number != HELD else ():
                sums[independent] = sums.get(independent, 0.0) + weight * share
                sizes[independent] = sizes.get(independent, 0.0) + abs(weight * share)
        return [(total, self._owners[at]) for at, total in sums.items() if abs(total) > _ROUNDING * sizes[at]]

    def boundary(self, name: str, dofs: Set[int]) -> Sequence[int]:
        """Return the DOFs to which a substructure is condensed: without those that depend on others in the part itself.

        All DOFs that a part's own constraints connect with those in use are there: any of them may be independent.
        """
        part, rows = self.substructures[name], substructure_constraints(self.substructures[name])
        if not len(rows):
            return sorted(dofs)
        connects, used = rows != 0.0, np.isin(np.arange(part.node_dofs.size), list(dofs))
        for _ in range(len(connects)):
            used |= connects[connects[:, used].any(axis=1)].any(axis=0)
        functions = [dict(enumerate(row.tolist())) for row in rows]
        dependents = _solved(functions, set(np.flatnonzero(part.node_dofs.rotations).tolist()))
        return sorted(set(np.flatnonzero(used).tolist()) - set(dependents))

    def motion(self, name: str, dofs: Sequence[int]) -> tuple[NDArray[np.intp], Any]:
        """Return the global DOFs by which some DOFs of a substructure move, and their motion, as in `Graph`."""
        plain = self.plain.substructure_dofs(name)[list(dofs)]
        return self._moved(plain) if self._follow(plain) else (self._numbers[plain], None)

    def at_leaders(self, name: str, connection: Connection) -> Connection:
        """Return a joint of the plain graph at the DOFs by which its own move; itself if these follow none."""
        plain = self.plain.joint_dofs(name)
        if not self._follow(plain):
            return connection
        kind = FollowingLaw if depends_on_frequency(connection.model) else FollowingJoint
        return replace(connection, model=kind(connection.model, self._moved(plain)[1].toarray()))

    def _follow(self, plain: NDArray[np.intp]) -> bool:
        return bool((self._numbers[plain] == DEPENDENT).any())

    def _moved(self, plain: NDArray[np.intp]) -> tuple[NDArray[np.intp], Any]:
        """Return the global DOFs by which some of the plain graph move, and their motion as a sparse array."""
        rows, columns, weights = list[int](), list[int](), list[float]()
        for row, number in enumerate(plain.tolist()):
            motion = {} if number == HELD else self.dependents.get(number, {number: 1.0})
            rows += [row] * len(motion)
            columns += self._numbers[list(motion)].tolist()
            weights += motion.values()
        numbers, places = np.unique(np.array(columns, dtype=np.intp), return_inverse=True)
        return numbers, scipy.sparse.csr_array((weights, (rows, places)), shape=(len(plain), len(numbers)))


def constrained(plain: Graph) -> Graph:
    """Return a graph with the constraints of its parts and joints; itself if merging DOFs satisfies all of them."""
    functions = [row for name in plain.connections for row in _functions(plain, name)]
    part_functions = [
        row
        for name, part in plain.substructures.items()
        for row in _by_number(substructure_constraints(part), plain.substructure_dofs(name))
    ]
    functions += part_functions
    dependents = _solved(functions, _rotations(plain)) if functions else {}
    if not dependents and not part_functions:
        return plain
    graph = ConstrainedGraph(plain.substructures, plain.connections, plain, dependents)
    moved = {name: graph.at_leaders(name, connection) for name, connection in plain.connections.items()}
    return replace(graph, connections=moved)


def _functions(plain: Graph, name: str) -> list[dict[int, float]]:
    """Return the functions of global DOFs that a joint holds at zero and that are not differences of merged DOFs."""
    connection = plain.connections[name]
    model, contacts = connection.model, connection.rigid
    every = pair_functions(model, contacts=contacts)
    if len(every) == len(model.merged_dofs) + (len(model.contact_dofs) if contacts else 0):
        return []
    return _by_number(every, plain.joint_dofs(name))


def _by_number(rows: NDArray[np.float64], numbers: NDArray[np.intp]) -> list[dict[int, float]]:
    """Return linear functions (n, d) of DOFs with these global numbers, without those that are held."""
    functions = list[dict[int, float]]()
    for row in rows:
        function: dict[int, float] = {}
        for dof in np.flatnonzero(row).tolist():
            number = int(numbers[dof])
            if number != HELD:
                function[number] = function.get(number, 0.0) + float(row[dof])
        functions.append(function)
    return functions


def _rotations(plain: Graph) -> set[int]:
    """Return the global DOFs that are rotations of nodes."""
    found = set[int]()
    for name, part in plain.substructures.items():
        found |= set(plain.substructure_dofs(name)[NodeDofs.from_nodes(part.nodes).rotations].tolist())
    return found


def _solved(functions: Sequence[Mapping[int, float]], rotations: set[int]) -> dict[int, dict[int, float]]:
    """Solve functions that are zero for some DOFs, as combinations of the others.

    Of two with equal coefficients the one with the higher number follows: inner DOFs of joints rather than those of
    parts, at which responses are.

    Returns
    -------
    dict of int to dict of int to float
        The motion of these DOFs by the others.
    """
    numbers = np.array(sorted({number for function in functions for number in function})[::-1], dtype=np.intp)
    if not numbers.size:
        return {}
    rows = np.array([[function.get(number, 0.0) for number in numbers.tolist()] for function in functions])
    turns = np.isin(numbers, list(rotations))
    sizes = np.where(turns, _arm(rows, turns), 1.0)  # rotations become displacements at the longest arm
    rows, pivots = _eliminated(rows / sizes)
    independents = np.setdiff1d(np.arange(len(numbers)), pivots)
    solved = {}
    for row, pivot in zip(rows, pivots, strict=False):
        weights = -row * sizes / sizes[pivot]
        moved = independents[weights[independents] != 0.0]
        solved[int(numbers[pivot])] = dict(zip(numbers[moved].tolist(), weights[moved].tolist(), strict=True))
    return solved


def _eliminated(rows: NDArray[np.float64]) -> tuple[NDArray[np.float64], list[int]]:
    """Return the rows (k, n) after elimination with complete pivoting, with a 1 at the pivot of each of the first."""
    sizes = np.abs(rows).max(axis=1, keepdims=True)
    rows = np.divide(rows, sizes, out=np.zeros_like(rows), where=sizes > _REDUNDANT)
    free, pivots = np.ones(rows.shape[1], dtype=bool), list[int]()
    for step in range(len(rows)):
        left = np.where(free, np.abs(rows[step:]), 0.0)
        row, column = divmod(int(np.argmax(left)), rows.shape[1])
        if left[row, column] <= _REDUNDANT:
            break
        rows[[step, step + row]] = rows[[step + row, step]]
        rows[step] /= rows[step, column]
        others = np.arange(len(rows)) != step
        rows[others] -= np.outer(rows[others, column], rows[step])
        free[column] = False
        pivots.append(column)
    nearest = np.round(rows)
    return np.where(np.abs(rows - nearest) < _ROUNDING, nearest, rows), pivots


def _arm(rows: NDArray[np.float64], turns: NDArray[np.bool_]) -> float:
    """Return the longest way [m] between nodes that functions of displacements bring together; 1 m without any."""
    moved = rows[(rows[:, ~turns] != 0.0).any(axis=1)][:, turns]
    return float(np.abs(moved).max(initial=0.0)) or 1.0
