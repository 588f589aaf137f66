"""The graph of an assembly: substructures, the joints between them, and the DOFs that they share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import NDArray

from dovetail.interfaces import JointModel, NodeDofs, SubstructureModel

HELD = -1
"""Global number of a DOF that does not move."""

Point = tuple[str, int]
"""A DOF: the name of a substructure, and the index of its DOF."""


@dataclass(frozen=True)
class Attachment:
    """A port of a joint on the nodes of a substructure.

    Parameters
    ----------
    substructure : str
    nodes : tuple of int
        Indices of the substructure's nodes, in the port's order.
    """

    substructure: str
    nodes: tuple[int, ...]

    @staticmethod
    def to_all(name: str, part: SubstructureModel) -> tuple[Attachment, ...]:
        """Return an attachment to each node of a substructure that has DOFs of its own."""
        return tuple(Attachment(name, (number,)) for number, node in enumerate(part.nodes) if node.carrier is None)


@dataclass(frozen=True)
class Connection:
    """A joint model and the attachments of its ports, in their order."""

    model: JointModel
    attachments: tuple[Attachment, ...]
    rigid: bool = False


@dataclass(frozen=True)
class Graph:
    """Substructures and the joints that connect them.

    Parameters
    ----------
    substructures : mapping of str to SubstructureModel
    connections : mapping of str to Connection

    Notes
    -----
    DOFs that a joint merges, or holds at the ground, share one global number: compatibility is satisfied by numbering,
    not by large stiffnesses.
    """

    substructures: Mapping[str, SubstructureModel]
    connections: Mapping[str, Connection]

    @cached_property
    def _dofs(self) -> dict[str, NodeDofs]:
        """The DOFs of each substructure's nodes."""
        return {name: NodeDofs.from_nodes(part.nodes) for name, part in self.substructures.items()}

    @cached_property
    def _numbering(self) -> tuple[dict[str, NDArray[np.intp]], dict[str, NDArray[np.intp]], int]:
        first: dict[str, int] = {}
        count = 0
        for name in self.substructures:
            first[name] = count
            count += self._dofs[name].size
        ends = dict(zip(first, [*first.values(), count][1:], strict=True))
        local: dict[str, NDArray[np.intp]] = {}
        for name, connection in self.connections.items():
            attached = [first[part] + dof for part, dofs in self.attached_dofs(name) for dof in dofs]
            internal = range(count, count + connection.model.internal_dofs)
            local[name] = np.array([*attached, *internal], dtype=np.intp)
            count += connection.model.internal_dofs
        number = self._merged(first, ends, local, count)
        substructure_numbers = {name: number[first[name] : ends[name]] for name in self.substructures}
        joint_numbers = {name: number[dofs] for name, dofs in local.items()}
        return substructure_numbers, joint_numbers, int(number.max(initial=HELD)) + 1

    def _merged(
        self, first: dict[str, int], ends: dict[str, int], local: dict[str, NDArray[np.intp]], count: int
    ) -> NDArray[np.intp]:
        """Give one number to each set of merged DOFs."""
        leader = np.arange(count)

        def find(dof: int) -> int:
            while leader[dof] != dof:
                dof = int(leader[dof])
            return dof

        for name, connection in self.connections.items():
            pairs = connection.model.merged_dofs + (connection.model.contact_dofs if connection.rigid else ())
            for pair in pairs:
                low, high = sorted(find(int(local[name][dof])) for dof in pair)
                leader[high] = low
        roots = np.array([find(dof) for dof in range(count)], dtype=np.intp)
        held = {
            int(roots[dof])
            for name, substructure in self.substructures.items()
            if substructure.grounded
            for dof in range(first[name], ends[name])
        }
        free = [root for root in np.unique(roots) if root not in held]
        new = np.full(count, HELD, dtype=np.intp)
        new[free] = np.arange(len(free))
        numbers: NDArray[np.intp] = new[roots]
        return numbers

    @property
    def size(self) -> int:
        """Number of global DOFs."""
        return self._numbering[2]

    def attached_dofs(self, name: str) -> tuple[tuple[str, tuple[int, ...]], ...]:
        """Return the substructure and its DOFs at each port of a joint, node by node.

        Raises
        ------
        ValueError
            A node lacks a direction in which the joint acts.
        """
        connection = self.connections[name]
        pairs = zip(connection.model.ports, connection.attachments, strict=True)
        return tuple(
            (at.substructure, self._dofs[at.substructure].among(at.nodes, port.directions)) for port, at in pairs
        )

    def with_connection(self, name: str, connection: Connection) -> Graph:
        """Return the graph with one more joint, or another one of this name."""
        return Graph(self.substructures, {**self.connections, name: connection})

    def terms(self, motion: Sequence[tuple[float, Point]]) -> Sequence[tuple[float, Point]]:
        """Return a weighted sum of DOFs as one of DOFs that have global numbers; of none if joints hold it."""
        return motion

    def boundary(self, name: str, dofs: Set[int]) -> Sequence[int]:  # noqa: ARG002
        """Return the DOFs to which a substructure is condensed, in their order, if some of its DOFs are in use."""
        return sorted(dofs)

    def motion(self, name: str, dofs: Sequence[int]) -> tuple[NDArray[np.intp], Any]:
        """Return the global DOFs by which some DOFs of a substructure move, and their motion by these.

        Returns
        -------
        numbers : (m,) int array
        motion : (n_dofs, m) sparse array or None
            None if each DOF has a global number, or `HELD`.
        """
        return self.substructure_dofs(name)[list(dofs)], None

    def substructure_dofs(self, name: str) -> NDArray[np.intp]:
        """Return the global number of each DOF of a substructure; `HELD` where it does not move."""
        return self._numbering[0][name]

    def joint_dofs(self, name: str) -> NDArray[np.intp]:
        """Return the global number of each local DOF of a joint; `HELD` where it does not move."""
        return self._numbering[1][name]


def connected_with(some: NDArray[np.bool_], pattern: Any) -> NDArray[np.bool_]:
    """Return which DOFs are connected with some (n,), these included, by a symmetric pattern (n, n) of filled entries.

    Small systems have dense patterns, and need none of SciPy's modules, which take 0.04 s to load.
    """
    if not isinstance(pattern, np.ndarray):
        _, group = scipy.sparse.csgraph.connected_components(pattern, directed=False)
        return np.isin(group, group[some])
    connected, latest = some, some
    while latest.any() and not connected.all():
        latest = pattern[latest].any(axis=0) & ~connected
        connected = connected | latest
    return connected
