"""Measurements with noise, shared by the tests of identification."""

from __future__ import annotations

import numpy as np

import dovetail


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
    deviation = level * values.std()
    normal = np.random.default_rng(seed).standard_normal((2, len(values)))
    shown = values + deviation * (normal[0] + 1j * normal[1]) / np.sqrt(2)
    variance = np.full(len(values), deviation**2) if known else None
    quantity = assembly.description.response.quantity
    shown = shown if has_phase else np.abs(shown)
    return dovetail.Frf(assembly.frequency, shown, quantity, has_phase=has_phase, variance=variance, label=label)
