"""Causes of a misfit: single changes of measurement or model, ranked by how much better the model fits with them.

For each change that is tried, the joint's parameters are fitted anew.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice, takewhile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.frf import QUANTITIES, Frf
from dovetail.inference.adequacy import level_causes, model_causes
from dovetail.inference.adequacy.model_causes import Candidate
from dovetail.inference.adequacy.perturbations import Perturbation
from dovetail.inference.adequacy.quick_fits import QuickFit, QuickFits
from dovetail.inference.adequacy.verdict import Cause
from dovetail.inference.fitting import Fit
from dovetail.inference.fitting.fit import without
from dovetail.interfaces import Progress, silent
from dovetail.meanwhile import in_turn
from dovetail.problem import Problem


@dataclass(frozen=True)
class Settings:
    """What is tried, and when a cause is named."""

    most: int = 3
    """Largest number of causes that are named; readers do not take in more."""
    noise: float = 0.6
    """Misfit of noise: mean of log(1 + x) for an x that is distributed exponentially."""
    measurement_improvement: float = 0.3
    """Decrease of the misfit from which a cause in the measurement is named: typical residuals fall by 14 %."""
    model_improvement: float = 0.6
    """The same for a cause in the model, which gains from any additional freedom: typical residuals fall by 26 %."""
    part_improvement: float = 0.7
    """Share of the misfit beyond noise that another value of a part's quantity must remove."""
    share: float = 0.4
    """Share of the misfit beyond noise whose removal suffices, if it is less than the decreases above."""
    least: float = 0.1
    """Decrease of the misfit below which no cause is named."""
    least_share: float = 0.1
    """Share of the misfit beyond noise below which no cause is named."""
    tie: float = 5.0
    """Decreases of the sum over all lines that differ by less count as equal, since noise makes such differences. Of
    equal causes the one tried first is named first."""
    narrow: float = 1.5
    """Ratio of the highest to the lowest frequency below which a reversed sign is compared with a delay."""
    share_of_best: float = 0.5
    """Share of the best improvement that each further cause must reach."""
    explained: float = 0.05
    """Misfit beyond noise at which the search ends, if the cause is one that is named. On 300 lines, usually the
    fewest that are compared, it is twice the standard deviation of the misfit of noise."""
    gain: float = 0.05
    """Relative error of the gain that is worth naming."""
    phase: float = 0.02
    """Error of the phase [rad] at the highest frequency that is worth naming."""
    unit: float = 0.03
    """Logarithm by which a gain may differ from the factor of a usual mistake of units."""
    gross_unit: float = 0.25
    """The same for factors above 3: with a rough model, the gain is not known more precisely."""
    uncertain_unit: float = 1.6
    """The same where the gain itself is tried too: with wrong parameters of the joint, it is known only within a
    factor of five."""
    delays: int = 400
    """Delays that are compared, up to two periods of the highest frequency either way."""
    quantities: int = 4
    """Number of quantities of parts that are fitted: those whose effect is most like the residuals."""
    step: float = 1e-4
    """Logarithm of the ratio of two values of a quantity between which this effect is computed."""
    overhangs: tuple[float, ...] = (-0.1, 0.1)
    """Starting values of the fit of an overhang, as logarithms of its ratio to the described one."""


_SETTINGS = Settings()

CAUSE_SECONDS = 20.0
"""Time after which nothing new is tried, by default."""

_UNITS: tuple[tuple[float, str], ...] = (
    (9.80665, "g and m/s^2"),
    (4.44822, "N and lbf"),
    (25.4, "mm and inches"),
    (39.3701, "inches and m"),
    (1e3, "mm and m, or N and kN"),
    (1e6, "micrometres and m"),
    (2.0 * np.pi, "rad/s and Hz"),
    (2.0, "peak and peak to peak"),
    (np.sqrt(2.0), "peak and RMS"),
)

_LOG = logging.getLogger(__name__)


