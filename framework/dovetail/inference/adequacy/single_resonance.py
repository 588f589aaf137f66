"""Errors of a model with a single resonance in the band, separated by a modal fit of the measurement.

Around one resonance the parameters of a joint follow most errors of the model: they move the resonance, and make it
higher and broader. The smooth shapes of errors over many resonances then say nothing. A resonance with a free pole,
gain and phase, and a background, is therefore fitted to the measurement itself. What the parameters cannot follow are
the errors that the measurement shows; the size of all others is unknown.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from dovetail.frf import Frf
from dovetail.frf.resonances import fit_resonances
from dovetail.frf.single_mode import UNKNOWNS, SingleMode
from dovetail.inference.fitting import Fit, refine
from dovetail.inference.posterior.model_error import TYPICAL, ModelError
from dovetail.problem import Problem
from dovetail.problem.observations import Observations


@dataclass(frozen=True)
class Settings:
    """When a measurement is taken for a single resonance, and when an error counts as determined."""

    unexplained: float = 0.05
    """Residual of the modal fit, relative to the FRF, up to which the measurement is a single resonance."""
    freedom: int = 4
    """Fewest residuals beyond the unknowns of the modal fit."""
    damping: float = 0.02
    """Damping ratio at which a modal fit begins, in addition to the model's own."""
    prior: tuple[float, float, float] = (3e-3, 0.3, 0.3)
    """Errors of natural frequency, damping and gain that are expected if parameters do not decide which of them it is:
    the largest of typical errors, and 1/100 of it for natural frequencies, which are stationary."""
    certain: float = 0.3
    """Largest standard deviation of an error, over its size, of which a number is reported. Its size is then known
    within a factor of two, with a probability of 99 %."""
    gain: float = 0.1
    """Smallest error of the gain that intervals allow for where the phase is wrong: the tolerance of sensors that are
    used with their nominal sensitivities."""
    in_intervals: float = 2.0
    """Multiple of the errors of frequency, damping, gain and phase that intervals allow for."""
    least_background: float = 1e-6
    """Smallest background that they allow for."""
    largest_phase: float = 1.0
    """Phase [rad] beyond which it is another sign or another quantity, and no error of a phase."""
    negligible: float = 1e-6
    """Ratio of singular values below which a combination of parameters has no effect."""
    step: float = 1e-4
    """Difference of a parameter, in parts of its range, by which features of the model are differentiated."""


_SETTINGS = Settings()


@dataclass(frozen=True, eq=False)
class SeparatedErrors:
    """What the measurement of a single resonance shows of the errors of its model.

    Parameters
    ----------
    theta : (p,) array
        SI; the parameters that fit best once phase and background of the measurement are corrected.
    size : ModelError
        NaN for each kind that the measurement does not determine.
    in_intervals : ModelError
        What intervals allow for.
    phases : tuple of float
        By which the measurement at each response is ahead of the model [rad]; empty where that is unknown.
    """

    theta: NDArray[np.float64]
    size: ModelError
    in_intervals: ModelError
    phases: tuple[float, ...]


def separate_errors(problem: Problem, fit: Fit) -> SeparatedErrors | None:
    """Separate the errors of a model with a single resonance in the band; None if there are more, or if that fails.

    Parameters
    ----------
    problem : Problem
    fit : Fit
        That does not reach the noise. Parameters that no search found, such as a plugin's, are judged as they are.
    """
    if not fit.steps:
        return None
    target = problem.observations
    at_fit = target.split(problem.frf_at(fit.theta))
    if not all(frf.has_phase for frf in target.frfs) or _single_pole(target.frfs, at_fit) is None:
        return None
    measured = _modal_fits(target.frfs, target, fit, at_fit)
    if measured is None or not _explain(measured):
        return None
    described = _modal_fits(_with_values(target.frfs, at_fit), target, fit, at_fit)
    if described is None:
        return None
    turns = [one.features[3] - other.features[3] for one, other in zip(measured, described, strict=True)]
    phases = np.angle(np.exp(1j * np.array(turns)))
    if np.abs(phases).max() > _SETTINGS.largest_phase:
        return None
    if not np.isfinite(_known_phase(phases, measured)):
        return None  # phase and background explain each other
    theta = _refitted(problem, fit, fit.theta, measured, np.exp(1j * phases))
    remaining = _errors_that_parameters_leave(problem, fit, theta, measured)
    if remaining is None:
        return None
    errors, deviations = remaining
    gain = _if_certain(_rms(errors[2:]), _rms(deviations[2:]))
    if np.isfinite(gain):
        theta = _refitted(problem, fit, theta, measured, np.exp(errors[2:] + 1j * phases))
    sizes = [_if_certain(abs(error), deviation) for error, deviation in zip(errors[:2], deviations[:2], strict=True)]
    return _separated(target, theta, measured, phases, ModelError(sizes[0], damping=sizes[1], magnitude=gain))


