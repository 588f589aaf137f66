"""Explanations of a flagged measurement: the single change of the description that makes the model fit it.

Small changes are perturbations of the measurement and of the substructures. If the deviation is gross, other units,
quantities, response points, sizes of substructures and clipping are tried as well.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, islice

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from dovetail.assembly import Assembly
from dovetail.errors import DovetailError
from dovetail.frf import Frf, unit_of
from dovetail.identification.fitting import refine
from dovetail.identification.fitting.least_squares import Linearisation, minimise
from dovetail.identification.fitting.residuals import FrfResiduals, LogAmplitude, Residual
from dovetail.identification.misspecification.clipping import find_clipping
from dovetail.identification.misspecification.perturbations import Perturbation, list_perturbations
from dovetail.identification.misspecification.prior_predictive import (
    list_unit_errors,
    prior_distance,
    prior_width,
)
from dovetail.identification.misspecification.significance import Significance, assess_significance, is_negligible
from dovetail.identification.misspecification.whitened_residuals import WhitenedResiduals, whiten_residuals

__all__ = ["Explanation", "FlaggedFrf", "PerturbedResiduals", "find_explanations"]


@dataclass(frozen=True)
class Settings:
    """What is tried, and when it counts as an explanation."""

    most_named: int = 3
    """Explanations that are returned at most; more are not readable."""
    seconds: float = 60.0
    """Time after which nothing new is tried; enough for everything but on large assemblies."""
    gross: float = 10.0
    """Statistic from which other units, points and sizes are tried."""
    nearly_noise: float = 1.5
    """Statistic up to which the residuals with a change count as noise, if they are far from noise without it."""
    better: float = 0.5
    """Part of the statistic that a change leaves at most."""
    worth: float = 12.0
    """Decrease of the sum of squares that a change needs, and by which the best must be better than others."""
    first_estimate: float = 0.8
    """A perturbation is given up if its first estimate leaves more than this part of the sum of squares."""
    after_fit: float = 0.3
    """A perturbation is given up if its fit leaves more than this part, unless noise leaves as much."""
    noise: float = 1.2
    """Mean square of the residuals up to which they may be noise."""
    farthest_start: float = 0.5
    """Part of the range of an amount beyond which a first estimate, which is linear, is not trusted."""
    overhangs: tuple[float, ...] = (0.1, -0.1)
    """Log ratios from which an overhang is fitted as well: the joint compensates for small ones."""
    sizes: tuple[float, ...] = (-0.2, -0.1, -0.05, 0.05, 0.1, 0.2)
    """Log ratios of sizes that are tried if the deviation is gross."""
    most_quantities: int = 3
    """Quantities of the substructures that are fitted: those along which the residuals are most significant."""
    most_sensitive: int = 4
    """Quantities of the substructures that are tried at other sizes: those on which the FRF depends the most."""
    nearest: int = 2
    """Other points, and other sizes, that are fitted: those nearest to the measurement."""
    above_plateau: float = 1.1
    """Amplitude of the model over a plateau from which the measurement was clipped."""
    starts: int = 3
    """Random starts of the search for the joint, besides the best fit."""
    tolerance: float = 0.5
    """Decrease of the sum of squares at which a fit of joint and amount ends; its result is only a start."""
    most_steps: int = 40
    """Of such a fit."""
    step: float = 1e-5
    """Part of an amount's range by which derivatives by it are taken."""


_SETTINGS = Settings()


@dataclass(frozen=True, eq=False)
class Explanation:
    """A single change that explains a measurement.

    Parameters
    ----------
    words : str
        What it is, after "as if".
    sum_of_squares : float
        Of the whitened residuals with it.
    """

    words: str
    sum_of_squares: float


@dataclass(frozen=True, eq=False)
class FlaggedFrf:
    """A measured FRF that the model cannot have produced, and its residuals.

    Parameters
    ----------
    assembly : Assembly
    measured : Frf
        As it was read, on the assembly's frequencies.
    target : Frf
        The same in the quantity of the assembly's response.
    whitened : WhitenedResiduals
    significance : Significance
        Of these residuals.
    model_error : float
        Standard deviation of the relative error of natural frequencies that the model is allowed.
    """

    assembly: Assembly
    measured: Frf
    target: Frf
    whitened: WhitenedResiduals
    significance: Significance
    model_error: float


def find_explanations(flagged: FlaggedFrf) -> tuple[Explanation, ...]:
    """Return what explains a measurement nearly down to its noise; nothing if nothing that was tried does."""
    deadline = time.monotonic() + _SETTINGS.seconds
    explanations = list(_in_time(deadline, _try_perturbations(flagged)))
    if not explanations and flagged.significance.statistic > _SETTINGS.gross:
        explanations = list(islice(_in_time(deadline, _try_gross_changes(flagged)), 1))
    best = min((explanation.sum_of_squares for explanation in explanations), default=np.inf)
    if best > flagged.significance.sum_of_squares - _SETTINGS.worth:
        return ()
    close = [explanation for explanation in explanations if explanation.sum_of_squares <= best + _SETTINGS.worth]
    return tuple(close[: _SETTINGS.most_named])


