"""The planar Timoshenko beam element: material, cross-sections, element matrices.

The axis is s, x the displacement perpendicular to it, and rz the rotation, with rz = dx/ds in pure bending.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from dovetail import ComponentConfig, InUnit, StructuralMatrices

_NUMBERS = np.array([[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]])
"""Index of each entry of a symmetric matrix among those of its upper triangle, row by row."""


class Material(ComponentConfig):
    """An isotropic linear material with structural damping.

    Attributes
    ----------
    young : float
        Young's modulus [Pa].
    density : float
        Mass per volume [kg/m^3].
    poisson : float
        Poisson's ratio.
    loss_factor : float
        Structural damping over stiffness, D = eta K.
    """

    young: Annotated[float, Field(gt=0), InUnit("Pa")]
    density: Annotated[float, Field(gt=0), InUnit("kg/m^3")]
    poisson: Annotated[float, Field(ge=0, lt=0.5)] = 0.3
    loss_factor: Annotated[float, Field(ge=0, lt=1)] = 0.0


def shear_coefficient(ratio: ArrayLike, poisson: ArrayLike) -> NDArray[np.float64]:
    """Return Cowper's shear coefficient of a solid or hollow circle.

    Parameters
    ----------
    ratio : array_like
        Inner over outer diameter, 0 for a solid section.
    poisson : float or array

    References
    ----------
    G. R. Cowper, The shear coefficient in Timoshenko's beam theory, J. Appl. Mech. 33 (1966) 335-340.
    """
    poisson = np.asarray(poisson, dtype=np.float64)
    squared = np.asarray(ratio, dtype=np.float64) ** 2
    plus = (1.0 + squared) ** 2
    return 6.0 * (1.0 + poisson) * plus / ((7.0 + 6.0 * poisson) * plus + (20.0 + 12.0 * poisson) * squared)


@dataclass(frozen=True, eq=False)
class CrossSection:
    """Properties of a cross-section for bending and shear; arrays form a batch.

    Parameters
    ----------
    area : (...) array
        m^2.
    inertia : (...) array
        Second moment of area [m^4].
    shear : (...) array
        Shear coefficient.
    """

    area: NDArray[np.float64]
    inertia: NDArray[np.float64]
    shear: NDArray[np.float64]


def circle(outer: ArrayLike, inner: ArrayLike, poisson: float) -> CrossSection:
    """Return a solid or hollow circle with given diameters [m]."""
    do, di = np.asarray(outer, dtype=np.float64), np.asarray(inner, dtype=np.float64)
    area, inertia = np.pi / 4.0 * (do**2 - di**2), np.pi / 64.0 * (do**4 - di**4)
    return CrossSection(area, inertia, shear_coefficient(di / do, poisson))


def rectangle(width: ArrayLike, height: ArrayLike, poisson: float) -> CrossSection:
    """Return a rectangle with given sides [m]: `height` in the direction of bending, `width` across.

    References
    ----------
    G. R. Cowper, The shear coefficient in Timoshenko's beam theory, J. Appl. Mech. 33 (1966) 335-340.
    """
    across, deep = np.asarray(width, dtype=np.float64), np.asarray(height, dtype=np.float64)
    area = across * deep
    shear = 10.0 * (1.0 + poisson) / (12.0 + 11.0 * poisson) * np.ones_like(area)
    return CrossSection(area, across * deep**3 / 12.0, shear)


def element_matrices(length: ArrayLike, section: CrossSection, material: Material) -> StructuralMatrices:
    """Return the matrices of one element between two nodes, DOFs x and rz at each.

    Parameters
    ----------
    length : float or (...) array
        m.
    section : CrossSection
    material : Material
        Its values may be arrays too; all shapes together form the batch.

    Returns
    -------
    StructuralMatrices
        Of (..., 4, 4) arrays: shear-consistent stiffness, consistent mass with rotary inertia, D = eta K.

    References
    ----------
    Z. Friedman, J. B. Kosmatka, An improved two-node Timoshenko beam finite element, Comput. Struct. 47 (1993)
    473-481.
    """
    length = np.asarray(length, dtype=np.float64)
    shear_modulus = material.young / (2.0 * (1.0 + material.poisson))
    shear_area = section.shear * section.area
    bending = material.young * section.inertia
    phi = 12.0 * bending / (shear_modulus * shear_area * length**2)
    stiffness = (bending / ((1.0 + phi) * length**3))[..., None, None] * _stiffness_shape(phi, length)
    translation = (material.density * section.area * length / (210.0 * (1.0 + phi) ** 2))[..., None, None]
    rotation = (material.density * section.inertia / (30.0 * (1.0 + phi) ** 2 * length))[..., None, None]
    mass = translation * _translation_shape(phi, length) + rotation * _rotation_shape(phi, length)
    damping = np.asarray(material.loss_factor)[..., None, None] * stiffness
    mass, stiffness, damping = np.broadcast_arrays(mass, stiffness, damping)
    return StructuralMatrices(mass, stiffness, D=damping)


def chain(elements: StructuralMatrices) -> StructuralMatrices:
    """Join elements end to end.

    Parameters
    ----------
    elements : StructuralMatrices
        Of (..., n_elements, 4, 4) arrays.

    Returns
    -------
    StructuralMatrices
        Of (..., d, d) arrays with d = 2 (n_elements + 1).
    """
    count = elements.K.shape[-3]
    joined = StructuralMatrices.zeros(*elements.K.shape[:-3], 2 * (count + 1))
    for first in (0, 1):  # every other element, since neighbours share a node
        rows = 2 * np.arange(first, count, 2)[:, None, None] + np.arange(4)[:, None]
        for name in "MKCD":
            blocks = getattr(elements, name)[..., first::2, :, :]
            if blocks.any():
                getattr(joined, name)[..., rows, np.swapaxes(rows, -1, -2)] += blocks
    return joined


def _symmetric(upper: list[list[NDArray[np.float64] | float]], shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Fill a symmetric (..., 4, 4) array from its upper triangle."""
    entries = np.empty((*shape, 10))
    for number, entry in enumerate(entry for row in upper for entry in row):
        entries[..., number] = entry
    return entries[..., _NUMBERS]


