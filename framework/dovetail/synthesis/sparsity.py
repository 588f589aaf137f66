"""Which entries of the joints' matrices and of their derivatives are filled: what an elimination is planned for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import StructuralMatrices
from dovetail.interfaces.matrices import refusing_complex_values
from dovetail.synthesis.codegen.layout import MATRICES
from dovetail.synthesis.graph import Graph
from dovetail.synthesis.joint_evaluation import (
    Theta,
    depends_on_frequency,
    joint_jacobian,
    joint_matrices,
    joint_stiffness,
    joint_stiffness_jacobian,
)

__all__ = [
    "JointSparsity",
    "Sparsity",
    "UnplannedEntries",
    "filled_by_matrix",
    "filled_entries",
    "probe_derivatives",
    "probe_matrices",
]


@dataclass(frozen=True, eq=False)
class JointSparsity:
    """Entries of one joint that some parameter vector fills.

    Parameters
    ----------
    matrices : (n_matrices, d, d) bool array
        K, D, C and M as in `MATRICES`; the dynamic stiffness alone where a joint depends on frequency.
    derivatives : (n_params, n_matrices, d, d) bool array
    """

    matrices: NDArray[np.bool_]
    derivatives: NDArray[np.bool_]

    @property
    def filled(self) -> NDArray[np.bool_]:
        """Entries of the joint's dynamic stiffness or of a derivative, (d, d)."""
        filled: NDArray[np.bool_] = np.asarray(np.concatenate([self.matrices, *self.derivatives]).any(axis=0))
        return filled

    def covers(self, other: JointSparsity) -> bool:
        """Return whether all entries of the other are entries of this one."""
        return bool((self.matrices >= other.matrices).all() and (self.derivatives >= other.derivatives).all())

    def __or__(self, other: JointSparsity) -> JointSparsity:
        return JointSparsity(self.matrices | other.matrices, self.derivatives | other.derivatives)

    def with_matrices(self, matrices: NDArray[np.bool_]) -> JointSparsity:
        """Return the same with other entries of the matrices."""
        return replace(self, matrices=matrices)

    def with_derivatives(self, columns: Sequence[int], entries: NDArray[np.bool_]) -> JointSparsity:
        """Return the same with other entries (n_columns, n_matrices, d, d) of the derivatives by some parameters."""
        derivatives = self.derivatives.copy()
        derivatives[list(columns)] = entries
        return replace(self, derivatives=derivatives)


Sparsity = Mapping[str, JointSparsity]
"""Of each joint, by its name."""


class UnplannedEntries(Exception):  # noqa: N818 (a reason to plan anew, not an error)
    """Parameter vectors fill entries for which the elimination is not planned.

    Parameters
    ----------
    sparsity : Sparsity
        What they fill, of the joints concerned.
    """

    def __init__(self, sparsity: Sparsity) -> None:
        super().__init__()
        self.sparsity = sparsity


def filled_entries(values: NDArray[np.generic]) -> NDArray[np.bool_]:
    """Return the entries of (..., d, d) arrays that are not zero everywhere, (d, d)."""
    filled: NDArray[np.bool_] = (values != 0).any(axis=tuple(range(values.ndim - 2)))
    return filled


def filled_by_matrix(*sets: StructuralMatrices) -> NDArray[np.bool_]:
    """Return the entries of K, D, C and M, sets of (n, d, d) arrays, that any sample fills, (n_sets, 4, d, d)."""
    arrays = [getattr(matrices, matrix) for matrices in sets for matrix in MATRICES]
    nonzero = [(values if values.strides[0] else values[:1]) != 0 for values in arrays]
    starts = np.cumsum([0, *map(len, nonzero[:-1])])
    filled: NDArray[np.bool_] = np.logical_or.reduceat(np.concatenate(nonzero), starts, axis=0)
    return filled.reshape(len(sets), len(MATRICES), *filled.shape[1:])


def probe_matrices(graph: Graph, frequency: NDArray[np.float64], theta: Theta) -> dict[str, JointSparsity]:
    """Return what some parameter vectors fill, without derivatives.

    Parameters
    ----------
    graph : Graph
    frequency : (n_freq,) array
        Hz; a joint that depends on frequency is tried at the first, the middle and the last line.
    theta : mapping of str to (n, n_params) array
    """
    sparsity = {}
    for name, connection in graph.connections.items():
        model = connection.model
        with refusing_complex_values():
            if depends_on_frequency(model):
                stiffness = joint_stiffness(name, model, _few_lines(frequency), theta[name])
                matrices = filled_entries(stiffness)[np.newaxis]
            else:
                matrices = filled_by_matrix(joint_matrices(name, model, theta[name]))[0]
        none = np.zeros((len(model.parameters), *matrices.shape), dtype=np.bool_)
        sparsity[name] = JointSparsity(matrices, none)
    return sparsity


def probe_derivatives(
    graph: Graph, frequency: NDArray[np.float64], theta: Theta, columns: Mapping[str, list[int]]
) -> dict[str, NDArray[np.bool_]]:
    """Return what some parameter vectors fill of the derivatives by some columns of each joint's theta.

    Returns
    -------
    dict of str to (n_params, n_matrices, d, d) bool array
    """
    derivatives = {}
    for name in (name for name in graph.connections if columns[name]):
        model = graph.connections[name].model
        if depends_on_frequency(model):
            lines = _few_lines(frequency)
            spectral = [filled_entries(dZ) for dZ in joint_stiffness_jacobian(name, model, lines, theta[name])]
            entries = np.stack(spectral)[:, np.newaxis]
        else:
            entries = filled_by_matrix(*joint_jacobian(name, model, theta[name]))
        wanted = np.isin(np.arange(len(entries)), columns[name])
        derivatives[name] = entries & wanted[:, np.newaxis, np.newaxis, np.newaxis]
    return derivatives


def _few_lines(frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    return frequency[[0, len(frequency) // 2, -1]]
