"""Agreement of two FRFs."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["coherence_spectrum"]


def coherence_spectrum(first: ArrayLike, second: ArrayLike) -> NDArray[np.float64]:
    """Agreement of two complex FRFs, line by line.

    Parameters
    ----------
    first, second : (..., n_freq) complex arrays
        The two FRFs, of the same quantity.

    Returns
    -------
    (..., n_freq) array
        ``|h1 + h2|^2 / (2 (|h1|^2 + |h2|^2))``: 1 where they are equal or both zero, 0 where they are opposite.

    References
    ----------
    Eq. 15 of Processes 14 (2026) 1875, doi:10.3390/pr14121875.
    """
    h1, h2 = np.asarray(first, dtype=np.complex128), np.asarray(second, dtype=np.complex128)
    energy = 2.0 * (np.abs(h1) ** 2 + np.abs(h2) ** 2)
    agreement: NDArray[np.float64] = np.divide(np.abs(h1 + h2) ** 2, energy, out=np.ones_like(energy), where=energy > 0)
    return agreement
