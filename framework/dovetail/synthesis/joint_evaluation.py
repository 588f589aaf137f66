"""A joint model's matrices, its dynamic stiffness and the derivatives of both, each checked before it is used."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import PluginError
from dovetail.interfaces import JointModel, StructuralMatrices, plugin_errors
from dovetail.synthesis.codegen.layout import MATRICES

__all__ = [
    "Theta",
    "depends_on_frequency",
    "joint_jacobian",
    "joint_matrices",
    "joint_stiffness",
    "joint_stiffness_jacobian",
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
    _check_matrices(label, model, matrices, len(theta))
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
        raise PluginError(f"{problem}, not one for each of its {len(model.parameters)} parameters.")


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
    for matrix in MATRICES:
        values = getattr(matrices, matrix)
        if not np.isfinite(values if values.strides[0] else values[:1]).all():
            raise PluginError(f"{label} returns a matrix {matrix} that is not finite.")


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