def _in_time(deadline: float, candidates: Iterator[Explanation | None]) -> Iterator[Explanation]:
    """Yield the explanations among candidates until time is up."""
    for candidate in candidates:
        if candidate is not None:
            yield candidate
        if time.monotonic() > deadline:
            return


def _try_perturbations(flagged: FlaggedFrf) -> Iterator[Explanation | None]:
    """Try small changes: of the measurement, of the overhangs, and of other quantities of the substructures."""
    significance, perturbations = flagged.significance, list_perturbations(flagged.assembly)
    of_measurement = [p for name in ("mass", "axis", "gain") for p in perturbations if p.name == name]
    structural = [p for p in perturbations if p.of_substructure]
    structural.sort(key=lambda p: -abs(significance.deviations[p.name]))
    overhangs = [p for p in structural if p.is_overhang]
    quantities = [p for p in structural if not p.is_overhang][: _SETTINGS.most_quantities]
    for perturbation in chain(of_measurement, overhangs, quantities):
        further = _SETTINGS.overhangs if perturbation.is_overhang else ()
        starts = (significance.amounts[perturbation.name], *further)
        yield next(filter(None, (_fit_perturbation(flagged, perturbation, amount) for amount in starts)), None)


def _try_gross_changes(flagged: FlaggedFrf) -> Iterator[Explanation | None]:
    """Try large changes, the likeliest first."""
    yield _explain_by_clipping(flagged)
    width = prior_width(flagged.assembly)
    unit_errors = list_unit_errors(flagged.assembly, flagged.measured, flagged.target)
    for other, words in chain(unit_errors, _nearest_points(flagged.assembly, flagged.target)):
        if prior_distance(other, flagged.target) < width:
            yield _fit_assembly(flagged, other, words)
    structural = [p for p in list_perturbations(flagged.assembly) if p.of_substructure]
    sensitive = sorted(structural, key=lambda p: -flagged.significance.sensitivity(p.name))[: _SETTINGS.most_sensitive]
    overhangs = [p for p in structural if p.is_overhang and p not in sensitive]
    for perturbation, amount in _nearest_sizes([*overhangs, *sensitive], flagged.target):
        yield _fit_perturbation(flagged, perturbation, amount)


def _explain_by_clipping(flagged: FlaggedFrf) -> Explanation | None:
    clipping = find_clipping(flagged.target)
    if clipping is None:
        return None
    fit = refine(flagged.assembly, clipping.unclipped)
    whitened = whiten_residuals(flagged.assembly, clipping.unclipped, fit, flagged.model_error)
    significance = assess_significance(whitened, list_perturbations(flagged.assembly))
    highest = float(np.abs(whitened.values).max())
    if significance.statistic > _SETTINGS.nearly_noise or highest < _SETTINGS.above_plateau * clipping.level:
        return None
    unit = unit_of(flagged.target.quantity, rotation=flagged.target.rotation)
    words = f"it were cut off at {clipping.level:.3g} {unit} (an overloaded channel?)"
    return Explanation(words, significance.sum_of_squares)


def _fit_perturbation(flagged: FlaggedFrf, perturbation: Perturbation, amount: float) -> Explanation | None:
    """Fit the amount of a perturbation from a first estimate, then the joint anew with it if that helps."""
    farthest = _SETTINGS.farthest_start
    start = float(np.clip(amount, farthest * perturbation.lower, farthest * perturbation.upper))
    try:
        solution = _fit_amount(flagged, perturbation, start)
        if solution is None or abs(solution[1]) < perturbation.negligible:
            return None
        theta, amount = solution
        return _fit_assembly(flagged, perturbation.apply(amount), perturbation.describe(amount), theta)
    except (DovetailError, np.linalg.LinAlgError):
        return None


def _fit_amount(
    flagged: FlaggedFrf, perturbation: Perturbation, amount: float
) -> tuple[NDArray[np.float64], float] | None:
    """Return the joint (p,) [SI] and the amount that fit best, or None if the residuals remain too large."""
    noise, total = _SETTINGS.noise * len(flagged.whitened.residuals), flagged.significance.sum_of_squares
    problem = PerturbedResiduals(perturbation, flagged.whitened.whitening)
    start = problem.position(_fit_joint(flagged, perturbation.apply(amount)), amount)
    if np.sum(problem.residuals(start) ** 2) > max(_SETTINGS.first_estimate * total, noise):
        return None
    minimum = minimise(problem, start, tolerance=_SETTINGS.tolerance, most_steps=_SETTINGS.most_steps)
    if minimum.cost[0] > max(_SETTINGS.after_fit * total, noise):
        return None
    return flagged.assembly.from_unit(minimum.position[0, :-1]), problem.amount(minimum.position[0])


