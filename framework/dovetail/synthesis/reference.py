"""Reference methods against which the engine is tested: direct solution of the whole assembly, and literal FDSS."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.interfaces import SparseMatrices, StructuralMatrices, plugin_errors
from dovetail.synthesis.condensation import substructure_matrices
from dovetail.synthesis.graph import HELD, Graph
from dovetail.synthesis.joint_evaluation import depends_on_frequency, joint_matrices

_CANCELLED = 1e-15
"""Sum, over the size of its terms, below which it is rounding, as for stiffness between DOFs that a joint merges."""

_Component = tuple[StructuralMatrices | SparseMatrices, NDArray[np.intp]]
"""Matrices and the global number of each of their DOFs; `HELD` where it does not move."""


def assembly_matrices(
    graph: Graph, theta: Mapping[str, NDArray[np.float64]] | None
) -> StructuralMatrices | SparseMatrices:
    """Assemble the matrices of all global DOFs; the inner DOFs of substructures follow those of the graph.

    Parameters
    ----------
    graph : Graph
    theta : mapping of str to (n_params,) array, or None
        All parameters of each joint, by the joint's name. None leaves the joints out.

    Returns
    -------
    StructuralMatrices or SparseMatrices
        (d, d); sparse if those of a substructure are.

    Raises
    ------
    DovetailError
        A substructure is known by its FRFs only, or a joint depends on frequency other than through matrices.
    """
    components, count = _substructures(graph)
    for name, connection in graph.connections.items():
        if theta is None:
            continue
        if depends_on_frequency(connection.model):
            raise DovetailError(f"joint '{name}' depends on frequency, so the assembly has no matrices.")
        batch = joint_matrices(name, connection.model, theta[name][None, :]).sets[0]
        single = StructuralMatrices(batch.M[0], batch.K[0], batch.C[0], batch.D[0])
        components.append((single, graph.joint_dofs(name)))
    whole = SparseMatrices(*(_sum(name, components, count) for name in ("M", "K", "C", "D")))
    if any(isinstance(matrices, SparseMatrices) for matrices, _ in components):
        return whole
    return StructuralMatrices(*(matrix.toarray() for matrix in (whole.M, whole.K, whole.C, whole.D)))


def _substructures(graph: Graph) -> tuple[list[_Component], int]:
    """Return the substructures' matrices with their global numbers, and the number of DOFs including inner ones."""
    components: list[_Component] = []
    count = graph.size
    for name, substructure in graph.substructures.items():
        with plugin_errors(substructure, f"substructure '{name}' ({substructure.name})"):
            matrices = substructure_matrices(substructure)
        if matrices is None:
            raise DovetailError(f"substructure '{name}' has no matrices, so the assembly has none either.")
        dofs = len(graph.substructure_dofs(name))
        outer, motion = graph.motion(name, range(dofs))
        inner = np.full(matrices.size - dofs, HELD, dtype=np.intp)
        if not substructure.grounded:
            inner = np.arange(count, count + len(inner))
            count += len(inner)
        moved = matrices if motion is None else _moved_by(matrices, motion)
        components.append((moved, np.concatenate([outer, inner])))
    return components, count


def _moved_by(matrices: StructuralMatrices | SparseMatrices, motion: Any) -> StructuralMatrices | SparseMatrices:
    """Return the matrices for coordinates by which the nodes' DOFs move as `motion`, a sparse array (n, m)."""
    L = scipy.sparse.block_diag([motion, scipy.sparse.eye_array(matrices.size - motion.shape[0])], "csr")
    products = (L.T @ getattr(matrices, name) @ L for name in "MKCD")
    return type(matrices)(*((product + product.T) / 2.0 for product in products))


def _sum(name: str, components: Sequence[_Component], count: int) -> Any:
    """Sum each component's entries first, so that those between merged DOFs cancel without rounding elsewhere."""
    total = sum(
        (_summed(name, *component, count) for component in components), scipy.sparse.coo_array((count, count)).tocsr()
    )
    return total.tocoo()


def _summed(name: str, matrices: StructuralMatrices | SparseMatrices, numbers: NDArray[np.intp], count: int) -> Any:
    entries = scipy.sparse.coo_array(getattr(matrices, name))
    where = numbers[entries.row], numbers[entries.col]
    moving = (where[0] != HELD) & (where[1] != HELD)
    where, terms = (where[0][moving], where[1][moving]), entries.data[moving]
    summed, size = (
        scipy.sparse.coo_array((values, where), shape=(count, count)).tocsr() for values in (terms, abs(terms))
    )
    summed.data[abs(summed.data) <= _CANCELLED * size.data] = 0.0
    return summed


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
    MKCD = (matrices.M, matrices.K, matrices.C, matrices.D)
    active = np.flatnonzero(sum(abs(matrix).sum(axis=0) for matrix in MKCD))
    index = {int(dof): position for position, dof in enumerate(active)}
    loads = np.zeros((len(active), len(inputs)), dtype=np.complex128)
    for column, dof in enumerate(inputs):
        loads[index[dof], column] = 1.0
    rows = [index[dof] for dof in outputs]
    if isinstance(matrices, SparseMatrices):
        sparse = SparseMatrices(*(matrix[active][:, active] for matrix in MKCD))
        return np.stack(
            [scipy.sparse.linalg.splu(sparse.dynamic_stiffness(float(line))).solve(loads)[rows] for line in frequency]
        )
    dense = StructuralMatrices(*(matrix[np.ix_(active, active)] for matrix in MKCD))
    return np.stack([np.linalg.solve(dense.dynamic_stiffness(line)[0], loads)[rows] for line in frequency[:, None]])


class LiteralSynthesis:
    """Drive-point receptance H_rr - H_rb (H_bb + H_J)^-1 H_br, with the substructures' receptances computed once.

    This is FDSS as in Eqs. 4-7 of Processes 14 (2026) 1875, doi:10.3390/pr14121875.

    Parameters
    ----------
    graph : Graph
        Without merged or held DOFs, with each interface DOF in a single joint, and with inertia in every joint, so that
        its receptance exists.
    frequency : (n_freq,) array
        Hz.
    substructure, dof : str and int
        The DOF of the response.
    """

    def __init__(self, graph: Graph, frequency: NDArray[np.float64], substructure: str, dof: int) -> None:
        self._graph = graph
        self._frequency = frequency
        ports = [port for name in graph.connections for port in graph.attached_dofs(name)]
        interface = [(part, number) for part, dofs in ports for number in dofs]
        size = len(interface)
        self._H_bb = np.zeros((len(frequency), size, size), dtype=np.complex128)
        self._H_br = np.zeros((len(frequency), size, 1), dtype=np.complex128)
        self._H_rr = np.zeros(len(frequency), dtype=np.complex128)
        for name, model in graph.substructures.items():
            rows = [index for index, (owner, _) in enumerate(interface) if owner == name]
            dofs = [interface[index][1] for index in rows]
            receptance = model.receptance(frequency, [*dofs, dof] if name == substructure else dofs)
            self._H_bb[:, np.array(rows)[:, None], rows] = receptance[:, : len(dofs), : len(dofs)]
            if name == substructure:
                self._H_br[:, rows, 0] = receptance[:, : len(dofs), -1]
                self._H_rr = receptance[:, -1, -1]

    def receptance(self, theta: Mapping[str, NDArray[np.float64]]) -> NDArray[np.complex128]:
        """Return the drive-point receptance (n_freq,) for one parameter vector of each joint."""
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
