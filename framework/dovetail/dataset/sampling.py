"""Latin hypercube samples of an assembly's parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.dataset.metadata import LARGEST_ARRAY
from dovetail.errors import DatasetError, Fault


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

    Raises
    ------
    DatasetError
        There are more samples than a dataset may have.
    """
    from dovetail.problem.definition import latin_hypercube as random_points

    check_sample_count(assembly, samples)
    random = np.random.default_rng(seed).spawn(1)[0]
    return assembly.from_unit(random_points(samples, len(assembly.parameters), random))


def check_sample_count(assembly: Assembly, samples: int) -> None:
    """Check that a dataset may have this many samples.

    Raises
    ------
    DatasetError
    """
    most = LARGEST_ARRAY // (8 * max(1, len(assembly.parameters)))
    if samples > most:
        raise DatasetError(Fault("samples", f"{samples:.4g} samples were requested.", f"at most {most:,}"))
