"""The beam element in space, for any part that is made of beams: bending in two planes, extension and torsion.

Its axis runs along -y, as that of the planar beam: x and rz bend it in one plane, z and rx in the other, y extends and
ry twists it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail import StructuralMatrices
from dovetail_plugins.timoshenko import CrossSection, Material, Section, circle, element_matrices, rectangle

_PLANES = ((0, 5, 1.0), (2, 3, -1.0))
"""Displacement and rotation in each plane of bending, and the sign of the slope of the one in the other.

A rotation about x moves a point further along -y by -z.
"""
_ROD = np.array([[7.0, 1.0, -8.0], [1.0, 7.0, -8.0], [-8.0, -8.0, 16.0]]) / 3.0
_ROD_MASS = np.array([[4.0, -1.0, 2.0], [-1.0, 4.0, 2.0], [2.0, 2.0, 16.0]]) / 30.0
"""A rod with quadratic functions, at its two ends and its middle: FRFs at its ends converge with the fourth order."""
_TERMS = 10
"""Terms of the series for the torsion of a rectangle, which falls by exp(-2 pi) and more from term to term."""
_ODD_FIFTH_POWERS = 31.0 / 32.0 * 1.0369277551433699
"""Sum of 1 / n^5 over odd n."""


@dataclass(frozen=True, eq=False)
class SpatialSection:
    """Properties of cross-sections in space; arrays form a batch.

    Parameters
    ----------
    bending : pair of CrossSection
        For displacements along x, and along z.
    torsion : (...) array
        Torsion constant [m^4]: the torque is G times it times the twist per length.
    polar : (...) array
        Second polar moment of area [m^4].
    """

    bending: tuple[CrossSection, CrossSection]
    torsion: NDArray[np.float64]
    polar: NDArray[np.float64]

    @staticmethod
    def from_section(section: Section, poisson: float) -> SpatialSection:
        """Return the cross-sections at the middle of the elements of a section, (elements,) arrays."""
        if section.width is None or section.height is None:
            ring = circle(*section.diameters(), poisson)
            return SpatialSection((ring, ring), 2.0 * ring.inertia, 2.0 * ring.inertia)
        ones = np.ones(section.elements)
        width, height = section.width * ones, section.height * ones
        bending = rectangle(width, height, poisson), rectangle(height, width, poisson)
        return SpatialSection(bending, torsion_of_rectangle(width, height), bending[0].inertia + bending[1].inertia)


def torsion_of_rectangle(width: ArrayLike, height: ArrayLike) -> NDArray[np.float64]:
    """Return the torsion constant [m^4] of a rectangle with given sides [m].

    References
    ----------
    S. P. Timoshenko, J. N. Goodier, Theory of Elasticity, 3rd ed., McGraw-Hill, 1970, section 109.
    """
    sides = np.broadcast_arrays(np.asarray(width, dtype=np.float64), np.asarray(height, dtype=np.float64))
    short, long = np.minimum(*sides), np.maximum(*sides)
    odd = 2.0 * np.arange(_TERMS) + 1.0
    exponent = np.minimum(odd * np.pi * (long / short)[..., None], 700.0)  # beyond which it would overflow
    missing = 2.0 / (np.exp(exponent) + 1.0)  # 1 - tanh
    series = _ODD_FIFTH_POWERS - (missing / odd**5).sum(axis=-1)
    return np.asarray(long * short**3 / 3.0 * (1.0 - 192.0 / np.pi**5 * short / long * series))


def spatial_element_matrices(length: ArrayLike, section: SpatialSection, material: Material) -> StructuralMatrices:
    """Return the matrices (..., 14, 14) of elements with D = eta K.

    The DOFs are x, y, z, rx, ry, rz at each of two nodes, then the inner ones, y and ry in the middle. Bending is as in
    `timoshenko.Element`; extension and torsion are quadratic along the element.

    Parameters
    ----------
    length : (...) array
        m.
    section : SpatialSection
    material : Material
    """
    span = np.asarray(length, dtype=np.float64)
    shape = np.broadcast_shapes(span.shape, section.torsion.shape)
    M, K = np.zeros((*shape, 14, 14)), np.zeros((*shape, 14, 14))
    for cross_section, (displacement, rotation, sign) in zip(section.bending, _PLANES, strict=True):
        plane = element_matrices(span, cross_section, material)
        dofs = np.array([displacement, rotation, displacement + 6, rotation + 6])
        signs = np.outer([1.0, sign, 1.0, sign], [1.0, sign, 1.0, sign])
        for whole, part in ((M, plane.M), (K, plane.K)):
            whole[..., dofs[:, None], dofs] += part * signs
    area, shear_modulus = section.bending[0].area, material.young / (2.0 * (1.0 + material.poisson))
    for dofs, stiffness, mass in (
        (np.array([1, 7, 12]), material.young * area / span, material.density * area * span),
        (np.array([4, 10, 13]), shear_modulus * section.torsion / span, material.density * section.polar * span),
    ):
        K[..., dofs[:, None], dofs] += np.broadcast_to(stiffness, shape)[..., None, None] * _ROD
        M[..., dofs[:, None], dofs] += np.broadcast_to(mass, shape)[..., None, None] * _ROD_MASS
    return StructuralMatrices(M, K, D=material.loss_factor * K)


def spatial_chain(elements: StructuralMatrices) -> StructuralMatrices:
    """Join elements (n, 14, 14) end to end to matrices (8 n + 6, 8 n + 6): the nodes' DOFs, then the inner ones."""
    count = len(elements.K)
    joined = StructuralMatrices.zeros(8 * count + 6)
    for number in range(count):
        inner = 6 * (count + 1) + 2 * number
        dofs = np.array([*range(6 * number, 6 * number + 12), inner, inner + 1])
        for name in "MKCD":
            getattr(joined, name)[dofs[:, None], dofs] += getattr(elements, name)[number]
    return joined
