"""An assembly measured in another way than described: its FRF passed through something more."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.assembly.parameters import Theta

__all__ = ["AlteredAssembly", "Passage", "factor", "loaded"]

Passage: TypeAlias = Callable[[NDArray[np.complex128]], tuple[NDArray[np.complex128], NDArray[np.complex128]]]
"""From FRFs (..., n_freq) to what is measured of them, and its derivative by them, line by line."""


class AlteredAssembly(Assembly):
    """An assembly whose FRFs pass through something before they are measured.

    Parameters
    ----------
    assembly : Assembly
    passage : callable
    """

    def __init__(self, assembly: Assembly, passage: Passage) -> None:
        super().__init__(assembly.description)
        self._assembly = assembly
        self._passage = passage

    def frf(self, theta: Theta = None) -> NDArray[np.complex128]:
        """Return the FRFs as measured, (n_freq,) or (n, n_freq)."""
        return self._passage(self._assembly.frf(theta))[0]

    def frf_jacobian(self, theta: Theta = None) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return the FRFs as measured and their derivatives, with a last axis n_params."""
        values, jacobian = self._assembly.frf_jacobian(theta)
        measured, slope = self._passage(values)
        return measured, jacobian * slope[..., np.newaxis]


def factor(by: NDArray[np.complex128] | complex) -> Passage:
    """Return what multiplies an FRF."""
    return lambda values: (values * by, np.broadcast_to(np.asarray(by, dtype=np.complex128), values.shape))


def loaded(mass: float, to_accelerance: NDArray[np.complex128]) -> Passage:
    """Return what puts a mass [kg] at the drive point."""

    def passage(values: NDArray[np.complex128]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        load = 1.0 + mass * to_accelerance * values
        return values / load, 1.0 / load**2

    return passage