def find_causes(
    problem: Problem,
    fit: Fit,
    *,
    seconds: float = CAUSE_SECONDS,
    progress: Progress = silent,
) -> tuple[Cause, ...]:
    """Return the causes with which the model fits clearly better, the best first; none if no change helps enough.

    Parameters
    ----------
    problem : Problem
    fit : Fit
        Of the same measurement.
    seconds : float
        Time after which no further change is tried; with 0 none is tried at all.
    progress : Progress

    Notes
    -----
    The misfit (`QuickFit`) is computed on few lines, among them those around each resonance. A cause in the
    measurement is named if the misfit falls by 0.3, one in the model if it falls by 0.6, and either if the misfit
    beyond noise falls by 40 %; for a quantity of a part it must fall by 70 %. Each cause must improve the fit at
    least half as much as the best one. If the measured structure delivers power, only changes that turn the phase
    are tried, and the better of a reversed sign and a conjugated phase is named in any case.
    """
    if not seconds:
        return ()
    limit = problem.limit.at_most(seconds)
    fits = QuickFits(problem.within(limit), fit)
    before = fits.unchanged
    excess = before.misfit - _SETTINGS.noise
    improvements: list[tuple[float, Cause]] = []

    def explained() -> bool:
        enough = [size for size, cause in improvements if size >= _needed(cause.name, excess, fits.is_active)]
        return _is_noise(before.misfit - max(enough, default=-np.inf))

    for candidate in _candidates(fits, progress, explained):
        improvement, cause = _improvement(before, candidate)
        _LOG.debug("cause tried: %s; residuals smaller by a factor of %.3g", cause.words, cause.residual_factor)
        improvements.append((improvement, cause))
    progress("causes", len(_STAGES), len(_STAGES))
    named = _named(improvements, excess, fits.lines, fits.is_active)
    tried, axis = {cause.name for _, cause in improvements}, fits.target.frequency
    if not named or named[0].name != "sign" or "delay" in tried or axis.max() > _SETTINGS.narrow * axis.min():
        return named
    for candidate in _delays(fits):
        improvements.append(_improvement(before, candidate))
        return _sign_or_delay(improvements, _named(improvements, excess, fits.lines, fits.is_active), fits.lines)
    return named


def _improvement(before: QuickFit, candidate: Candidate) -> tuple[float, Cause]:
    """Return the decrease of the misfit by a candidate, and the cause that it would be."""
    name, words, quick = candidate
    improvement = before.misfit - quick.misfit
    factor = float(np.exp(improvement / 2.0))
    coherence, theta = (before.coherence, quick.coherence), tuple(quick.theta.tolist())
    return improvement, Cause(name, words, coherence, factor, theta, quick.residual)


def _sign_or_delay(improvements: list[tuple[float, Cause]], named: tuple[Cause, ...], lines: int) -> tuple[Cause, ...]:
    """Return the causes that are named once a delay, tried last, is compared with a reversed sign.

    A delay that explains more stands first. One that explains as much is not a second cause but another reading of the
    first; one that explains less is left out, since a reversed sign is simpler.
    """
    sizes = {id(cause): size for size, cause in improvements}
    delay, without = improvements[-1][1], tuple(cause for cause in named if cause.name != "delay")
    if not without or without[0].name != "sign":
        return named
    more = (sizes[id(delay)] - sizes[id(without[0])]) * lines
    if more > _SETTINGS.tie:
        return named
    if more < -_SETTINGS.tie:
        return without
    words = f"{without[0].words} (or {delay.words}: over so narrow a band the two are equal)"
    return replace(without[0], words=words), *without[1:]


def _named(improvements: list[tuple[float, Cause]], excess: float, lines: int, is_active: bool) -> tuple[Cause, ...]:
    """Return the causes that improve the fit enough, of each kind only the best, the best first."""
    enough = [(size, cause) for size, cause in improvements if size >= _needed(cause.name, excess, is_active)]
    best = max((size for size, _ in enough), default=0.0)
    enough.sort(key=lambda item: -min(item[0], best - _SETTINGS.tie / lines))
    named: dict[str, Cause] = {}
    for improvement, cause in enough:
        if improvement >= best - _SETTINGS.share_of_best * abs(best):
            named.setdefault(cause.name, cause)
    return tuple(list(named.values())[: _SETTINGS.most])


def _is_noise(misfit: float) -> bool:
    return misfit < _SETTINGS.noise + _SETTINGS.explained


def _needed(name: str, excess: float, is_active: bool) -> float:
    """Return the decrease of the misfit that a cause of this kind must reach to be named."""
    if is_active and name in _PHASES:
        return -np.inf
    if name == "part":
        return max(_SETTINGS.least, _SETTINGS.part_improvement * excess)
    improvement = _SETTINGS.measurement_improvement if name in _IN_MEASUREMENT else _SETTINGS.model_improvement
    return max(_SETTINGS.least, _SETTINGS.least_share * excess, min(improvement, _SETTINGS.share * excess))


_PHASES = {"sign", "conjugate"}
_IN_MEASUREMENT = {"sign", "order", "conjugate", "gain", "unit", "quantity", "delay", "window"}
_FINISHED = 3
"""Number of the first stages that are always completed: a gain and a mass, which may have the same effect, are then
both named."""


def _candidates(fits: QuickFits, progress: Progress, explained: Callable[[], bool]) -> Iterator[Candidate]:
    """Yield possible causes with the fit of each, the quickest to try first, until one explains the misfit."""
    for number, (note, stage, turns_phase) in enumerate(_STAGES):
        if fits.is_active and not turns_phase:
            continue
        progress("causes", number, len(_STAGES), note)
        for candidate in stage(fits):
            yield candidate
            if fits.late or (number >= _FINISHED and explained()):
                return
        if fits.late or explained():
            return


