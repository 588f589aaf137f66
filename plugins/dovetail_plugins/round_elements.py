"""Equal round beam elements whose diameters vary: few functions of the diameters, and what each multiplies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dovetail import ScaledMatrices, SparseMatrices
from dovetail_plugins.timoshenko import (
    BENDING,
    MASS_POWERS,
    ROTATION,
    STIFFNESS_POWERS,
    TRANSLATION,
    Material,
    Remembered,
    unit_chains,
)

_SIGNS = np.array([[1.0], [-1.0]])
"""Of the outer and the inner diameter in the area of the cross-section."""
_MULTIPLES = (1, 3, 4, 6, 7)
"""Functions that are phi times the one before."""


class _Terms(NamedTuple):
    """Terms (n,) in the diameters: d_o^2 + d_i^2, d_o^2 - d_i^2, q, phi and 1 / (1 + phi); the functions (8, n)."""

    total: NDArray[np.float64]
    ring: NDArray[np.float64]
    share: NDArray[np.float64]
    phi: NDArray[np.float64]
    below: NDArray[np.float64]
    functions: NDArray[np.float64]


class RoundElements:
    """The Timoshenko elements of `Element` with a round cross-section, all of one length and material.

    Parameters
    ----------
    material : Material
    length : float
        Of an element [m].

    Notes
    -----
    With the deflection phi by shear over that by bending, and constant matrices B, T and R,
    K = E I / (1 + phi) (B_0 + phi B_1) and
    M = rho A / (1 + phi)^2 (T_0 + phi T_1 + phi^2 T_2) + rho I / (1 + phi)^2 (R_0 + phi R_1 + phi^2 R_2).
    For a circle with Cowper's shear coefficient and q = d_o^2 d_i^2 / (d_o^2 + d_i^2)^2,
    phi = (d_o^2 + d_i^2) / (4 L^2) (7 + 6 nu + (20 + 12 nu) q).
    """

    def __init__(self, material: Material, length: float) -> None:
        self._material, self._length = material, length
        poisson, square = float(material.poisson), 4.0 * length**2
        self._shear = (7.0 + 6.0 * poisson) / square, (20.0 + 12.0 * poisson) / square
        circle = np.pi / 64.0
        self._stiffness, self._mass = circle * float(material.young), circle * float(material.density)
        self._terms = Remembered(self._new_terms)

    def scaled_matrices(self, size: int, elements: Sequence[int], first: int) -> ScaledMatrices:
        """Return the matrices (size, size) of the elements, as `unit_chains` places them, with D = eta K.

        Their functions are those of the outer and the inner diameter [m].
        """
        length, (stiffness, mass) = self._length, unit_chains(size, elements, first)
        none = 0.0 * mass[0]
        bent = BENDING * length ** (STIFFNESS_POWERS - 3.0)
        moved = np.concatenate([TRANSLATION * length / 210.0, ROTATION / (30.0 * length)]) * length**MASS_POWERS
        K = [_sum(row, stiffness) for row in bent]
        M = [_sum(row, mass) for row in moved]
        matrices = [SparseMatrices(none, each, D=self._material.loss_factor * each) for each in K]
        return ScaledMatrices([*matrices, *(SparseMatrices(each, none) for each in M)], self._functions, self._slopes)

    def _new_terms(self, diameters: NDArray[np.float64]) -> _Terms:
        outer, inner = np.square(diameters.T)
        total, ring = outer + inner, outer - inner
        share = outer * inner / (total * total)
        phi = total * (self._shear[0] + self._shear[1] * share)
        below = 1.0 / (1.0 + phi)
        area, functions = self._mass * ring * below * below, np.empty((8, len(diameters)))
        functions[0], functions[2], functions[5] = self._stiffness * total * ring * below, 16.0 * area, area * total
        for row in _MULTIPLES:
            np.multiply(functions[row - 1], phi, out=functions[row])
        return _Terms(total, ring, share, phi, below, functions)

    def _functions(self, diameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the eight functions (n, 8) of diameters (n, 2)."""
        return self._terms(diameters).functions.T.copy()

    def _slopes(self, diameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives (n, 8, 2) of the functions by the diameters (n, 2)."""
        terms, twice = self._terms(diameters), 2.0 * diameters.T
        along, across = twice / terms.total, _SIGNS * twice / terms.ring
        share = twice * np.square(diameters.T[::-1]) / (terms.total * terms.total) - 2.0 * terms.share * along
        change = terms.phi * along + terms.total * self._shear[1] * share
        stiffer, lighter = along + across - terms.below * change, across - 2.0 * terms.below * change
        functions, slopes = terms.functions, np.empty((8, *twice.shape))
        for row, rate in ((0, stiffer), (2, lighter), (5, lighter + along)):
            slopes[row] = functions[row] * rate
        for row in _MULTIPLES:
            slopes[row] = slopes[row - 1] * terms.phi + functions[row - 1] * change
        return np.moveaxis(slopes, -1, 0)


def _sum(factors: NDArray[np.float64], matrices: Sequence[Any]) -> Any:
    """Return the sum of sparse matrices times factors."""
    return sum((factor * matrix for factor, matrix in zip(factors, matrices, strict=True)), 0.0 * matrices[0])
