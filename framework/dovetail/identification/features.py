"""From the amplitude of an FRF to the features the network sees."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dovetail.frf import Frf

__all__ = ["accelerance_amplitudes", "log10p1"]


def accelerance_amplitudes(measured: Sequence[Frf]) -> NDArray[np.float64]:
    """Return the accelerance's amplitudes of all responses beside each other, as one row (1, n_responses n_freq)."""
    return np.concatenate([frf.to("accelerance").amplitude for frf in measured])[np.newaxis]


def log10p1(amplitude: NDArray[np.floating], out: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
    """Return log10(x + 1) of the accelerance's amplitude, in single precision (Eq. 12).

    Parameters
    ----------
    amplitude : (..., n_freq) array
        m/(N s^2), not negative.
    out : (..., n_freq) float32 array, optional
        Where to write the features; `amplitude` itself, if it is single precision.

    Returns
    -------
    (..., n_freq) float32 array
    """
    features = np.asarray(np.log1p(amplitude, out=out, dtype=np.float32), dtype=np.float32)
    features *= np.float32(1.0 / np.log(10.0))
    return features
