"""The whole assembly at once: its matrices, and the direct solve that every other route is tested against."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.interfaces import StructuralMatrices, blamed_on
from dovetail.synthesis.graph import Graph
from dovetail.synthesis.system import depends_on_frequency, joint_matrices

__all__ = ["assembly_matrices", "direct_receptance"]


def assembly_matrices(graph: Graph, theta: Mapping[str, NDArray[np.float64]]) -> StructuralMatrices:
    """Assemble the matrices of all parts over the global DOFs.

    Parameters
    ----------
    graph : Graph
    theta : mapping of str to (n_params,) array
        All parameters of each joint, by the joint's name.

    Returns
    -------
    StructuralMatrices
        Of (d, d) arrays, d the number of global DOFs.

    Raises
    ------
    DovetailError
        A substructure is known by its FRFs only, or a joint depends on frequency otherwise than through matrices.
    """
    whole = StructuralMatrices.zeros(graph.size)
    for name, substructure in graph.substructures.items():
        with blamed_on(substructure, f"substructure '{name}' ({substructure.name})"):
            matrices = substructure.matrices()
        if matrices is None:
            raise DovetailError(f"substructure '{name}' has no matrices, so the assembly has none either.")
        _add(whole, matrices, graph.substructure_dofs(name))
    for name, connection in graph.connections.items():
        if depends_on_frequency(connection.model):
            raise DovetailError(f"joint '{name}' depends on frequency, so the assembly has no matrices.")
        batch = joint_matrices(name, connection.model, theta[name][None, :])
        single = StructuralMatrices(batch.M[0], batch.K[0], batch.C[0], batch.D[0])
        _add(whole, single, graph.joint_dofs(name))
    return whole


def _add(whole: StructuralMatrices, part: StructuralMatrices, numbers: NDArray[np.intp]) -> None:
    moving = np.flatnonzero(numbers >= 0)
    rows, columns = np.meshgrid(numbers[moving], numbers[moving], indexing="ij")
    for target, source in ((whole.M, part.M), (whole.K, part.K), (whole.C, part.C), (whole.D, part.D)):
        np.add.at(target, (rows, columns), source[np.ix_(moving, moving)])


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
    entries = abs(matrices.M) + abs(matrices.K) + abs(matrices.C) + abs(matrices.D)
    active = np.flatnonzero(entries.any(axis=0))
    place = {int(dof): index for index, dof in enumerate(active)}
    loads = np.zeros((len(active), len(inputs)))
    for column, dof in enumerate(inputs):
        loads[place[dof], column] = 1.0
    rows = [place[dof] for dof in outputs]
    reduced = StructuralMatrices(
        *(matrix[np.ix_(active, active)] for matrix in (matrices.M, matrices.K, matrices.C, matrices.D))
    )
    solved = [
        np.linalg.solve(reduced.dynamic_stiffness(frequency[line : line + 1])[0], loads)[rows]
        for line in range(len(frequency))
    ]
    return np.stack(solved)
