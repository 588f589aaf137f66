"""Receptance, mobility and accelerance: displacement, velocity and acceleration per force."""

from __future__ import annotations

from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

__all__ = ["QUANTITIES", "Quantity", "conversion", "unit_of"]

Quantity = Literal["receptance", "mobility", "accelerance"]
QUANTITIES: tuple[Quantity, ...] = get_args(Quantity)

_DERIVATIVES: dict[str, int] = {"receptance": 0, "mobility": 1, "accelerance": 2}
_PER_TIME: dict[str, str] = {"receptance": "", "mobility": " s", "accelerance": " s^2"}


def unit_of(quantity: Quantity, *, rotation: bool = False, moment: bool | None = None) -> str:
    """Return the SI unit of an FRF of this quantity.

    Parameters
    ----------
    quantity : Quantity
    rotation : bool
        Of a rotation instead of a displacement.
    moment : bool, optional
        By a moment instead of a force; by default as `rotation`.
    """
    below = ("N m" if (rotation if moment is None else moment) else "N") + _PER_TIME[quantity]
    return f"{'rad' if rotation else 'm'}/{f'({below})' if ' ' in below else below}"


def conversion(frequency: NDArray[np.inexact[Any]], source: Quantity, target: Quantity) -> NDArray[np.complex128]:
    """Return the factor, a power of i omega, that turns `source` into `target`.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz; complex of an FRF under an exponential window.
    source, target : {"receptance", "mobility", "accelerance"}

    Returns
    -------
    (n_freq,) complex array
    """
    power = _DERIVATIVES[target] - _DERIVATIVES[source]
    return np.asarray((2j * np.pi * frequency) ** power, dtype=np.complex128)
