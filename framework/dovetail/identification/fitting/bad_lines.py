"""Lines of a measurement that cannot belong to the rest: hum of the mains, a spike, a line that dropped out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["isolated_lines"]

_CLEARLY = 4.5
"""Standard deviations that noise alone practically never reaches."""
_ALONE = 5.0
"""How far a bad line stands out of its neighbours; a misplaced resonance raises these too."""
_NEIGHBOURS = (2, 3, 4)
"""How many lines away the neighbours are that a bad line is held against; so two lines beside each other are found."""
_MOST = 0.05
"""Part of all lines above which they are no longer a few, and none is called bad."""


def isolated_lines(size: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Find the lines whose residual stands alone.

    Parameters
    ----------
    size : (n_freq,) array
        Size of each line's residual over its standard deviation.

    Returns
    -------
    (n_freq,) bool array
    """
    reach = max(_NEIGHBOURS)
    padded = np.pad(size, reach, mode="reflect") if len(size) > reach else np.pad(size, reach, mode="edge")
    shifts = [sign * distance for distance in _NEIGHBOURS for sign in (-1, 1)]
    around = np.max([padded[reach + shift : reach + shift + len(size)] for shift in shifts], axis=0)
    found = size > np.maximum(_CLEARLY, _ALONE * np.maximum(around, 1.0))
    return found if found.mean() <= _MOST else np.zeros_like(found)
