"""Reduced features of many FRFs, block by block."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, PluginError
from dovetail.identification.contracts import checked_rows
from dovetail.identification.scaling import blocks
from dovetail.interfaces import FittedReducer, Progress, blamed_on, silent

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
        with blamed_on(reducer, f"reducer '{name}'"):
            part = reducer.transform(features[rows])
        part = checked_rows(part, f"reducer '{name}'", rows.stop - rows.start, reduced.shape[1] or None)
        if not np.isfinite(part).all():
            raise PluginError(Fault(f"reducer '{name}'", "it returned features that are not finite.", "finite numbers"))
        if rows.start == 0:
            reduced = np.empty((len(features), part.shape[1]), dtype=np.float32)
        reduced[rows] = part
        progress("reduction", rows.stop, len(features))
    return reduced
