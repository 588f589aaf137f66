"""Receptance, mobility and accelerance: displacement, velocity and acceleration per force."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

__all__ = ["QUANTITIES", "Quantity", "conversion", "unit_of"]

Quantity = Literal["receptance", "mobility", "accelerance"]
QUANTITIES: tuple[Quantity, ...] = get_args(Quantity)

_DERIVATIVES: dict[str, int] = {"receptance": 0, "mobility": 1, "accelerance": 2}
_UNITS: dict[str, str] = {"receptance": "m/N", "mobility": "m/(N s)", "accelerance": "m/(N s^2)"}
_UNITS_OF_ROTATION = {"receptance": "rad/(N m)", "mobility": "rad/(N m s)", "accelerance": "rad/(N m s^2)"}


def unit_of(quantity: Quantity, *, rotation: bool = False) -> str:
    """Return the SI unit of an FRF of this quantity: a displacement per force, or a rotation per moment."""
    return (_UNITS_OF_ROTATION if rotation else _UNITS)[quantity]


def conversion(frequency: NDArray[np.float64], source: Quantity, target: Quantity) -> NDArray[np.complex128]:
    """Return the factor, a power of i omega, that turns `source` into `target`.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz.
    source, target : {"receptance", "mobility", "accelerance"}

    Returns
    -------
    (n_freq,) complex array
    """
    power = _DERIVATIVES[target] - _DERIVATIVES[source]
    return np.asarray((2j * np.pi * frequency) ** power, dtype=np.complex128)
