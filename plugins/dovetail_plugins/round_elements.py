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


class _Terms(NamedTuple):
    """Functions (n,) of the diameters: d_o^2 + d_i^2, d_o^2 - d_i^2, phi, 1 / (1 + phi), and products of these."""

    total: NDArray[np.float64]
    ring: NDArray[np.float64]
    share: NDArray[np.float64]
    phi: NDArray[np.float64]
    below: NDArray[np.float64]
    bent: NDArray[np.float64]
    moved: NDArray[np.float64]
    turned: NDArray[np.float64]


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
        bent, area = self._stiffness * total * ring * below, self._mass * ring * below * below
        return _Terms(total, ring, share, phi, below, bent, 16.0 * area, area * total)

    def _functions(self, diameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the eight functions (n, 8) of diameters (n, 2)."""
        terms = self._terms(diameters)
        functions, phi = np.empty((8, len(diameters))), terms.phi
        for row, start, powers in ((0, terms.bent, 2), (2, terms.moved, 3), (5, terms.turned, 3)):
            functions[row] = start
            for power in range(1, powers):
                np.multiply(functions[row + power - 1], phi, out=functions[row + power])
        return functions.T

    def _slopes(self, diameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives (n, 8, 2) of the functions by the diameters (n, 2)."""
        terms, twice = self._terms(diameters), 2.0 * diameters.T
        along, across = twice / terms.total, _SIGNS * twice / terms.ring
        share = twice * np.square(diameters.T[::-1]) / (terms.total * terms.total) - 2.0 * terms.share * along
        change = terms.phi * along + terms.total * self._shear[1] * share
        stiffer, lighter = along + across - terms.below * change, across - 2.0 * terms.below * change
        starts = (terms.bent, stiffer, 2), (terms.moved, lighter, 3), (terms.turned, lighter + along, 3)
        slopes, row = np.empty((8, *twice.shape)), 0
        for start, rate, powers in starts:
            slopes[row] = start * rate
            scale = start
            for power in range(1, powers):
                slopes[row + power] = slopes[row + power - 1] * terms.phi + scale * change
                scale = scale * terms.phi
            row += powers
        return np.moveaxis(slopes, -1, 0)


def _sum(factors: NDArray[np.float64], matrices: Sequence[Any]) -> Any:
    """Return the sum of sparse matrices times factors."""
    return sum((factor * matrix for factor, matrix in zip(factors, matrices, strict=True)), 0.0 * matrices[0])