def _stiffness_shape(phi: NDArray[np.float64], length: NDArray[np.float64]) -> NDArray[np.float64]:
    near, far = (4.0 + phi) * length**2, (2.0 - phi) * length**2
    rows: list[list[NDArray[np.float64] | float]] = [
        [12.0, 6.0 * length, -12.0, 6.0 * length],
        [near, -6.0 * length, far],
        [12.0, -6.0 * length],
        [near],
    ]
    return _symmetric(rows, phi.shape)


def _translation_shape(phi: NDArray[np.float64], length: NDArray[np.float64]) -> NDArray[np.float64]:
    near, far = 70.0 * phi**2 + 147.0 * phi + 78.0, 35.0 * phi**2 + 63.0 * phi + 27.0
    near_turn = (35.0 * phi**2 + 77.0 * phi + 44.0) * length / 4.0
    far_turn = (35.0 * phi**2 + 63.0 * phi + 26.0) * length / 4.0
    turn, cross = (7.0 * phi**2 + 14.0 * phi + 8.0), (7.0 * phi**2 + 14.0 * phi + 6.0)
    square = length**2 / 4.0
    rows: list[list[NDArray[np.float64] | float]] = [
        [near, near_turn, far, -far_turn],
        [turn * square, far_turn, -cross * square],
        [near, -near_turn],
        [turn * square],
    ]
    return _symmetric(rows, phi.shape)


def _rotation_shape(phi: NDArray[np.float64], length: NDArray[np.float64]) -> NDArray[np.float64]:
    side = (15.0 * phi - 3.0) * length
    turn, cross = (10.0 * phi**2 + 5.0 * phi + 4.0) * length**2, (5.0 * phi**2 - 5.0 * phi - 1.0) * length**2
    rows: list[list[NDArray[np.float64] | float]] = [
        [36.0, -side, -36.0, -side],
        [turn, side, cross],
        [36.0, side],
        [turn],
    ]
    return _symmetric(rows, phi.shape)
