"""A structure that depends on the amplitude: in measurements at several levels, or within a single one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly.variants import repetitions
from dovetail.frf.resonances import Resonances, fit_resonances
from dovetail.inference.adequacy.model_causes import Candidate
from dovetail.inference.adequacy.quick_fits import QuickFit, QuickFits


@dataclass(frozen=True)
class Settings:
    """Which growths of the damping within a measurement are tried, and what is worth naming."""

    growths: tuple[float, ...] = (1.0, 3.0, 9.0)
    """First values of the damping that is added at the peak, over that of the strongest resonance at no amplitude."""
    narrowings: int = 3
    """Number of times that the step between such values is halved."""
    promising: float = 0.05
    """Decrease of the misfit that the best of the first values must reach for others to be tried between them."""
    other_damping: float = 1.1
    """Ratio of damping ratios at two levels that is worth naming."""
    passes: int = 2
    """Fits for each growth: the resonance of the first is that of the average amplitude."""


_SETTINGS = Settings()


def try_levels(fits: QuickFits) -> Iterator[Candidate]:
    """Yield the fit in which each of several measurements at one point, as at levels of force, is fitted alone."""
    level = repetitions(fits.assembly)
    if not level.max():
        return
    fitted_by_number, resonances = dict[int, NDArray[np.complex128]](), list[Resonances]()
    for numbers in (np.flatnonzero(level == one).tolist() for one in range(level.max() + 1)):
        part = fits.with_responses(numbers)
        theta = part.fit(part.problem, [fits.best, fits.shape]).theta
        fitted = part.target.split(part.values(theta))
        fitted_by_number |= dict(zip(numbers, fitted, strict=True))
        resonances.append(fit_resonances(part.target.frfs, fitted))
    words = f"each of {len(resonances)} measurements at one point fitted alone"
    if all(len(found.poles) for found in resonances):
        words += _drift(resonances)
    fitted_alone = np.concatenate([fitted_by_number[number] for number in range(len(level))])
    yield "level", f"{words} (does it depend on the amplitude?)", fits.judged(fits.best, fitted_alone)


def _drift(resonances: Sequence[Resonances]) -> str:
    """Return how the strongest resonance of the first level changes up to the last."""
    first = _strongest(resonances[0])
    poles = resonances[-1].poles
    last = complex(poles[np.argmin(np.abs(poles.real - first.real))])
    ratios = first.imag / abs(first), last.imag / abs(last)
    words = f", a resonance from {first.real:.5g} to {last.real:.5g} Hz"
    factor = ratios[1] / ratios[0]
    if max(factor, 1.0 / factor) < _SETTINGS.other_damping:
        return words
    change = f"{factor:.2g} times as much" if factor > 1.0 else f"{1.0 / factor:.2g} times less"
    return f"{words}, and its damping ratio from {100.0 * ratios[0]:.2g} to {100.0 * ratios[1]:.2g} %, {change}"


def _strongest(resonances: Resonances) -> complex:
    return complex(resonances.poles[np.argmax(np.abs(resonances.near[0]).max(axis=1))])


def try_damping_growth(fits: QuickFits) -> Iterator[Candidate]:
    """Yield the fit in which the damping of the strongest resonance grows with the amplitude of the displacement.

    The force is the same on all lines. A measurement corrected for this growth is fitted by the model: its damping is
    that at no amplitude.
    """
    if len(fits.target.frfs) > 1 or not fits.target.frfs[0].has_phase or len(fits.target.frequency) < 2:
        return
    tried = [(growth, _without_growth(fits, growth)) for growth in _SETTINGS.growths]
    promising = [(growth, quick) for growth, quick in tried if quick is not None]
    if not promising or min(quick.misfit for _, quick in promising) > fits.unchanged.misfit - _SETTINGS.promising:
        return
    for halving in range(1, _SETTINGS.narrowings + 1):
        best, step = min(promising, key=lambda pair: pair[1].misfit)[0], 3.0 ** (0.5**halving)
        nearer = [(growth, _without_growth(fits, growth)) for growth in (best / step, best * step)]
        promising += [(growth, quick) for growth, quick in nearer if quick is not None]
    growth, quick = min(promising, key=lambda pair: pair[1].misfit)
    words = f"damping {1.0 + growth:.2g} times as large at the peak as at small amplitudes (does it depend on these?)"
    yield "level", words, quick


def _without_growth(fits: QuickFits, growth: float) -> QuickFit | None:
    """Fit the model to the measurement without the growth of its strongest resonance's damping; None without one."""
    frf, theta = fits.target.frfs[0], fits.unchanged.theta
    amplitude = np.abs(frf.to("receptance").values)
    part, quick = amplitude / amplitude.max(), None
    for number in range(_SETTINGS.passes):
        values = fits.values(theta)
        resonances = fit_resonances([frf], [values])
        if not len(resonances.poles):
            return None
        row = int(np.argmax(np.abs(resonances.near[0]).max(axis=1)))
        pole, near = complex(resonances.poles[row]), resonances.near[0][row]
        if number == 0:  # the damping of the plain fit is about that of the peak
            least = complex(pole.real, pole.imag / (1.0 + growth))
            near = near * (frf.frequency - pole) / (frf.frequency - least)
            values, pole = values - resonances.near[0][row] + near, least
        distance = frf.frequency - pole
        added = near * (distance / (distance - 1j * growth * pole.imag * part) - 1.0)
        corrected = replace(frf, values=frf.values * values / (values + added))
        quick = fits.fit(fits.problem.with_frfs([corrected]), [theta])
        theta = quick.theta
    return quick
