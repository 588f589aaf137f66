"""Latin hypercube samples of an assembly's parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly

__all__ = ["latin_hypercube"]


def latin_hypercube(assembly: Assembly, samples: int, seed: int | Sequence[int]) -> NDArray[np.float64]:
    """Draw a Latin hypercube sample of the ranges, on each parameter's scale.

    Parameters
    ----------
    assembly : Assembly
    samples : int
    seed : int or sequence of int

    Returns
    -------
    (samples, n_params) array
        SI.
    """
    from scipy.stats import qmc

    sampler = qmc.LatinHypercube(d=len(assembly.parameters), rng=np.random.default_rng(seed))
    return assembly.from_unit(sampler.random(samples))
