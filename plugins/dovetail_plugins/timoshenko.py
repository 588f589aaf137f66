"""The planar Timoshenko beam element: material, cross-sections, element matrices.

The axis is s, x the displacement perpendicular to it, and rz the rotation, with rz = dx/ds in pure bending.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Generic, TypeVar

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from dovetail import ComponentConfig, InUnit, StructuralMatrices

_Value = TypeVar("_Value")

_STIFFNESS = np.array([[1, 2, -1, 2], [2, 3, -2, 4], [-1, -2, 1, -2], [2, 4, -2, 3]])
_MASS = np.array([[1, 2, 3, -4], [2, 5, 4, 6], [3, 4, 1, -2], [-4, 6, -2, 5]])
"""Number, from 1, and sign of the coefficient in each entry of an element's matrices."""
TRANSLATION = np.array(
    [[78, 147, 70], [11, 19.25, 8.75], [27, 63, 35], [6.5, 15.75, 8.75], [2, 3.5, 1.75], [-1.5, -3.5, -1.75]]
).T
ROTATION = np.array([[36, 0, 0], [3, -15, 0], [-36, 0, 0], [-3, 15, 0], [4, 5, 10], [-1, -5, 5]]).T
"""Coefficients of 1, phi and phi^2 in each coefficient of the mass, from translation and from rotation."""
BENDING = np.array([[12.0, 6.0, 4.0, 2.0], [0.0, 0.0, 1.0, -1.0]])
"""Coefficients of 1 and phi in each coefficient of the stiffness."""
STIFFNESS_POWERS = np.array([0.0, 1.0, 2.0, 2.0])
MASS_POWERS = np.array([0.0, 1.0, 0.0, 1.0, 2.0, 2.0])
"""Power of the length in each coefficient: the number of rotations in its entries."""
_Side = Annotated[float, Field(gt=0), InUnit("m")]
_Bore = Annotated[float, Field(ge=0), InUnit("m")]


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


def circle(outer: ArrayLike, inner: ArrayLike, poisson: ArrayLike) -> CrossSection:
    """Return a solid or hollow circle with given diameters [m] and Cowper's shear coefficient.

    References
    ----------
    G. R. Cowper, The shear coefficient in Timoshenko's beam theory, J. Appl. Mech. 33 (1966) 335-340.
    """
    do, di = np.asarray(outer, dtype=np.float64), np.asarray(inner, dtype=np.float64)
    nu, ratio = np.asarray(poisson, dtype=np.float64), (di / do) ** 2
    plus = (1.0 + ratio) ** 2
    shear = 6.0 * (1.0 + nu) * plus / ((7.0 + 6.0 * nu) * plus + (20.0 + 12.0 * nu) * ratio)
    return CrossSection(np.pi / 4.0 * (do**2 - di**2), np.pi / 64.0 * (do**4 - di**4), shear)


def circle_rates(outer: ArrayLike, inner: ArrayLike, poisson: Any) -> tuple[CrossSection, ...]:
    """Return the derivatives of `circle` by its arguments, each over the property itself."""
    do, di = np.asarray(outer, dtype=np.float64), np.asarray(inner, dtype=np.float64)
    squares = do * do, di * di
    ring, total, ratio = squares[0] - squares[1], squares[0] + squares[1], squares[1] / squares[0]
    first, second, plus = 7.0 + 6.0 * poisson, 20.0 + 12.0 * poisson, 1.0 + ratio
    below = first * (plus * plus) + second * ratio
    by_ratio = 2.0 / plus - (2.0 * first * plus + second) / below
    areas = 2.0 * do / ring, -2.0 * di / ring
    shear = 2.0 * by_ratio * di / squares[0]
    by_outer = CrossSection(areas[0], 2.0 * areas[0] * squares[0] / total, -shear * di / do)
    by_inner = CrossSection(areas[1], 2.0 * areas[1] * squares[1] / total, shear)
    by_poisson = 1.0 / (1.0 + poisson) - (6.0 * (plus * plus) + 12.0 * ratio) / below
    return by_outer, by_inner, CrossSection(np.zeros_like(ring), np.zeros_like(ring), by_poisson)


