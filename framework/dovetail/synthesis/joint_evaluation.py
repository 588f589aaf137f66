"""A joint model's matrices, its dynamic stiffness and the derivatives of both: checked, and which entries they fill."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import PluginError
from dovetail.interfaces import JointModel, StructuralMatrices, plugin_errors
from dovetail.interfaces.matrices import refusing_complex_values
from dovetail.synthesis.codegen.layout import MATRICES
from dovetail.synthesis.graph import Graph

__all__ = [
    "JointSparsity",
    "Sparsity",
    "Theta",
    "UnplannedEntries",
    "depends_on_frequency",
    "filled_by_matrix",
    "filled_entries",
    "joint_jacobian",
    "joint_matrices",
    "joint_stiffness",
    "joint_stiffness_jacobian",
    "probe_derivatives",
    "probe_matrices",
    "sample_count",
]

Theta = Mapping[str, NDArray[np.float64]]
"""All parameters of each joint, (n, n_params), by the joint's name."""

_ASYMMETRY = 1e-9
"""Difference of an entry from its mirror image that counts as rounding, relative to both and to their diagonal."""


def sample_count(theta: Theta) -> int:
    """Return the number n of parameter vectors; one for an assembly without joints."""
    return len(next(iter(theta.values()))) if theta else 1


def joint_matrices(name: str, model: JointModel, theta: NDArray[np.float64]) -> StructuralMatrices:
    """Return a joint's matrices for parameter vectors (n, n_params).

    Raises
    ------
    PluginError
        The model fails, or returns something else than finite and symmetric (n, d, d) matrices.
    """
    label = _label(name, model)
    with plugin_errors(model, label):
        matrices = model.matrices(theta)
        _check_matrices(label, model, [matrices], len(theta))
        for matrix in MATRICES:
            _check_symmetry(label, f"a matrix {matrix}", getattr(matrices, matrix))
    return matrices


def joint_jacobian(name: str, model: JointModel, theta: NDArray[np.float64]) -> Sequence[StructuralMatrices]:
    """Return the derivatives of a joint's matrices by each of its parameters, for (n, n_params) vectors.

    Raises
    ------
    PluginError
        The model fails, or returns something else than one set of finite (n, d, d) matrices a parameter.
    """
    label = _label(name, model)
    with plugin_errors(model, label):
        derivatives = tuple(model.matrices_jacobian(theta))
        if len(derivatives) != len(model.parameters):
            problem = f"{label} returns {len(derivatives)} derivatives of its matrices"
            raise PluginError(f"{problem}, not one for each of its {len(model.parameters)} parameters.")
        _check_matrices(label, model, derivatives, len(theta))
    return derivatives


def joint_stiffness(
    name: str, model: JointModel, frequency: NDArray[np.float64], theta: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Return a joint's dynamic stiffness (n, n_freq, d, d) for parameter vectors (n, n_params).

    Raises
    ------
    PluginError
        The model fails, or returns something else than finite numbers of this shape, symmetric at each line.
    """
    label = _label(name, model)
    with plugin_errors(model, label):
        stiffness = np.asarray(model.dynamic_stiffness(frequency, theta), dtype=np.complex128)
        _check_stiffness(label, model, stiffness, (len(theta), len(frequency)))
        _check_symmetry(label, "a dynamic stiffness", stiffness)
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
    with plugin_errors(model, label):
        derivatives = iter(model.dynamic_stiffness_jacobian(frequency, theta))
    while True:
        with plugin_errors(model, label):
            derivative = next(derivatives, None)
            if derivative is None:
                break
            derivative = np.asarray(derivative, dtype=np.complex128)
            _check_stiffness(label, model, derivative, shape)
        count += 1
        yield derivative
    if count != len(model.parameters):
        problem = f"{label} returns {count} derivatives of its dynamic stiffness"
        with plugin_errors(model, label):
            raise PluginError(f"{problem}, not one for each of its {len(model.parameters)} parameters.")


def _check_stiffness(label: str, model: JointModel, stiffness: NDArray[np.complex128], count: tuple[int, int]) -> None:
    wanted = (*count, model.size, model.size)
    if stiffness.shape != wanted:
        raise PluginError(f"{label} returns a dynamic stiffness of shape {stiffness.shape}, not {wanted}.")
    if not np.isfinite(stiffness).all():
        raise PluginError(f"{label} returns a dynamic stiffness that is not finite.")


def _label(name: str, model: JointModel) -> str:
    return f"joint '{name}' ({model.name})"


def _check_matrices(label: str, model: JointModel, sets: Sequence[StructuralMatrices], count: int) -> None:
    wanted = (count, model.size, model.size)
    for matrices in sets:
        if not isinstance(matrices, StructuralMatrices):
            raise PluginError(f"{label} returns {type(matrices).__name__}, not StructuralMatrices.")
        if matrices.K.shape != wanted:
            raise PluginError(f"{label} returns matrices of shape {matrices.K.shape}, not {wanted}.")
    arrays = _without_repetition(sets)
    if not arrays or np.isfinite(np.concatenate(arrays)).all():
        return
    at_fault = next(index for index, values in enumerate(arrays) if not np.isfinite(values).all())
    raise PluginError(f"{label} returns a matrix {MATRICES[at_fault % len(MATRICES)]} that is not finite.")


def _check_symmetry(label: str, noun: str, values: NDArray[Any]) -> None:
    """Refuse entries that differ from their mirror image by more than rounding, on the scale of the diagonal."""
    mirrored = np.swapaxes(values, -1, -2)
    if np.array_equal(values, mirrored):
        return
    diagonal = np.sqrt(np.abs(np.diagonal(values, axis1=-2, axis2=-1)))
    scale = diagonal[..., :, np.newaxis] * diagonal[..., np.newaxis, :] + np.abs(values) + np.abs(mirrored)
    if (np.abs(values - mirrored) > _ASYMMETRY * scale).any():
        raise PluginError(f"{label} returns {noun} that is not symmetric.")


def depends_on_frequency(model: JointModel) -> bool:
    """Return whether a joint gives its dynamic stiffness itself, in place of M, K, C and D."""
    return type(model).dynamic_stiffness is not JointModel.dynamic_stiffness


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
    arrays = _without_repetition(sets)
    filled: NDArray[np.bool_]
    if max(map(len, arrays)) == 1:
        filled = np.concatenate(arrays) != 0
    else:
        filled = np.array([(values != 0).any(axis=0) for values in arrays])
    return filled.reshape(len(sets), len(MATRICES), *filled.shape[1:])


def _without_repetition(sets: Sequence[StructuralMatrices]) -> list[NDArray[np.float64]]:
    """Return the matrices of each set, (n, d, d), or (1, d, d) where all samples share one."""
    arrays = [getattr(matrices, matrix) for matrices in sets for matrix in MATRICES]
    return [values if len(values) < 2 or values.strides[0] else values[:1] for values in arrays]


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
