"""Measurements with noise, shared by the tests of identification."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import dovetail
from dovetail.measurement import noisy_frf


def frf_on(frequency: np.ndarray, quantity: dovetail.frf.frequency_response.Quantity = "receptance") -> dovetail.Frf:
    """Return an FRF of this quantity that is 1 at each frequency."""
    return dovetail.Frf(frequency, np.ones(len(frequency)), quantity)


def noisy(
    assembly: dovetail.Assembly,
    values: np.ndarray,
    level: float = 0.01,
    seed: int = 0,
    *,
    has_phase: bool = True,
    known: bool = True,
    label: str = "",
) -> dovetail.Frf:
    """Return an FRF with complex noise of `level` times its own standard deviation, which it states if `known`."""
    quantity = assembly.description.response.quantity
    frf = noisy_frf(dovetail.Frf(assembly.frequency, values, quantity, label=label), level, seed)
    shown = frf.values if has_phase else frf.amplitude
    return replace(frf, values=shown, has_phase=has_phase, variance=frf.variance if known else None)
