"""Causes that lie in the resonances: one that the model lacks, and damping that an exponential window adds to all."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from dovetail.identification.adequacy.trials import Trial, Trials, values_of
from dovetail.identification.fitting.search_lines import missed_resonances
from dovetail.identification.posterior.model_error import fit_resonances

__all__ = ["try_missing_resonances", "try_window"]


@dataclass(frozen=True)
class Settings:
    """How resonances are added, and which windows are tried."""

    most: int = 2
    """Resonances that are tried, the lowest first."""
    reach: float = 0.1
    """Part of its frequency up to which lines determine an added resonance."""
    fewest_lines: int = 8
    """That determine one."""
    damping: float = 0.01
    """Loss factor from which its search starts."""
    windows: tuple[float, ...] = (0.1, 0.3, 1.0, 3.0)
    """Damping that a window adds, over that of the least damped resonance, from which its search starts."""
    narrowings: int = 3
    """Times that the step between such values is halved."""


_SETTINGS = Settings()

Candidate = tuple[str, str, Trial]


def try_missing_resonances(trials: Trials) -> Iterator[Candidate]:
    """Yield the fit with a resonance added where the measurement has one and the model has none."""
    theta = trials.unchanged.theta
    values, measured = trials.values(theta), values_of(trials.target.frfs)
    if len(trials.target.frfs) > 1 or not trials.target.frfs[0].has_phase:
        return
    missed = missed_resonances(trials.target, trials.relative * np.abs(measured) ** 2, values)
    for frequency in np.sort(missed)[: _SETTINGS.most].tolist():
        added = _added_resonance(trials.target.frequency, measured, values, frequency)
        if added is not None:
            words = f"a resonance at {frequency:.4g} Hz that the model does not have"
            yield "resonance", words, trials.judged(theta, values + added)


def _added_resonance(
    frequency: NDArray[np.float64], measured: NDArray[np.complex128], values: NDArray[np.complex128], at: float
) -> NDArray[np.complex128] | None:
    """Return what a resonance adds to a model's values so that they meet the measured ones around it."""
    near = np.abs(frequency - at) < _SETTINGS.reach * at
    if np.count_nonzero(near) < _SETTINGS.fewest_lines:
        return None
    left, size = (measured - values)[near], np.abs(measured[near])

    def shape(logarithms: NDArray[np.float64], axis: NDArray[np.float64]) -> NDArray[np.complex128]:
        natural, loss = np.exp(logarithms)
        return np.asarray(1.0 / (natural**2 * (1.0 + 1j * loss) - axis**2))

    def added(logarithms: NDArray[np.float64]) -> tuple[complex, NDArray[np.complex128]]:
        column = shape(logarithms, frequency[near]) / size
        residue = complex(np.vdot(column, left / size) / np.vdot(column, column))
        return residue, left / size - residue * column

    def residuals(logarithms: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(added(logarithms)[1].view(np.float64))

    start = np.log([at, _SETTINGS.damping])
    found = least_squares(residuals, start, loss="soft_l1").x
    return np.asarray(added(found)[0] * shape(found, frequency))


def try_window(trials: Trials) -> Iterator[Candidate]:
    """Yield the fit with the damping taken out that an exponential window adds to all resonances alike."""
    poles = _poles(trials, trials.unchanged.theta)
    if not len(poles):
        return
    least = float(poles.imag.min())
    tried = [(added, _without_window(trials, added)) for added in (least * part for part in _SETTINGS.windows)]
    for halving in range(1, _SETTINGS.narrowings + 1):
        best = min(tried, key=lambda pair: pair[1].misfit)[0]
        step = 3.0 ** (0.5**halving)
        tried += [(added, _without_window(trials, added)) for added in (best / step, best * step)]
    added, trial = min(tried, key=lambda pair: pair[1].misfit)
    rate = 2.0 * np.pi * added
    yield "window", f"the damping of an exponential window, exp(-{rate:.3g} t/s), taken out", trial


def _poles(trials: Trials, theta: NDArray[np.float64]) -> NDArray[np.complex128]:
    axes = [frf.frequency for frf in trials.target.frfs]
    return fit_resonances(axes, trials.target.split(trials.values(theta))).poles


def _without_window(trials: Trials, added: float) -> Trial:
    """Fit the joint to the measurement less a window's damping [Hz], which the model tells at the best fit."""
    axes = [frf.frequency for frf in trials.target.frfs]
    values = trials.target.split(trials.values(trials.unchanged.theta))
    resonances = fit_resonances(axes, values)
    frfs = []
    for frf, plain, near in zip(trials.target.frfs, values, resonances.near, strict=True):
        distance = frf.frequency - resonances.poles[:, np.newaxis]
        damped = plain + (near * (distance / (distance - 1j * added) - 1.0)).sum(axis=0)
        frfs.append(replace(frf, values=frf.values * plain / damped))
    return trials.fit(trials.assembly, frfs, [trials.unchanged.theta])