def _phases(fits: QuickFits) -> Iterator[Candidate]:
    if not _has_phase(fits):
        return
    starts, frfs = fits.starts, fits.target.frfs
    for name, words, change in (
        ("sign", "the sign reversed", np.negative),
        ("conjugate", "the phase conjugated", np.conj),
    ):
        changed = [replace(frf, values=change(frf.values)) for frf in frfs]
        yield name, words, fits.fit(fits.problem.with_frfs(changed), starts)
    labels = fits.assembly.description.response_labels if len(frfs) > 1 else ()
    for number, label in enumerate(labels):
        signs = np.where(np.arange(len(frfs)) == number, -1.0, 1.0)
        changed = [replace(frf, values=sign * frf.values) for frf, sign in zip(frfs, signs, strict=True)]
        yield "sign", f"the sign at {label} reversed", fits.fit(fits.problem.with_frfs(changed), starts)


def _gains_and_masses(fits: QuickFits) -> Iterator[Candidate]:
    yield from _gains(fits)
    yield from _perturbed(fits, [each for each in fits.perturbations if each.kind == "mass"])


def _gains(fits: QuickFits, power: int = 0) -> Iterator[Candidate]:
    frfs = _times(fits.target.frfs, lambda axis: (2j * np.pi * axis) ** -power)
    change = np.ones(len(fits.target.frequency), dtype=np.complex128)
    free, gain = fits.fit_freely(frfs, [fits.best, fits.shape], change)
    for factor, unit in _factors(gain):
        if not power and abs(np.log(factor)) < np.log1p(_SETTINGS.gain):
            continue
        corrected = [replace(frf, values=frf.values / factor) for frf in frfs]
        words = _as_gain(factor, unit) if abs(np.log(factor)) >= np.log1p(_SETTINGS.gain) else ""
        quick = fits.fit(fits.problem.with_frfs(corrected), [free.theta, fits.shape])
        if power:
            quantity = fits.recorded[0]
            actual = QUANTITIES[QUANTITIES.index(quantity) + power]
            words = f"the values read as {actual}, not as {quantity}" + (f", and {words}" if words else "")
        yield "quantity" if power else "unit" if unit else "gain", words, quick


def _as_gain(factor: float, unit: str) -> str:
    size = f"divided by {factor:.4g}" if factor > 1.0 else f"multiplied by {1.0 / factor:.4g}"
    return f"all values {size} ({f'{unit} confused' if unit else 'calibration'}?)"


def _factors(gain: float) -> list[tuple[float, str]]:
    """Return the usual unit mistakes that explain the logarithm of a gain; if none does, the gain itself and others."""
    usual = [(known**sign, words) for known, words in _UNITS for sign in (1, -1)]
    gross = [(factor, words) for factor, words in usual if abs(np.log(factor)) > np.log(3.0)]

    def within(factors: list[tuple[float, str]], limit: float) -> list[tuple[float, str]]:
        return [(factor, words) for factor, words in factors if abs(np.log(factor) - gain) < limit]

    near = within(usual, _SETTINGS.unit) or within(gross, _SETTINGS.gross_unit)
    return near or [(float(np.exp(gain)), ""), *within(gross, _SETTINGS.uncertain_unit)]


def _quantities(fits: QuickFits) -> Iterator[Candidate]:
    """Try another quantity if the ratio of measurement to model follows a power of the frequency."""
    if len(fits.target.frequency) < 2:
        return
    ratio = np.log(fits.target.amplitude / np.abs(fits.values(fits.shape)))
    axis = np.log(fits.target.frequency)
    low, high = np.array_split(np.argsort(axis), 2)
    span = float(np.median(axis[high]) - np.median(axis[low]))
    power = int(np.clip(np.round((np.median(ratio[high]) - np.median(ratio[low])) / max(span, 1e-9)), -2, 2))
    quantities = {QUANTITIES.index(quantity) + power for quantity in fits.recorded}
    if power and all(0 <= index < len(QUANTITIES) for index in quantities):
        yield from _gains(fits, power)


