"""What the arrays hold that a kernel reads, column by column."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Derivative", "GeneralDerivative", "Layout", "Term"]

Term = tuple[int, str]
"""A slot and which of K, D, C, M a joint adds there."""
Derivative = tuple[int, int, str]
"""A parameter, a slot, and the part of it that depends on the parameter."""
GeneralDerivative = tuple[int, int]
"""A parameter of a joint that depends on frequency, and a slot."""


@dataclass(frozen=True)
class Layout:
    """What the kernel's arrays hold, column by column.

    Parameters
    ----------
    static : tuple of (int, int)
        Slot and part (0 real, 1 imaginary) of each row of the substructures' contributions.
    terms : tuple of Term
        Of each column of the joints' contributions.
    general : tuple of int
        Slots to which joints that depend on frequency contribute.
    derivatives : tuple of Derivative
        Of each column of the derivatives; empty for the FRF alone.
    general_derivatives : tuple of GeneralDerivative
        Of each complex row of the derivatives of joints that depend on frequency.
    parameters : int
        Number of parameters by which to differentiate.
    """

    static: tuple[tuple[int, int], ...]
    terms: tuple[Term, ...]
    general: tuple[int, ...] = ()
    derivatives: tuple[Derivative, ...] = ()
    general_derivatives: tuple[GeneralDerivative, ...] = ()
    parameters: int = 0
