"""Reduced features of many FRFs, block by block."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import PluginError
from dovetail.identification.scaling import blocks
from dovetail.interfaces import FittedReducer, Progress, silent

__all__ = ["reduce_features"]


def reduce_features(
    reducer: FittedReducer, name: str, features: NDArray[np.float32], progress: Progress = silent
) -> NDArray[np.float32]:
    """Reduce features (n_samples, n_freq) to (n_samples, n_components).

    Raises
    ------
    PluginError
        The reducer, called `name`, does not return one finite row for each FRF.
    """
    reduced = np.empty((len(features), 0), dtype=np.float32)
    for rows in blocks(len(features)):
        part = reducer.transform(features[rows])
        if part.ndim != 2 or len(part) != rows.stop - rows.start:
            raise PluginError(f"reducer '{name}' made {part.shape} of {rows.stop - rows.start} FRFs, not one row each.")
        if not np.isfinite(part).all():
            raise PluginError(f"reducer '{name}' made features that are not finite.")
        if rows.start == 0:
            reduced = np.empty((len(features), part.shape[1]), dtype=np.float32)
        reduced[rows] = part
        progress("reduction", rows.stop, len(features))
    return reduced
