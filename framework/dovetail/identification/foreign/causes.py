"""What looks wrong with a foreign measurement: the one thing that, were it so, would explain it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.errors import DovetailError
from dovetail.frf import Frf, unit_of
from dovetail.identification.fitting import Fit, refine
from dovetail.identification.foreign.changes import Change, changes
from dovetail.identification.foreign.clipping import plateau
from dovetail.identification.foreign.coarse import distance, furthest
from dovetail.identification.foreign.elsewhere import at_other_points, of_other_sizes
from dovetail.identification.foreign.evidence import Evidence, evidence, is_good
from dovetail.identification.foreign.remainder import remainder
from dovetail.identification.foreign.scale import rescaled
from dovetail.identification.posterior.model_error import MODEL_ERROR

__all__ = ["Cause", "causes"]

_NEARLY_NOISE = 1.5
"""Evidence up to which a cause is said to explain a measurement that is far from noise without it."""
_BETTER = 0.5
"""Part of the evidence that a cause leaves at most."""
_GROSS = 10.0
"""Evidence from which large causes are looked for: another unit, another point, parts of another size."""
_ALWAYS = ("mass", "axis", "gain")
_MOST_PARTS = 3
"""Of the numbers of the parts, how many are looked into: those that the remainder points to the most."""
_SECONDS = 20.0
"""After which nothing further is tried."""
_STRONGEST = 4
"""Of the numbers of the parts, how many are tried at quite other sizes: those on which the FRF depends the most."""
_MOST_STEPS, _SETTLED = 8, 0.01
_HOPELESS, _HARDLY = 1, 0.8
"""Steps after which a change is given up that still leaves this part of the sum of squares."""
_LARGEST_STEP = 0.25
"""Part of the range in which an amount is sought that one step takes at most."""
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
    """A foreign measurement, as it came and in the quantity of the response, with its fit."""

    assembly: Assembly
    measured: Frf
    target: Frf
    fit: Fit
    found: Evidence
    model_error: float


def causes(
    assembly: Assembly, measured: Frf, fit: Fit, found: Evidence, model_error: float = MODEL_ERROR
) -> tuple[Cause, ...]:
    """Return what explains a measurement nearly down to its noise, the best first; nothing if nothing tried does.

    Parameters
    ----------
    assembly : Assembly
    measured : Frf
        On the assembly's frequencies.
    fit : Fit
        Of the measurement.
    found : Evidence
        Against that fit.
    model_error : float
        Standard deviation of the relative error of natural frequencies that the model is allowed.
    """
    target = measured.to(assembly.description.response.quantity)
    case = _Case(assembly, measured, target, fit, found, model_error)
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
    for name in [*_ALWAYS, *parts[:_MOST_PARTS]]:
        if name in by_name:
            yield _looked_into(case, by_name[name], 0.0, case.found.amounts[name])


def _large(case: _Case) -> Iterator[Cause | None]:
    """Try what is far from described, the likeliest first."""
    yield _cut_off(case)
    within = furthest(case.assembly)
    others = chain(rescaled(case.assembly, case.measured, case.target), at_other_points(case.assembly, case.target))
    for other, words in others:
        if distance(other, case.target) < within:
            yield _explained(case, other, words)
    strongest = sorted(changes(case.assembly), key=lambda change: -case.found.sensitivity(change.name))
    parts = [change for change in strongest if ": " in change.name][:_STRONGEST]
    for change, amount in of_other_sizes(parts, case.target):
        yield _looked_into(case, change, amount, 0.0)


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


def _looked_into(case: _Case, change: Change, amount: float, step: float) -> Cause | None:
    """Seek the amount of a change by Gauss-Newton steps, and fit anew with it if that helps."""
    theta, squares, altered = case.fit.theta, np.inf, case.assembly
    try:
        for tries in range(_MOST_STEPS):
            most = _LARGEST_STEP * (change.most - change.least)
            amount = float(np.clip(amount + np.clip(step, -most, most), change.least, change.most))
            altered = change.altered(amount)
            left = remainder(altered, case.target, replace(case.fit, theta=theta), case.model_error)
            now = evidence(left, (_around(change, amount),))
            theta, squares, step = left.theta, now.squares, now.amounts[change.name]
            if 0.0 < abs(step) <= _SETTLED * abs(amount) or (
                tries == _HOPELESS and squares > _HARDLY * case.found.squares
            ):
                break
    except DovetailError:
        return None
    if squares > max(_LESS * case.found.squares, 1.2 * len(left.residuals)):
        return None
    if abs(amount) < change.worth or _explained(case, altered, "", theta) is None:
        return None
    return Cause(change.words(amount), squares)


def _explained(case: _Case, other: Assembly, words: str, *starts: NDArray[np.float64]) -> Cause | None:
    """Fit another assembly, and return it as a cause if that leaves little more than noise."""
    fit = refine(other, case.target, starts)
    found = evidence(remainder(other, case.target, fit, case.model_error), changes(case.assembly))
    limit = min(_NEARLY_NOISE, max(1.0, _BETTER * case.found.statistic))
    if found.statistic > limit and not is_good(fit):
        return None
    return Cause(words, found.squares)


def _around(change: Change, amount: float) -> Change:
    """Return the change with its effect around an amount of it."""
    step = 1e-4 * max(change.most, 1e-2)
    further = change.altered(amount + step)
    return replace(change, effect=lambda theta, values: (further.frf(theta) - values) / step)