def _delays(fits: QuickFits) -> Iterator[Candidate]:
    if not _has_phase(fits):
        return
    angular = 2.0 * np.pi * fits.target.frequency
    change = np.asarray(-1j * angular / angular.max())
    guesses = []
    for start in fits.starts:
        phase = np.angle(fits.target.values * np.conj(fits.values(start)))
        grid = np.linspace(-4.0 * np.pi, 4.0 * np.pi, _SETTINGS.delays)
        agreement = np.cos(phase + np.outer(grid, angular / angular.max())).mean(axis=1)
        guesses.append((float(agreement.max()), float(grid[np.argmax(agreement)]), start))
    _, amount, start = max(guesses, key=lambda guess: guess[0])

    def corrected(amount: float) -> list[Frf]:
        return _times(fits.target.frfs, lambda axis: np.exp(2j * np.pi * amount * axis / angular.max()))

    free, rest = fits.fit_freely(corrected(amount), [start], change)
    amount += rest
    if abs(amount) > _SETTINGS.phase:
        words = f"a delay of {1e6 * amount / angular.max():.3g} microseconds taken out"
        yield "delay", words, fits.fit(fits.problem.with_frfs(corrected(amount)), [free.theta])


def _overhangs(fits: QuickFits) -> Iterator[Candidate]:
    overhangs = [each for each in fits.perturbations if each.kind == "overhang"]
    yield from _perturbed(fits, overhangs, _SETTINGS.overhangs)


def _parts(fits: QuickFits) -> Iterator[Candidate]:
    """Try the quantities of parts whose effect is most like the residuals."""
    parts = takewhile(lambda _: not fits.late, (p for p in fits.perturbations if p.kind == "part"))
    yield from _perturbed(fits, sorted(parts, key=lambda p: -_alignment(fits, p))[: _SETTINGS.quantities])


def _alignment(fits: QuickFits, perturbation: Perturbation) -> float:
    """Return |cos| of the angle between residuals and a perturbation's effect, both without what the joint can do."""
    theta, residual = fits.unchanged.theta[np.newaxis], fits.residual()
    frf, jacobian = fits.problem.model.frf_by_fractions(theta)
    changed = fits.problem.with_model(perturbation.apply(_SETTINGS.step))
    ahead = residual.of(changed.frf_at(theta[0])[np.newaxis])[0]
    residuals = residual.of(frf)[0]
    change, remainder = without(np.stack([ahead - residuals, residuals]), residual.jacobian(frf, jacobian)[0])
    return float(
        abs(change @ remainder) / max(np.linalg.norm(change) * np.linalg.norm(remainder), np.finfo(float).tiny)
    )


def _perturbed(
    fits: QuickFits, perturbations: Sequence[Perturbation], amounts: tuple[float, ...] = (0.0,)
) -> Iterator[Candidate]:
    """Fit the joint together with the amount of each perturbation; yield of each the best fit from several amounts."""
    tasks = [(perturbation, amount) for perturbation in perturbations for amount in amounts]
    fitted = in_turn(partial(_with_amount, fits), tasks, lambda: fits.problem.limit.was_stopped)
    for _ in perturbations:
        found = [candidate for candidate in islice(fitted, len(amounts)) if candidate is not None]
        yield from sorted(found, key=lambda candidate: candidate[2].misfit)[:1]


def _with_amount(fits: QuickFits, start: tuple[Perturbation, float]) -> Candidate | None:
    """Fit the joint together with the amount of a perturbation; None if that is negligible, or time is over."""
    perturbation, first = start
    if fits.late:
        return None
    try:
        perturbed, theta = perturbation.apply(first), fits.unchanged.theta
        amount, theta = fits.fit_amount(perturbation, fits.search(perturbed, theta) if first else theta, first)
        if abs(amount) < perturbation.negligible:
            return None
        quick = fits.fit(fits.problem.with_model(perturbation.apply(amount)), [theta])
    except (DovetailError, np.linalg.LinAlgError):
        return None
    return perturbation.kind, perturbation.describe(amount), quick


def _times(frfs: Sequence[Frf], factor: Callable[[NDArray[np.float64]], Any]) -> list[Frf]:
    """Return FRFs multiplied by a function of the frequency [Hz]."""
    return [replace(frf, values=frf.values * factor(frf.frequency)) for frf in frfs]


def _has_phase(fits: QuickFits) -> bool:
    return all(frf.has_phase for frf in fits.target.frfs)


_STAGES: tuple[tuple[str, Callable[[QuickFits], Iterator[Candidate]], bool], ...] = (
    ("sign and phase", _phases, True),
    ("order of measurements", model_causes.try_exchanges, True),
    ("gain, units and mass", _gains_and_masses, False),
    ("quantity", _quantities, True),
    ("delay", _delays, True),
    ("levels", level_causes.try_levels, False),
    ("damping of joints", model_causes.try_damping, False),
    ("window", model_causes.try_window, False),
    ("growth of damping", level_causes.try_damping_growth, False),
    ("ranges", model_causes.try_ranges, False),
    ("resonances", model_causes.try_missing_resonances, False),
    ("response point", model_causes.try_points, True),
    ("overhang", _overhangs, False),
    ("parts", _parts, False),
)
"""The stages in their order: a note for the progress, the function, and whether it turns the phase of an FRF."""
