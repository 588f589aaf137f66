"""Rigid coupling and decoupling of two parts by their receptances."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Receptance = NDArray[np.complex128]
"""Receptances (n_freq, n_out, n_in)."""


def couple(
    tt: Receptance, ti: Receptance, it: Receptance, ii: Receptance, other: Receptance, *, tolerance: float = 0.0
) -> Receptance:
    """Return the receptance of a part at its points t with another part rigidly coupled to its interface i.

    This is forward RCSA, Eq. 20 of Processes 14 (2026) 1875, doi:10.3390/pr14121875.

    Parameters
    ----------
    tt, ti, it, ii : (n_freq, n_t, n_t), (n_freq, n_t, n_i), (n_freq, n_i, n_t), (n_freq, n_i, n_i) complex arrays
        Receptances of the uncoupled part.
    other : (n_freq, n_i, n_i) complex array
        Receptance of the other part at the interface.
    tolerance : float
        Singular value of the interface's flexibility, over the largest one at each frequency, below which it is left
        out; for an interface with more DOFs than independent motions. 0, the default, leaves none out.

    Returns
    -------
    (n_freq, n_t, n_t) complex array
        H_tt - H_ti (H_ii + G_ii)^-1 H_it.
    """
    return tt - ti @ _solved(ii + other, it, tolerance)


def decouple(
    whole: Receptance, tt: Receptance, ti: Receptance, it: Receptance, ii: Receptance, *, tolerance: float = 0.0
) -> Receptance:
    """Return the receptance of the unknown part at the interface from those of the coupled parts and of the known part.

    This is inverse RCSA, Eq. 18 of Processes 14 (2026) 1875, doi:10.3390/pr14121875.

    Parameters
    ----------
    whole : (n_freq, n_t, n_t) complex array
        Receptance of the coupled parts at the points t of the known part.
    tt, ti, it, ii : complex arrays
        Receptances of the uncoupled known part, as in `couple`; n_t must equal n_i, or exceed it with a tolerance.
    tolerance : float
        As in `couple`. With more points than DOFs of the interface, the difference of the two receptances has as many
        independent motions as the interface, and its other singular values are noise.

    Returns
    -------
    (n_freq, n_i, n_i) complex array
        H_it (H_tt - G_tt)^-1 H_ti - H_ii.
    """
    return it @ _solved(tt - whole, ti, tolerance) - ii


def _solved(matrix: Receptance, right: Receptance, tolerance: float) -> Receptance:
    """Return the solution of a linear system, without its small singular values if a tolerance is given."""
    if tolerance == 0.0:
        return np.asarray(np.linalg.solve(matrix, right))
    return np.asarray(np.linalg.pinv(matrix, rcond=tolerance) @ right)