def _refitted(
    problem: Problem,
    fit: Fit,
    start: NDArray[np.float64],
    measured: Sequence[SingleMode],
    factors: NDArray[np.complex128],
) -> NDArray[np.float64]:
    """Return the parameters (p,) [SI] that fit best without the backgrounds, and without a factor of each FRF."""
    target = problem.observations
    parts = zip(target.frfs, measured, factors, target.split(fit.variance), strict=True)
    corrected = [
        replace(frf, values=(frf.values - one.background) / factor, variance=variance / abs(factor) ** 2)
        for frf, one, factor, variance in parts
    ]
    return refine(problem.with_frfs(corrected), [start]).theta


def _single_pole(frfs: Sequence[Frf], values: Sequence[NDArray[np.complex128]]) -> complex | None:
    """Return the pole [Hz] of FRFs if exactly one lies within the band."""
    poles = fit_resonances(frfs, values).poles
    low, high = min(frf.frequency[0] for frf in frfs), max(frf.frequency[-1] for frf in frfs)
    inside = poles[(poles.real > low) & (poles.real < high)]
    return complex(inside[0]) if len(inside) == 1 else None


def _with_values(frfs: Sequence[Frf], values: Sequence[NDArray[np.complex128]]) -> list[Frf]:
    return [replace(frf, values=modelled) for frf, modelled in zip(frfs, values, strict=True)]


def _modal_fits(
    frfs: Sequence[Frf], target: Observations, fit: Fit, values: Sequence[NDArray[np.complex128]]
) -> list[SingleMode] | None:
    """Fit a resonance to each FRF, from its peak and from the pole of a model's values; None if lines are too few."""
    pole = _single_pole(target.frfs, values)
    if pole is None:
        return None
    fits = list[SingleMode]()
    for frf, variance, used in zip(frfs, target.split(fit.variance), target.split(fit.used), strict=True):
        if 2 * int(np.count_nonzero(used)) < UNKNOWNS + _SETTINGS.freedom:
            return None
        peak, ratio = float(frf.frequency[np.argmax(frf.amplitude)]), max(pole.imag / pole.real, 1e-6)
        starts = [(np.log(at), np.log(z)) for at in (peak, abs(pole)) for z in (ratio, _SETTINGS.damping)]
        fits.append(min((SingleMode(frf, variance, used, start) for start in starts), key=lambda one: one.cost))
    return fits


def _explain(modal: Sequence[SingleMode]) -> bool:
    """Return whether modal fits leave little, and have their resonance within the band."""
    return all(one.misfit <= _SETTINGS.unexplained and one.is_within_band for one in modal)


