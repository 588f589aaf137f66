"""What looks wrong with a foreign measurement: the one thing that, were it so, would explain it."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from dovetail.assembly import Assembly
from dovetail.errors import DovetailError
from dovetail.frf import Frf, unit_of
from dovetail.identification.fitting import refine
from dovetail.identification.fitting.levenberg_marquardt import Linear, minimise
from dovetail.identification.fitting.residuals import FrfMisfit, LogAmplitude, Residual
from dovetail.identification.misspecification.clipping import plateau
from dovetail.identification.misspecification.perturbations import Change, changes
from dovetail.identification.misspecification.prior_predictive import distance, furthest, rescaled
from dovetail.identification.misspecification.significance import Evidence, evidence, is_good
from dovetail.identification.misspecification.whitened_residuals import Remainder, remainder
from dovetail.identification.posterior.model_error import MODEL_ERROR

__all__ = ["Cause", "WithChange", "at_other_points", "causes", "of_other_sizes"]

_NEARLY_NOISE = 1.5
"""Evidence up to which a cause is said to explain a measurement that is far from noise without it."""
_BETTER = 0.5
"""Part of the evidence that a cause leaves at most."""
_GROSS = 10.0
"""Evidence from which large causes are looked for: another unit, another point, parts of another size."""
_ALWAYS = ("mass", "axis", "gain")
_OVERHANGS = (0.1, -0.1)
"""Logarithms of ratios at which other overhangs are sought as well: a joint follows a small one a long way."""
_MOST_PARTS = 3
"""Of the numbers of the parts, how many are looked into: those that the remainder points to the most."""
_SECONDS = 60.0
"""After which nothing new is tried; enough for all that there is but on large assemblies."""
_STRONGEST = 4
"""Of the numbers of the parts, how many are tried at quite other sizes: those on which the FRF depends the most."""
_MOST_STEPS, _TOLERANCE = 40, 0.5
_SEARCHES, _SEARCH_TOLERANCE, _SEARCH_STEPS = 3, 1.0, 40
_HARDLY = 0.8
"""A change is given up whose first estimate leaves this part of the sum of squares."""
_FURTHEST = 0.5
"""Part of the range in which an amount is sought that the first estimate is from none at most."""
_LESS = 0.3
"""Part of the sum of squares that a cause must leave at most, unless noise leaves as much."""
_WORTH = 12.0
"""Sum of squares by which a cause must improve the fit, and by which the best must be better than others."""
_ABOVE = 1.1
"""How far above a plateau the model must be, where the measurement is cut off."""


@dataclass(frozen=True, eq=False)
class Cause:
    """One thing that explains a measurement.

    Parameters
    ----------
    words : str
        What it is, after "as if".
    squares : float
        Sum of squares that it leaves.
    """

    words: str
    squares: float


@dataclass(frozen=True, eq=False)
class _Case:
    """A foreign measurement, as it came and in the quantity of the response, and what its fit leaves."""

    assembly: Assembly
    measured: Frf
    target: Frf
    left: Remainder
    found: Evidence
    model_error: float


def causes(
    assembly: Assembly, measured: Frf, left: Remainder, found: Evidence, model_error: float = MODEL_ERROR
) -> tuple[Cause, ...]:
    """Return what explains a measurement nearly down to its noise, the best first; nothing if nothing tried does.

    Parameters
    ----------
    assembly : Assembly
    measured : Frf
        On the assembly's frequencies.
    left : Remainder
        What the joint does not explain of it.
    found : Evidence
        How far that is from noise.
    model_error : float
        Standard deviation of the relative error of natural frequencies that the model is allowed.
    """
    target = measured.to(assembly.description.response.quantity)
    case = _Case(assembly, measured, target, left, found, model_error)
    deadline = time.monotonic() + _SECONDS
    explaining = [cause for cause in _until(deadline, _small(case)) if cause is not None]
    if not explaining and found.statistic > _GROSS:
        explaining = next(([cause] for cause in _until(deadline, _large(case)) if cause is not None), [])
    best = min((cause.squares for cause in explaining), default=0.0)
    if best > found.squares - _WORTH:
        return ()
    return tuple(cause for cause in explaining if cause.squares <= best + _WORTH)


def _until(deadline: float, tried: Iterator[Cause | None]) -> Iterator[Cause | None]:
    """Go on trying until it is too late."""
    while time.monotonic() < deadline:
        try:
            yield next(tried)
        except StopIteration:
            return


def _small(case: _Case) -> Iterator[Cause | None]:
    """Try what may be a little other than described; of the measurement before the parts."""
    by_name = {change.name: change for change in changes(case.assembly)}
    parts = sorted((name for name in by_name if ": " in name), key=lambda name: -abs(case.found.towards[name]))
    numbers = [name for name in parts if not by_name[name].overhang]
    for name in _ALWAYS:
        if name in by_name:
            yield _looked_into(case, by_name[name], case.found.amounts[name])
    for name in parts:
        if not by_name[name].overhang:
            continue
        starts = (case.found.amounts[name], *_OVERHANGS)
        yield next(filter(None, (_looked_into(case, by_name[name], amount) for amount in starts)), None)
    for name in numbers[:_MOST_PARTS]:
        yield _looked_into(case, by_name[name], case.found.amounts[name])


def _large(case: _Case) -> Iterator[Cause | None]:
    """Try what is far from described, the likeliest first."""
    yield _cut_off(case)
    within = furthest(case.assembly)
    others = chain(rescaled(case.assembly, case.measured, case.target), at_other_points(case.assembly, case.target))
    for other, words in others:
        if distance(other, case.target) < within:
            yield _explained(case, other, words)
    parts = [change for change in changes(case.assembly) if ": " in change.name]
    strongest = sorted(parts, key=lambda change: -case.found.sensitivity(change.name))[:_STRONGEST]
    overhangs = [change for change in parts if change.overhang and change not in strongest]
    for change, amount in of_other_sizes([*overhangs, *strongest], case.target):
        yield _looked_into(case, change, amount)


def _cut_off(case: _Case) -> Cause | None:
    flat = plateau(case.target)
    if flat is None:
        return None
    fit = refine(case.assembly, flat.rest)
    left = remainder(case.assembly, flat.rest, fit, case.model_error)
    found = evidence(left, changes(case.assembly))
    beyond = float(np.abs(left.values).max()) / flat.level
    if found.statistic > _NEARLY_NOISE or beyond < _ABOVE:
        return None
    unit = unit_of(case.target.quantity, rotation=case.target.rotation)
    return Cause(f"it were cut off at {flat.level:.3g} {unit} (an overloaded channel?)", found.squares)


def _looked_into(case: _Case, change: Change, amount: float) -> Cause | None:
    """Seek how much of a change explains a measurement, from a first estimate, and fit anew with it if that helps."""
    try:
        found = _sought(case, change, float(np.clip(amount, _FURTHEST * change.least, _FURTHEST * change.most)))
        if found is None or abs(found[1]) < change.worth:
            return None
        theta, amount = found
        return _explained(case, change.altered(amount), change.words(amount), theta)
    except (DovetailError, np.linalg.LinAlgError):
        return None


def _sought(case: _Case, change: Change, amount: float) -> tuple[NDArray[np.float64], float] | None:
    """Return the joint (p,) [SI] and the amount that leave the least, or None if that is too much."""
    nothing = 1.2 * len(case.left.residuals)
    problem = WithChange(change, case.left.residual)
    start = problem.position(_nearest_joint(case, change.altered(amount)), amount)
    if np.sum(problem.residuals(start) ** 2) > max(_HARDLY * case.found.squares, nothing):
        return None
    found = minimise(problem, start, tolerance=_TOLERANCE, most_steps=_MOST_STEPS)
    if found.cost[0] > max(_LESS * case.found.squares, nothing):
        return None
    return case.assembly.from_unit(found.position[0, :-1]), problem.amount(found.position[0])


def _nearest_joint(case: _Case, other: Assembly) -> NDArray[np.float64]:
    """Return the fractions of the ranges (p,) where another assembly is nearest: by amplitudes, then with phases."""
    search = FrfMisfit(other, LogAmplitude(case.target, case.left.residual.residual.variance))
    random = qmc.LatinHypercube(len(case.left.theta), rng=np.random.default_rng(0)).random(_SEARCHES)
    starts = np.concatenate([case.assembly.to_unit(case.left.theta)[np.newaxis], random])
    ends = minimise(search, starts, tolerance=_SEARCH_TOLERANCE, most_steps=_SEARCH_STEPS)
    rough = ends.position[np.argsort(ends.cost, kind="stable")[:1]]
    found = minimise(FrfMisfit(other, case.left.residual), rough, tolerance=_SEARCH_TOLERANCE, most_steps=_SEARCH_STEPS)
    return np.asarray(found.position[0])


def _explained(case: _Case, other: Assembly, words: str, *starts: NDArray[np.float64]) -> Cause | None:
    """Fit another assembly, and return it as a cause if that leaves little more than noise."""
    fit = refine(other, case.target, starts)
    found = evidence(remainder(other, case.target, fit, case.model_error), changes(case.assembly))
    limit = min(_NEARLY_NOISE, max(1.0, _BETTER * case.found.statistic))
    if found.statistic > limit and not is_good(fit):
        return None
    return Cause(words, found.squares)


_STEP = 1e-5
"""Part of the range of the amount by which derivatives are taken."""


class WithChange:
    """Residuals by the joint's fractions of the ranges and, last, the place of the amount between its ends.

    Parameters
    ----------
    change : Change
    residual : Residual
        Against the measurement.
    """

    def __init__(self, change: Change, residual: Residual) -> None:
        self._change = change
        self._residual = residual

    def position(self, fraction: NDArray[np.float64], amount: float) -> NDArray[np.float64]:
        """Return the place (1, p + 1) of a joint (p,) and an amount."""
        return np.append(fraction, (amount - self._change.least) / self._width)[np.newaxis]

    def amount(self, position: NDArray[np.float64]) -> float:
        """Return the amount at a place (p + 1,)."""
        return float(self._change.least + self._width * position[-1])

    def residuals(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, m) at places (n, p + 1)."""
        return np.concatenate([self._misfit(self.amount(one)).residuals(one[np.newaxis, :-1]) for one in position])

    def linear(self, position: NDArray[np.float64]) -> Linear:
        """Return residuals and derivatives at places (n, p + 1)."""
        each = [self._linear(one) for one in position]
        residuals, slopes = (np.stack(parts) for parts in zip(*each, strict=True))
        return Linear(residuals, slopes, np.einsum("npm,nm->np", slopes, residuals), slopes @ np.swapaxes(slopes, 1, 2))

    def _linear(self, position: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        fraction, amount = position[np.newaxis, :-1], self.amount(position)
        step = -_STEP if position[-1] > 0.5 else _STEP
        here = self._misfit(amount).linear(fraction)
        ahead = self._misfit(amount + step * self._width).residuals(fraction)
        return here.residuals[0], np.concatenate([here.slopes[0], (ahead - here.residuals) / step])

    def _misfit(self, amount: float) -> FrfMisfit:
        return FrfMisfit(self._change.altered(amount), self._residual)

    @property
    def _width(self) -> float:
        return self._change.most - self._change.least


_CLOSEST = 2
_AS_CLOSE = 1.1
"""Over the least distance, up to which the second is looked into too."""
_SIZES = (-0.2, -0.1, -0.05, 0.05, 0.1, 0.2)
"""Logarithms of the ratio of another size to the one described."""


def at_other_points(assembly: Assembly, target: Frf) -> tuple[tuple[Assembly, str], ...]:
    """Return the assembly measured where it comes nearest to the measurement, and in words where that is."""
    found = [(distance(other, target), words, other) for other, words in _points(assembly)]
    found.sort(key=lambda one: one[0])
    return tuple((other, words) for apart, words, other in found[:_CLOSEST] if apart < _AS_CLOSE * found[0][0])


def _points(assembly: Assembly) -> Iterator[tuple[Assembly, str]]:
    description = assembly.description
    response = description.response
    inside = {
        (attached.substructure, node)
        for joint in description.joints.values()
        for attached in joint.connection.attachments
        for node in attached.nodes
    }
    for name, part in description.substructures.items():
        for index, node in enumerate(part.nodes):
            if (name, index) in inside or (name, index) == (response.substructure, response.node):
                continue
            elsewhere = replace(response, substructure=name, node=index)
            words = f"it were measured on the {name} at {1e3 * node.position:.4g} mm"
            yield Assembly(replace(description, responses=(elsewhere,))), words


def of_other_sizes(possible: Sequence[Change], target: Frf) -> tuple[tuple[Change, float], ...]:
    """Return the changes of parts, and by how much, with which the assembly comes nearest to the measurement."""
    found = []
    for change in possible:
        for amount in _SIZES:
            try:
                found.append((distance(change.altered(amount), target), change, amount))
            except (DovetailError, np.linalg.LinAlgError):
                continue
    return tuple((change, amount) for _, change, amount in sorted(found, key=lambda one: one[0])[:_CLOSEST])
