"""Hat functions over the frequency axis: what varies smoothly along it is a sum of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["hats"]

_PLACES = 6


def hats(frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return six hat functions (6, n_freq), each 1 at one of six equally spaced places and 0 at the others."""
    places = np.linspace(frequency[0], frequency[-1], _PLACES)
    return np.stack([np.interp(frequency, places, one) for one in np.eye(_PLACES)])
