"""The training and the test part of a dataset in memory."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.dataset import Dataset
from dovetail.errors import DatasetError
from dovetail.identification.scaling import blocks
from dovetail.interfaces import Progress

__all__ = ["read_parts"]


def read_parts(
    dataset: Dataset, is_test: NDArray[np.bool_], progress: Progress, *, phase: bool = False
) -> tuple[NDArray[Any], NDArray[np.float32]]:
    """Read a dataset's FRFs once, each into its final place.

    Parameters
    ----------
    dataset : Dataset
    is_test : (n_samples,) bool array
    progress : callable
    phase : bool
        Read the training FRFs with their phases.

    Returns
    -------
    training : (n, n_responses n_freq) array
        float32 amplitudes, or complex64 [m/(N s^2)].
    test : (n, n_responses n_freq) float32 array
        Amplitudes.

    Raises
    ------
    DatasetError
        An FRF is not finite, a chunk is damaged, or phases are asked for and not stored.
    """
    width = dataset.amplitude.shape[1]
    stored, dtype = (dataset.accelerance, np.complex64) if phase else (dataset.amplitude, np.float32)
    training = np.empty((np.count_nonzero(~is_test), width), dtype=dtype)
    test = np.empty((np.count_nonzero(is_test), width), dtype=np.float32)
    trained = tested = 0
    for rows in blocks(len(dataset)):
        frfs = np.asarray(stored[rows], dtype=dtype)
        if not np.isfinite(frfs).all():
            raise DatasetError(
                f"the dataset holds amplitudes that are not finite, in samples {rows.start}-{rows.stop}."
            )
        chosen, others = frfs[is_test[rows]], frfs[~is_test[rows]]
        test[tested : tested + len(chosen)] = np.abs(chosen)
        training[trained : trained + len(others)] = others
        tested, trained = tested + len(chosen), trained + len(others)
        progress("features", rows.stop, len(dataset))
    return training, test