def rectangle(width: ArrayLike, height: ArrayLike, poisson: ArrayLike) -> CrossSection:
    """Return a rectangle with given sides [m]: `height` in the direction of bending, `width` across.

    References
    ----------
    G. R. Cowper, The shear coefficient in Timoshenko's beam theory, J. Appl. Mech. 33 (1966) 335-340.
    """
    across, deep = np.asarray(width, dtype=np.float64), np.asarray(height, dtype=np.float64)
    area, nu = across * deep, np.asarray(poisson, dtype=np.float64)
    shear = 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu) * np.ones_like(area)
    return CrossSection(area, across * deep**3 / 12.0, shear)


def rectangle_rates(width: ArrayLike, height: ArrayLike, poisson: ArrayLike) -> tuple[CrossSection, ...]:
    """Return the derivatives of `rectangle` by its arguments, each over the property itself."""
    across, deep = np.asarray(width, dtype=np.float64), np.asarray(height, dtype=np.float64)
    nu, none = np.asarray(poisson, dtype=np.float64), np.zeros_like(across)
    by_poisson = 1.0 / (1.0 + nu) - 11.0 / (12.0 + 11.0 * nu) + none
    by_width = CrossSection(1.0 / across, 1.0 / across, none)
    return by_width, CrossSection(1.0 / deep, 3.0 / deep, none), CrossSection(none, none, by_poisson)


class Section(ComponentConfig):
    """A length of beam, round or rectangular.

    Attributes
    ----------
    length : float
        Length along the beam [m].
    outer, inner : float
        Diameters of a round section [m].
    outer_end, inner_end : float
        Diameters at the far end [m]; with them the diameters change linearly along the section.
    width, height : float
        Sides of a rectangular section [m]; `height` is the one in the direction of the displacement x.
    elements : int
        Number of elements, of equal length.
    """

    length: Annotated[float, Field(gt=0), InUnit("m")]
    outer: _Side | None = None
    inner: _Bore = 0.0
    outer_end: _Side | None = None
    inner_end: _Bore | None = None
    width: _Side | None = None
    height: _Side | None = None
    elements: Annotated[int, Field(ge=1, le=1000)] = 1

    @model_validator(mode="after")
    def _one_shape(self) -> Section:
        if (self.width is None) != (self.height is None):
            raise ValueError("a rectangular section has a width and a height")
        if (self.outer is None) == (self.width is None):
            raise ValueError("a section is either round, with 'outer', or rectangular, with 'width' and 'height'")
        if self.outer is None:
            if self.inner or self.outer_end is not None or self.inner_end is not None:
                raise ValueError("a rectangular section has no diameters")
            return self
        (start, end), (bore, end_bore) = self._ends(self.outer)
        if bore >= start or end_bore >= end:
            raise ValueError("the inner diameter must be smaller than the outer one")
        return self

    def _ends(self, outer: Any) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the outer and inner diameters at the near and at the far end."""
        end_outer = outer if self.outer_end is None else self.outer_end
        end_inner = self.inner if self.inner_end is None else self.inner_end
        return (outer, end_outer), (self.inner, end_inner)

    def cross_section(self, poisson: float) -> CrossSection:
        """Return the cross-sections at the middle of the elements, (elements,) arrays."""
        if self.width is not None and self.height is not None:
            ones = np.ones(self.elements)
            return rectangle(self.width * ones, self.height * ones, poisson)
        return circle(*self.diameters(), poisson)

    def diameters(self) -> tuple[Any, Any]:
        """Return the outer diameter, or the height, and the inner diameter at the middle of the elements."""
        return self.diameters_at((np.arange(self.elements) + 0.5) / self.elements)

    def diameters_at(self, share: Any) -> tuple[Any, Any]:
        """Return the outer diameter, or the height, and the inner one after a share of the section's length."""
        (outer, end_outer), (inner, end_inner) = self._ends(self.height if self.outer is None else self.outer)
        return outer + share * (end_outer - outer), inner + share * (end_inner - inner)