def _fit_joint(flagged: FlaggedFrf, other: Assembly) -> NDArray[np.float64]:
    """Return the fractions of the ranges (p,) where another assembly fits best: by amplitudes, then with phases."""
    whitened = flagged.whitened
    search = partial(minimise, tolerance=_SETTINGS.tolerance, most_steps=_SETTINGS.most_steps)
    by_amplitude = FrfResiduals(other, LogAmplitude(flagged.target, whitened.whitening.weighted.variance))
    points = qmc.LatinHypercube(len(whitened.theta), rng=np.random.default_rng(0)).random(_SETTINGS.starts)
    starts = np.concatenate([flagged.assembly.to_unit(whitened.theta)[np.newaxis], points])
    minima = search(by_amplitude, starts)
    best = minima.position[[np.argmin(minima.cost)]]
    return np.asarray(search(FrfResiduals(other, whitened.whitening), best).position[0])


def _fit_assembly(flagged: FlaggedFrf, other: Assembly, words: str, *starts: NDArray[np.float64]) -> Explanation | None:
    """Fit another assembly, and return it as an explanation if its residuals are little more than noise."""
    fit = refine(other, flagged.target, starts)
    whitened = whiten_residuals(other, flagged.target, fit, flagged.model_error)
    significance = assess_significance(whitened, list_perturbations(flagged.assembly))
    limit = min(_SETTINGS.nearly_noise, max(1.0, _SETTINGS.better * flagged.significance.statistic))
    if significance.statistic > limit and not is_negligible(fit):
        return None
    return Explanation(words, significance.sum_of_squares)


class PerturbedResiduals:
    """Residuals as a function of the joint's fractions of the ranges and, last, of a perturbation's amount.

    Parameters
    ----------
    perturbation : Perturbation
        Its amount is given as a fraction of its range, too.
    residual : Residual
        Against the measurement.
    """

    def __init__(self, perturbation: Perturbation, residual: Residual) -> None:
        self._perturbation = perturbation
        self._residual = residual
        self._width = perturbation.upper - perturbation.lower

    def position(self, fraction: NDArray[np.float64], amount: float) -> NDArray[np.float64]:
        """Return the position (1, p + 1) of a joint (p,) and an amount."""
        return np.append(fraction, (amount - self._perturbation.lower) / self._width)[np.newaxis]

    def amount(self, position: NDArray[np.float64]) -> float:
        """Return the amount at a position (p + 1,)."""
        return float(self._perturbation.lower + self._width * position[-1])

    def residuals(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, m) at positions (n, p + 1)."""
        return np.concatenate([self._at(self.amount(row)).residuals(row[np.newaxis, :-1]) for row in position])

    def linearise(self, position: NDArray[np.float64]) -> Linearisation:
        """Return residuals and derivatives at positions (n, p + 1)."""
        rows = [self._linearise(row) for row in position]
        return Linearisation(*(np.stack(arrays) for arrays in zip(*rows, strict=True)))

    def _linearise(self, position: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        fraction, amount = position[np.newaxis, :-1], self.amount(position)
        step = -_SETTINGS.step if position[-1] > 0.5 else _SETTINGS.step
        here = self._at(amount).linearise(fraction)
        ahead = self._at(amount + step * self._width).residuals(fraction)
        return here.residuals[0], np.concatenate([here.jacobian[0], (ahead - here.residuals) / step])

    def _at(self, amount: float) -> FrfResiduals:
        return FrfResiduals(self._perturbation.apply(amount), self._residual)


def _nearest_points(assembly: Assembly, target: Frf) -> list[tuple[Assembly, str]]:
    """Return the assembly measured at the points where it comes nearest to the measurement, and where that is."""
    points = [(prior_distance(other, target), words, other) for other, words in _other_points(assembly)]
    points.sort(key=lambda point: point[0])
    return [(other, words) for _, words, other in points[: _SETTINGS.nearest]]


def _other_points(assembly: Assembly) -> Iterator[tuple[Assembly, str]]:
    """Yield the assembly measured at each point outside the joints but its own, and where that is."""
    description = assembly.description
    response = description.response
    excluded = {(response.substructure, response.node)} | {
        (attachment.substructure, node)
        for joint in description.joints.values()
        for attachment in joint.connection.attachments
        for node in attachment.nodes
    }
    for name, model in description.substructures.items():
        for index, node in enumerate(model.nodes):
            if (name, index) not in excluded:
                elsewhere = replace(response, substructure=name, node=index)
                words = f"it were measured on the {name} at {1e3 * node.position:.4g} mm"
                yield Assembly(replace(description, responses=(elsewhere,))), words


def _nearest_sizes(perturbations: Sequence[Perturbation], target: Frf) -> list[tuple[Perturbation, float]]:
    """Return the perturbations and amounts with which the assembly comes nearest to the measurement."""
    sizes = []
    for perturbation in perturbations:
        for amount in _SETTINGS.sizes:
            try:
                sizes.append((prior_distance(perturbation.apply(amount), target), perturbation, amount))
            except (DovetailError, np.linalg.LinAlgError):
                continue
    sizes.sort(key=lambda size: size[0])
    return [(perturbation, amount) for _, perturbation, amount in sizes[: _SETTINGS.nearest]]
