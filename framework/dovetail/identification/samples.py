"""The training and the test part of a dataset in memory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.dataset import Dataset
from dovetail.errors import DatasetError
from dovetail.identification.scaling import blocks
from dovetail.interfaces import Progress

__all__ = ["read_parts"]


def read_parts(
    dataset: Dataset, is_test: NDArray[np.bool_], progress: Progress
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Read a dataset's amplitudes once, each into its final place.

    Parameters
    ----------
    dataset : Dataset
    is_test : (n_samples,) bool array
    progress : callable

    Returns
    -------
    training, test : (n, n_freq) float32 arrays
        m/(N s^2).

    Raises
    ------
    DatasetError
        An amplitude is not finite.
    """
    width = len(dataset.frequency)
    training = np.empty((np.count_nonzero(~is_test), width), dtype=np.float32)
    test = np.empty((np.count_nonzero(is_test), width), dtype=np.float32)
    trained = tested = 0
    for rows in blocks(len(dataset)):
        amplitude = np.asarray(dataset.amplitude[rows], dtype=np.float32)
        if not np.isfinite(amplitude).all():
            raise DatasetError(
                f"the dataset holds amplitudes that are not finite, in samples {rows.start}-{rows.stop}."
            )
        chosen, others = amplitude[is_test[rows]], amplitude[~is_test[rows]]
        test[tested : tested + len(chosen)] = chosen
        training[trained : trained + len(others)] = others
        tested, trained = tested + len(chosen), trained + len(others)
        progress("features", rows.stop, len(dataset))
    return training, test