def _errors_that_parameters_leave(
    problem: Problem, fit: Fit, theta: NDArray[np.float64], measured: Sequence[SingleMode]
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Return the errors (2 + n,) that the parameters cannot follow, and their deviations; None if a modal fit fails.

    They are those of the logarithms of natural frequency, damping and the gain of each response.
    """
    target, fraction = problem.observations, problem.to_unit(theta)
    free = np.flatnonzero((fraction > 0.0) & (fraction < 1.0))
    points = np.concatenate([fraction[np.newaxis], fraction + _SETTINGS.step * np.eye(len(fraction))[free]])
    features = []
    for values in problem.model.frf(problem.from_unit(np.minimum(points, 1.0))):
        modelled = target.split(values)
        fits = _modal_fits(_with_values(target.frfs, modelled), target, fit, modelled)
        if fits is None:
            return None
        features.append(np.concatenate([one.features[:3] for one in fits]))
    rest = np.concatenate([one.features[:3] for one in measured]) - features[0]
    moved = np.array(features[1:]).reshape(-1, len(rest))
    slopes = (moved - features[0]).T / _SETTINGS.step
    noise = block_diag(*(one.covariance[:3, :3] for one in measured))
    count = len(measured)
    effects = np.zeros((3 * count, 2 + count))
    effects[0::3, 0] = effects[1::3, 1] = 1.0
    effects[2::3, 2:] = np.eye(count)
    prior = np.diag(np.square([*_SETTINGS.prior[:2], *(count * [_SETTINGS.prior[2]])]))
    seen = _null_space(slopes)
    if not seen.shape[1]:
        return np.zeros(2 + count), np.sqrt(np.diag(prior))
    spread = seen.T @ (effects @ prior @ effects.T + noise) @ seen
    gain = np.linalg.solve(spread, seen.T @ effects @ prior).T
    error, covariance = gain @ (seen.T @ rest), prior - gain @ seen.T @ effects @ prior
    return error, np.sqrt(np.maximum(np.diag(covariance), 0.0))


def _null_space(slopes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the directions (m, k) of features that no parameter moves, from their derivatives (m, p)."""
    if not slopes.size:
        return np.eye(len(slopes))
    directions, sizes, _ = np.linalg.svd(slopes)
    rank = int(np.count_nonzero(sizes > _SETTINGS.negligible * max(sizes.max(), 1.0)))
    return np.asarray(directions[:, rank:])


def _separated(
    target: Observations,
    theta: NDArray[np.float64],
    measured: Sequence[SingleMode],
    phases: NDArray[np.float64],
    determined: ModelError,
) -> SeparatedErrors:
    """Return what is known of each error, and what intervals allow for."""
    turned, turned_error = _rms(phases), _error_of_phases(measured)
    phase = _known_phase(phases, measured)
    levels = [float(np.median(frf.amplitude)) for frf in target.frfs]
    pairs = list(zip(measured, levels, strict=True))
    added = _rms([_rms(np.abs(mode.background)) / level for mode, level in pairs])
    added_error = _rms([mode.background_error / level for mode, level in pairs])
    size = replace(
        determined,
        phase=phase,
        background=_if_certain(added, added_error),
        other=_rms([mode.misfit for mode in measured]),
    )
    chain = max(_SETTINGS.gain, turned) if np.isfinite(phase) else 0.0
    known = replace(size, **dict.fromkeys(size.unknown, 0.0))
    typical = replace(TYPICAL, damping=_SETTINGS.in_intervals * TYPICAL.damping)  # errors of damping remain unknown
    allowed = known.times(_SETTINGS.in_intervals).at_least(typical)
    in_intervals = replace(
        allowed,
        magnitude=max(allowed.magnitude, chain),
        phase=max(allowed.phase, turned + turned_error),
        background=max(added + added_error, _SETTINGS.least_background),
        quantities=_SETTINGS.in_intervals * known.natural_frequency,
    )
    return SeparatedErrors(theta, size, in_intervals, tuple(phases.tolist()) if np.isfinite(phase) else ())


def _known_phase(phases: NDArray[np.float64], measured: Sequence[SingleMode]) -> float:
    """Return the size of the phase errors [rad], NaN where a background explains them as well."""
    return _if_certain(_rms(phases), _error_of_phases(measured))


def _error_of_phases(measured: Sequence[SingleMode]) -> float:
    return _rms([np.sqrt(one.covariance[3, 3]) for one in measured])


def _if_certain(size: float, deviation: float) -> float:
    return float(size) if deviation <= _SETTINGS.certain * size else np.nan


def _rms(values: Sequence[float] | NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
