"""Natural frequencies within an assembly's band, or the reason why there are none."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly.assembly import Assembly
from dovetail.assembly.parameters import Theta
from dovetail.errors import DovetailError

__all__ = ["natural_in_band"]


def natural_in_band(assembly: Assembly, theta: Theta = None, *, count: int) -> tuple[NDArray[np.float64], str]:
    """Return those of the `count` lowest natural frequencies [Hz] that lie within the assembly's frequencies.

    Returns
    -------
    natural : (n,) array
        Hz, increasing. Empty where a part has no matrices.
    reason : str
        Why there are none; empty where there are some.
    """
    try:
        natural = assembly.natural_frequencies(theta, count=count)
    except DovetailError as error:
        return np.empty(0), error.faults[0].problem
    inside = natural[(natural >= assembly.frequency[0]) & (natural <= assembly.frequency[-1])]
    return inside, "" if inside.size else "none lies within the frequencies"
