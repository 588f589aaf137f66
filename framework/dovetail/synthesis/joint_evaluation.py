"""Checked matrices, dynamic stiffness and derivatives of a joint model, and which of their entries are filled."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import PluginError
from dovetail.interfaces import JointModel, StructuralMatrices, Superposition, plugin_errors
from dovetail.interfaces.matrices import refusing_complex_values
from dovetail.synthesis.codegen.layout import MATRICES
from dovetail.synthesis.graph import Graph

Theta = Mapping[str, NDArray[np.float64]]
"""All parameters of each joint, (n, n_params), by the joint's name."""

_LATEST: WeakKeyDictionary[JointModel, tuple[bytes, NDArray[np.bool_]]] = WeakKeyDictionary()
"""The entries that each joint's matrices filled latest, and the parameter vectors."""
_ASYMMETRY = 1e-9
"""Difference of two mirrored entries that counts as rounding, relative to both and to their diagonal."""


class MatrixRows:
    """K, D, C and M of one or several sets, each with a row for every sample or one row for all samples.

    Parameters
    ----------
    sets : sequence of StructuralMatrices
        One or more, of (n, d, d) arrays.

    Attributes
    ----------
    sets : sequence of StructuralMatrices
    values : (n_rows, d, d) array
    """

    def __init__(self, sets: Sequence[StructuralMatrices]) -> None:
        self.sets = sets
        arrays = [_without_repetition(getattr(matrices, name)) for matrices in sets for name in MATRICES]
        self.values: NDArray[np.float64] = np.concatenate(arrays)
        self._lengths = np.array([len(array) for array in arrays])

    @property
    def filled(self) -> NDArray[np.bool_]:
        """Entries (n_sets, 4, d, d) that are not zero for all samples."""
        filled: NDArray[np.bool_] = self.values != 0
        if len(filled) > len(self._lengths):
            filled = np.array([rows.any(axis=0) for rows in np.split(filled, np.cumsum(self._lengths)[:-1])])
        return filled.reshape(len(self.sets), len(MATRICES), *filled.shape[1:])

    def at(self, matrices: NDArray[np.intp], entries: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return some entries of all samples.

        Parameters
        ----------
        matrices : (n_entries,) array of int
            The matrix of each entry: four times the index of its set, plus that of the matrix among K, D, C and M.
        entries : (n_entries,) array of int
            Index in the matrix, row by row.

        Returns
        -------
        (n_entries, n) array
            (n_entries, 1) if all samples share all matrices.
        """
        lengths, flat = self._lengths, self.values.reshape(len(self.values), -1)
        if (lengths == lengths[0]).all():
            return np.asarray(flat.reshape(len(lengths), lengths[0], -1)[matrices, :, entries])
        first, varies = (np.cumsum(lengths) - lengths)[matrices], lengths[matrices] > 1
        rows = first[:, np.newaxis] + varies[:, np.newaxis] * np.arange(lengths.max())
        return np.asarray(flat[rows, entries[:, np.newaxis]])


def _without_repetition(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return matrices (n, d, d), or a single one (1, d, d) if all samples share it."""
    return values if len(values) < 2 or values.strides[0] else values[:1]


def sample_count(theta: Theta) -> int:
    """Return the number n of parameter vectors; one for an assembly without joints."""
    return len(next(iter(theta.values()))) if theta else 1


def joint_matrices(name: str, model: JointModel, theta: NDArray[np.float64]) -> MatrixRows:
    """Return a joint's matrices for parameter vectors (n, n_params), as a single set.

    Raises
    ------
    PluginError
        The model fails, or returns anything other than finite and symmetric (n, d, d) matrices.
    """
    label = _label(name, model)
    with plugin_errors(model, label):
        rows = _checked_rows(label, model, [model.matrices(theta)], len(theta))
        if not np.array_equal(rows.values, np.swapaxes(rows.values, -1, -2)):
            for matrix in MATRICES:
                _check_symmetry(label, f"a matrix {matrix}", getattr(rows.sets[0], matrix))
    return rows


def joint_jacobian(name: str, model: JointModel, theta: NDArray[np.float64]) -> MatrixRows:
    """Return the derivatives of a joint's matrices for vectors (n, n_params), as a set for each parameter.

    Raises
    ------
    PluginError
        The model fails, or returns anything other than a set of finite (n, d, d) matrices for each parameter.
    """
    label = _label(name, model)
    with plugin_errors(model, label):
        derivatives = tuple(model.matrices_jacobian(theta))
        if len(derivatives) != len(model.parameters):
            problem = f"{label} returns {len(derivatives)} derivatives of its matrices"
            raise PluginError(f"{problem}, not one for each of its {len(model.parameters)} parameters.")
        return _checked_rows(label, model, derivatives, len(theta))


def superposition(name: str, model: JointModel) -> Superposition | None:
    """Return a joint's matrices as a superposition, verified; None if its model does not declare it.

    Raises
    ------
    PluginError
        The model fails, or one of its declarations is not true.
    """
    if depends_on_frequency(model):
        return None
    with plugin_errors(model, _label(name, model)), refusing_complex_values():
        return model.superposition


def joint_stiffness(
    name: str, model: JointModel, frequency: NDArray[np.float64], theta: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Return a joint's dynamic stiffness (n, n_freq, d, d) for parameter vectors (n, n_params).

    Raises
    ------
    PluginError
        The model fails, or returns anything other than finite numbers of this shape, symmetric at each line.
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
        The model fails, or returns anything other than an array of finite numbers of this shape for each parameter.
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
    return f"{model.kind} '{name}' ({model.name})"  # a substructure with unknown options is evaluated as a joint is


def _checked_rows(label: str, model: JointModel, sets: Sequence[StructuralMatrices], count: int) -> MatrixRows:
    """Check that sets of matrices are finite and have the right shape, and return them."""
    wanted = (count, model.size, model.size)
    for matrices in sets:
        if not isinstance(matrices, StructuralMatrices):
            raise PluginError(f"{label} returns {type(matrices).__name__}, not StructuralMatrices.")
        if matrices.K.shape != wanted:
            raise PluginError(f"{label} returns matrices of shape {matrices.K.shape}, not {wanted}.")
    rows = MatrixRows(sets)
    if not np.isfinite(rows.values).all():
        at_fault = next(name for each in sets for name in MATRICES if not np.isfinite(getattr(each, name)).all())
        raise PluginError(f"{label} returns a matrix {at_fault} that is not finite.")
    return rows


def _check_symmetry(label: str, noun: str, values: NDArray[Any]) -> None:
    """Refuse mirrored entries that differ by more than rounding, on the scale of the diagonal."""
    mirrored = np.swapaxes(values, -1, -2)
    if np.array_equal(values, mirrored):
        return
    diagonal = np.sqrt(np.abs(np.diagonal(values, axis1=-2, axis2=-1)))
    scale = diagonal[..., :, np.newaxis] * diagonal[..., np.newaxis, :] + np.abs(values) + np.abs(mirrored)
    if (np.abs(values - mirrored) > _ASYMMETRY * scale).any():
        raise PluginError(f"{label} returns {noun} that is not symmetric.")


def depends_on_frequency(model: JointModel) -> bool:
    """Return whether a joint provides its dynamic stiffness itself, instead of M, K, C and D."""
    return type(model).dynamic_stiffness is not JointModel.dynamic_stiffness


@dataclass(frozen=True, eq=False)
class JointSparsity:
    """Entries of one joint that are filled for some parameter vector.

    Parameters
    ----------
    matrices : (n_matrices, d, d) bool array
        K, D, C and M as in `MATRICES`; only the dynamic stiffness for a joint that depends on frequency.
    derivatives : (n_params, n_matrices, d, d) bool array
    """

    matrices: NDArray[np.bool_]
    derivatives: NDArray[np.bool_]

    @property
    def filled(self) -> NDArray[np.bool_]:
        """Entries (d, d) of the joint's dynamic stiffness or of any derivative."""
        return np.asarray(np.concatenate([self.matrices, *self.derivatives]).any(axis=0))

    def covers(self, other: JointSparsity) -> bool:
        """Return whether all entries of another sparsity are entries of this one."""
        pairs = ((other.matrices, self.matrices), (other.derivatives, self.derivatives))
        return not any((theirs > own).any() for theirs, own in pairs if theirs is not own)

    def __or__(self, other: JointSparsity) -> JointSparsity:
        return JointSparsity(self.matrices | other.matrices, self.derivatives | other.derivatives)

    def with_matrices(self, matrices: NDArray[np.bool_]) -> JointSparsity:
        """Return the same with other entries of the matrices."""
        return JointSparsity(matrices, self.derivatives)

    def with_derivatives(self, columns: Sequence[int], entries: NDArray[np.bool_]) -> JointSparsity:
        """Return the same with other entries (n_columns, n_matrices, d, d) of the derivatives by some parameters."""
        derivatives = self.derivatives.copy()
        derivatives[list(columns)] = entries
        return JointSparsity(self.matrices, derivatives)


Sparsity = Mapping[str, JointSparsity]
"""The sparsity of each joint, by its name."""


class UnplannedEntries(Exception):  # noqa: N818 (a reason to plan again, not an error)
    """Parameter vectors fill entries for which the elimination is not planned.

    Parameters
    ----------
    sparsity : Sparsity
        Their entries, of the joints concerned.
    """

    def __init__(self, sparsity: Sparsity) -> None:
        super().__init__()
        self.sparsity = sparsity


def filled_entries(values: NDArray[np.generic]) -> NDArray[np.bool_]:
    """Return the entries of (..., d, d) arrays that are not zero everywhere, (d, d)."""
    filled: NDArray[np.bool_] = (values != 0).any(axis=tuple(range(values.ndim - 2)))
    return filled


def probe_matrices(graph: Graph, frequency: NDArray[np.float64], theta: Theta) -> dict[str, JointSparsity]:
    """Return the entries that some parameter vectors fill, without derivatives.

    Parameters
    ----------
    graph : Graph
    frequency : (n_freq,) array
        Hz; a joint that depends on frequency is evaluated at the first, the middle and the last line.
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
                matrices = _probed(name, model, theta[name])
        none = np.zeros((len(model.parameters), *matrices.shape), dtype=np.bool_)
        sparsity[name] = JointSparsity(matrices, none)
    return sparsity


def _probed(name: str, model: JointModel, theta: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return the filled entries (4, d, d) of a joint's matrices; those of the latest parameter vectors are kept."""
    latest, probes = _LATEST.get(model), theta.tobytes()
    if latest is not None and latest[0] == probes:
        return latest[1]
    filled: NDArray[np.bool_] = joint_matrices(name, model, theta).filled[0]
    if superposed := superposition(name, model):
        with plugin_errors(model, _label(name, model)):
            filled = superposed.filled(np.flatnonzero(superposed.functions(theta).any(axis=1)), MATRICES)
    _LATEST[model] = probes, filled
    return filled


def probe_derivatives(
    graph: Graph, frequency: NDArray[np.float64], theta: Theta, columns: Mapping[str, list[int]]
) -> dict[str, NDArray[np.bool_]]:
    """Return the entries of the derivatives by some columns of each joint's theta that parameter vectors fill.

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
        elif superposed := superposition(name, model):
            with plugin_errors(model, _label(name, model)):
                entries = superposed.filled_derivatives(theta[name], MATRICES)
        else:
            entries = joint_jacobian(name, model, theta[name]).filled
        wanted = np.isin(np.arange(len(entries)), columns[name])
        derivatives[name] = entries & wanted[:, np.newaxis, np.newaxis, np.newaxis]
    return derivatives


def _few_lines(frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    return frequency[[0, len(frequency) // 2, -1]]
