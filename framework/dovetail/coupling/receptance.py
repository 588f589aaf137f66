"""Rigid coupling and decoupling of two parts by their receptances."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["coupled", "decoupled"]

Receptance = NDArray[np.complex128]


def coupled(tt: Receptance, ti: Receptance, it: Receptance, ii: Receptance, other: Receptance) -> Receptance:
    """Receptance of a part at its points t once another part hangs rigidly on its interface i (forward RCSA, Eq. 20).

    Parameters
    ----------
    tt, ti, it, ii : (n_freq, n_t, n_t), (n_freq, n_t, n_i), (n_freq, n_i, n_t), (n_freq, n_i, n_i) complex arrays
        The part alone.
    other : (n_freq, n_i, n_i) complex array
        The other part at the interface.

    Returns
    -------
    (n_freq, n_t, n_t) complex array
        H_tt - H_ti (H_ii + G_ii)^-1 H_it.
    """
    return tt - ti @ np.linalg.solve(ii + other, it)


def decoupled(whole: Receptance, tt: Receptance, ti: Receptance, it: Receptance, ii: Receptance) -> Receptance:
    """Receptance of the other part at the interface, from the whole and the part that is known (inverse RCSA, Eq. 18).

    Parameters
    ----------
    whole : (n_freq, n_t, n_t) complex array
        The whole at the points t of the known part.
    tt, ti, it, ii : complex arrays
        The known part alone, as in `coupled`; n_t must be n_i.

    Returns
    -------
    (n_freq, n_i, n_i) complex array
        H_it (H_tt - G_tt)^-1 H_ti - H_ii.
    """
    return it @ np.linalg.solve(tt - whole, ti) - ii
