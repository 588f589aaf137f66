"""The whole assembly at once: its matrices, and the direct solve that every other route is tested against."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array

from dovetail.errors import DovetailError
from dovetail.interfaces import SparseMatrices, StructuralMatrices, blamed_on
from dovetail.synthesis.condensation import substructure_matrices
from dovetail.synthesis.graph import HELD, Graph
from dovetail.synthesis.joint_evaluation import depends_on_frequency, joint_matrices

__all__ = ["LiteralSynthesis", "assembly_matrices", "direct_receptance"]

_Part = tuple[StructuralMatrices | SparseMatrices, NDArray[np.intp]]
"""Matrices and the global number of each of their DOFs; `HELD` where it does not move."""


def assembly_matrices(graph: Graph, theta: Mapping[str, NDArray[np.float64]]) -> StructuralMatrices | SparseMatrices:
    """Assemble the matrices of all parts over the global DOFs, inner DOFs of substructures after those of the graph.

    Parameters
    ----------
    graph : Graph
    theta : mapping of str to (n_params,) array
        All parameters of each joint, by the joint's name.

    Returns
    -------
    StructuralMatrices or SparseMatrices
        (d, d); sparse where a substructure's are.

    Raises
    ------
    DovetailError
        A substructure is known by its FRFs only, or a joint depends on frequency otherwise than through matrices.
    """
    parts, count = _substructures(graph)
    for name, connection in graph.connections.items():
        if depends_on_frequency(connection.model):
            raise DovetailError(f"joint '{name}' depends on frequency, so the assembly has no matrices.")
        batch = joint_matrices(name, connection.model, theta[name][None, :])
        single = StructuralMatrices(batch.M[0], batch.K[0], batch.C[0], batch.D[0])
        parts.append((single, graph.joint_dofs(name)))
    whole = SparseMatrices(*(_sum(name, parts, count) for name in ("M", "K", "C", "D")))
    if any(isinstance(matrices, SparseMatrices) for matrices, _ in parts):
        return whole
    return StructuralMatrices(*(matrix.toarray() for matrix in (whole.M, whole.K, whole.C, whole.D)))


def _substructures(graph: Graph) -> tuple[list[_Part], int]:
    """Return the substructures' matrices with their global numbers, and the number of DOFs with the inner ones."""
    parts: list[_Part] = []
    count = graph.size
    for name, substructure in graph.substructures.items():
        with blamed_on(substructure, f"substructure '{name}' ({substructure.name})"):
            matrices = substructure_matrices(substructure)
        if matrices is None:
            raise DovetailError(f"substructure '{name}' has no matrices, so the assembly has none either.")
        own = graph.substructure_dofs(name)
        inner = np.full(matrices.size - len(own), HELD, dtype=np.intp)
        if not substructure.grounded:
            inner = np.arange(count, count + len(inner))
            count += len(inner)
        parts.append((matrices, np.concatenate([own, inner])))
    return parts, count


def _sum(name: str, parts: Sequence[_Part], count: int) -> Any:
    rows, columns, values = [], [], []
    for matrices, numbers in parts:
        entries = coo_array(getattr(matrices, name))
        row, column = numbers[entries.row], numbers[entries.col]
        moving = (row != HELD) & (column != HELD)
        rows.append(row[moving])
        columns.append(column[moving])
        values.append(entries.data[moving])
    places = (np.concatenate(rows), np.concatenate(columns))
    return coo_array((np.concatenate(values), places), shape=(count, count))


def direct_receptance(
    graph: Graph,
    frequency: NDArray[np.float64],
    theta: Mapping[str, NDArray[np.float64]],
    outputs: Sequence[int],
    inputs: Sequence[int],
) -> NDArray[np.complex128]:
    """Solve the whole assembly at each frequency.

    Parameters
    ----------
    graph : Graph
    frequency : (n_freq,) array
        Hz.
    theta : mapping of str to (n_params,) array
    outputs, inputs : sequences of int
        Global DOFs.

    Returns
    -------
    (n_freq, n_out, n_in) complex array
    """
    matrices = assembly_matrices(graph, theta)
    parts = (matrices.M, matrices.K, matrices.C, matrices.D)
    active = np.flatnonzero(sum(abs(part).sum(axis=0) for part in parts))
    place = {int(dof): index for index, dof in enumerate(active)}
    loads = np.zeros((len(active), len(inputs)))
    for column, dof in enumerate(inputs):
        loads[place[dof], column] = 1.0
    rows = [place[dof] for dof in outputs]
    if isinstance(matrices, SparseMatrices):
        sparse = SparseMatrices(*(part[active][:, active] for part in parts))
        return np.stack([_solved(sparse, float(line), loads)[rows] for line in frequency])
    reduced = StructuralMatrices(*(part[np.ix_(active, active)] for part in parts))
    solved = [
        np.linalg.solve(reduced.dynamic_stiffness(frequency[line : line + 1])[0], loads)[rows]
        for line in range(len(frequency))
    ]
    return np.stack(solved)


def _solved(matrices: SparseMatrices, frequency: float, loads: NDArray[np.float64]) -> NDArray[np.complex128]:
    from scipy.sparse.linalg import splu

    motion: NDArray[np.complex128] = splu(matrices.dynamic_stiffness(frequency)).solve(loads.astype(np.complex128))
    return motion


class LiteralSynthesis:
    """Drive-point receptance H_rr - H_rb (H_bb + H_J)^-1 H_br; the substructures' receptances are computed once.

    Parameters
    ----------
    graph : Graph
        Without merged or held DOFs, each interface DOF in one joint only, and every joint with inertia of its own
        (its receptance must exist).
    frequency : (n_freq,) array
        Hz.
    substructure, dof : str and int
        Where the response is.
    """

    def __init__(self, graph: Graph, frequency: NDArray[np.float64], substructure: str, dof: int) -> None:
        self._graph = graph
        self._frequency = frequency
        interface = [
            (port.substructure, number) for c in graph.connections.values() for port in c.attachments
            for number in port.dofs
        ]  # fmt: skip
        size = len(interface)
        self._H_bb = np.zeros((len(frequency), size, size), dtype=np.complex128)
        self._H_br = np.zeros((len(frequency), size, 1), dtype=np.complex128)
        self._H_rr = np.zeros(len(frequency), dtype=np.complex128)
        for name, part in graph.substructures.items():
            here = [index for index, (owner, _) in enumerate(interface) if owner == name]
            dofs = [interface[index][1] for index in here]
            receptance = part.receptance(frequency, [*dofs, dof] if name == substructure else dofs)
            self._H_bb[:, np.array(here)[:, None], here] = receptance[:, : len(dofs), : len(dofs)]
            if name == substructure:
                self._H_br[:, here, 0] = receptance[:, : len(dofs), -1]
                self._H_rr = receptance[:, -1, -1]

    def receptance(self, theta: Mapping[str, NDArray[np.float64]]) -> NDArray[np.complex128]:
        """Return the (n_freq,) drive-point receptance for one vector of all parameters of each joint."""
        H = self._H_bb.copy()
        first = 0
        for name, connection in self._graph.connections.items():
            ports = connection.model.size - connection.model.internal_dofs
            Z = connection.model.dynamic_stiffness(self._frequency, theta[name][None, :])[0]
            H[:, first : first + ports, first : first + ports] += np.linalg.inv(Z)[:, :ports, :ports]
            first += ports
        correction = np.swapaxes(self._H_br, 1, 2) @ np.linalg.solve(H, self._H_br)
        result: NDArray[np.complex128] = self._H_rr - correction[:, 0, 0]
        return result
