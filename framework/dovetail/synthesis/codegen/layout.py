"""The meaning of the columns of a kernel's arrays."""

from __future__ import annotations

from dataclasses import dataclass

MATRICES = "KDCM"
"""The matrices of a joint's dynamic stiffness K + iD + i omega C - omega^2 M."""

Term = tuple[int, str]
"""A slot, and the matrix with which a joint contributes to it."""
Derivative = tuple[int, int, str]
"""A parameter, a slot, and the matrix whose derivative contributes to it."""
SpectralDerivative = tuple[int, int]
"""A parameter of a joint that depends on frequency, and a slot."""


@dataclass(frozen=True)
class Layout:
    """The columns of the kernel's arrays.

    A joint with constant matrices contributes terms, one number each for all frequencies. A joint that depends on
    frequency contributes spectral terms, a complex number for each frequency.

    Parameters
    ----------
    static : tuple of (int, int)
        Slot and part (0 real, 1 imaginary) of each row of the substructures' contributions.
    terms : tuple of Term
        Slot and matrix of each column of the joints' matrices.
    pairs : tuple of (int, int)
        Output and input DOF of each FRF, among those that the elimination keeps longest.
    spectral_terms : tuple of int
        Slot of each complex row of the joints that depend on frequency.
    derivatives : tuple of Derivative
        Parameter, slot and matrix of each column of the derivatives; empty without derivatives.
    spectral_derivatives : tuple of SpectralDerivative
        Parameter and slot of each complex row of the derivatives of joints that depend on frequency.
    parameters : int
        Number of parameters by which to differentiate.
    """

    static: tuple[tuple[int, int], ...]
    terms: tuple[Term, ...]
    pairs: tuple[tuple[int, int], ...]
    spectral_terms: tuple[int, ...] = ()
    derivatives: tuple[Derivative, ...] = ()
    spectral_derivatives: tuple[SpectralDerivative, ...] = ()
    parameters: int = 0