@dataclass(frozen=True, eq=False)
class Element:
    """The element between two nodes, DOFs x and rz at each; arrays form a batch.

    Its matrices have few different entries, and all others follow from these coefficients: shear-consistent
    stiffness, and consistent mass with rotary inertia.

    Parameters
    ----------
    length : (...) array
        m.
    section : CrossSection
    poisson : (...) array
    young, density : (...) arrays
        One by default.

    References
    ----------
    Z. Friedman, J. B. Kosmatka, An improved two-node Timoshenko beam finite element, Comput. Struct. 47 (1993)
    473-481.
    """

    length: NDArray[np.float64]
    section: CrossSection
    poisson: NDArray[np.float64]
    young: NDArray[np.float64] | float = 1.0
    density: NDArray[np.float64] | float = 1.0

    @cached_property
    def _bending(self) -> NDArray[np.float64]:
        bending: NDArray[np.float64] = self.young * self.section.inertia
        return bending

    @cached_property
    def _shear(self) -> NDArray[np.float64]:
        """The deflection by shear over that by bending, phi, (..., 1)."""
        shear_area = self.section.shear * self.section.area
        shear_modulus = self.young / (2.0 * (1.0 + self.poisson))
        phi: NDArray[np.float64] = (12.0 * self._bending / (shear_modulus * shear_area * self.length**2))[..., None]
        return phi

    @cached_property
    def _stiffness_scale(self) -> NDArray[np.float64]:
        """The stiffness (..., 1) of which the coefficients are multiples."""
        scale: NDArray[np.float64] = self._bending[..., None] / ((1.0 + self._shear) * self.length[..., None] ** 3)
        return scale

    @cached_property
    def stiffness(self) -> NDArray[np.float64]:
        """The four coefficients (..., 4) of K."""
        brackets = BENDING[0] + self._shear * BENDING[1]
        return np.asarray(self._stiffness_scale * (brackets * _powers(self.length, STIFFNESS_POWERS)))

    @cached_property
    def _masses(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The masses (..., 6) from translation and from rotation by which polynomials in phi are multiplied."""
        powers, square = _powers(self.length, MASS_POWERS), (1.0 + self._shear) ** 2
        translation = (self.density * self.section.area * self.length)[..., None] / (210.0 * square)
        rotation = (self.density * self.section.inertia)[..., None] / (30.0 * square * self.length[..., None])
        return translation * powers, rotation * powers

    @cached_property
    def mass(self) -> NDArray[np.float64]:
        """The six coefficients (..., 6) of M."""
        translation, rotation = self._masses
        return translation * _polynomial(TRANSLATION, self._shear) + rotation * _polynomial(ROTATION, self._shear)

    def slopes(
        self, length: NDArray[np.float64], section: CrossSection, poisson: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the derivatives (..., 4, p) and (..., 6, p) of `stiffness` and `mass` by p parameters.

        Parameters
        ----------
        length, poisson : (..., p) arrays
            Derivatives of the length and of Poisson's ratio.
        section : CrossSection
            Derivatives (..., p) of its properties, each over the property itself.
        """
        area, inertia, shear = (rate[..., None, :] for rate in (section.area, section.inertia, section.shear))
        change = inertia - shear - area
        if poisson.any():
            change = change + (poisson / (1.0 + self.poisson)[..., None])[..., None, :]
        scaled = tuple(zip(self._masses, (TRANSLATION, ROTATION), strict=True))
        moved, turned = (scale * _polynomial(table, self._shear) for scale, table in scaled)
        below = 1.0 + self._shear
        by_shear = -2.0 * (moved + turned) / below
        for scale, table in scaled:
            by_shear += scale * (table[1] + 2.0 * self._shear * table[2])
        bent = self._stiffness_scale * (BENDING[1] * _powers(self.length, STIFFNESS_POWERS)) - self.stiffness / below
        stiffness = self.stiffness[..., None] * inertia
        mass = moved[..., None] * area + turned[..., None] * inertia
        if length.any():
            along = (length / self.length[..., None])[..., None, :]
            change = change - 2.0 * along
            stiffness = stiffness + ((STIFFNESS_POWERS - 3.0) * self.stiffness)[..., None] * along
            mass = mass + ((MASS_POWERS + 1.0) * moved + (MASS_POWERS - 1.0) * turned)[..., None] * along
        change = self._shear[..., None] * change
        return stiffness + bent[..., None] * change, mass + by_shear[..., None] * change


class Remembered(Generic[_Value]):
    """A function that keeps its latest value, since factors of matrices and their slopes are wanted at the same points.

    Parameters
    ----------
    function : callable
        Takes points (n, p).
    """

    def __init__(self, function: Callable[[NDArray[np.float64]], _Value]) -> None:
        self._function = function
        self._latest: tuple[tuple[tuple[int, ...], bytes], _Value] | None = None

    def __call__(self, points: NDArray[np.float64]) -> _Value:
        """Return the value at points (n, p)."""
        key, latest = (points.shape, points.tobytes()), self._latest  # another thread may replace it
        if latest is None or latest[0] != key:
            self._latest = latest = key, self._function(points.copy())
        return latest[1]


def _powers(length: NDArray[np.float64], powers: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return powers 0, 1 and 2 of the length, (..., n_powers)."""
    along = length[..., None]
    return np.where(powers == 1.0, along, np.where(powers == 2.0, along * along, 1.0))


def _polynomial(table: NDArray[np.float64], phi: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(table[2] * phi**2 + table[1] * phi + table[0])


def element_matrices(length: ArrayLike, section: CrossSection, material: Material) -> StructuralMatrices:
    """Return the matrices (..., 4, 4) of an `Element` of a material, with D = eta K.

    Parameters
    ----------
    length : float or (...) array
        m.
    section : CrossSection
    material : Material
        Its values may be arrays too; all shapes together form the batch.
    """
    element = Element(
        np.asarray(length, dtype=np.float64),
        section,
        *(np.asarray(value, dtype=np.float64) for value in (material.poisson, material.young, material.density)),
    )
    stiffness = element.stiffness[..., np.abs(_STIFFNESS) - 1] * np.sign(_STIFFNESS)
    mass = element.mass[..., np.abs(_MASS) - 1] * np.sign(_MASS)
    damping = np.asarray(material.loss_factor)[..., None, None] * stiffness
    mass, stiffness, damping = np.broadcast_arrays(mass, stiffness, damping)
    return StructuralMatrices(mass, stiffness, D=damping)


def unit_chains(size: int, elements: Sequence[int], first: int = 0) -> tuple[list[Any], list[Any]]:
    """Return the sparse matrices (size, size) of equal elements, for each coefficient of K and of M equal to one.

    Parameters
    ----------
    size : int
        Number of DOFs.
    elements : sequence of int
        The elements, which reach from node i to node i + 1.
    first : int
        DOF x of node 0.
    """
    start = first + 2 * np.asarray(elements, dtype=np.intp)[:, None]
    chains = []
    for table in (_STIFFNESS, _MASS):
        for number in range(1, int(np.abs(table).max()) + 1):
            row, column = np.nonzero(np.abs(table) == number)
            sign = np.broadcast_to(np.sign(table[row, column]).astype(np.float64), (len(start), len(row)))
            at = ((start + row).ravel(), (start + column).ravel())
            chains.append(scipy.sparse.csc_array(scipy.sparse.coo_array((sign.ravel(), at), shape=(size, size))))
    kinds = int(np.abs(_STIFFNESS).max())
    return chains[:kinds], chains[kinds:]


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
