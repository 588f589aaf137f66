"""What weighted samples say about one parameter: its interval, separate groups, how precisely it is known, a word."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Final, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, ParameterError
from dovetail.inference.posterior.alternating import Alternating
from dovetail.inference.posterior.weights import drawn_by_weight

LEVEL = 0.9
"""Probability that an interval holds the true value."""

NOT_TRUSTWORTHY: Final = "not trustworthy"
"""The verdict on every parameter of a result that is not trustworthy."""

FIXED: Final = "The measurement fixes it."
"""The reason of a verdict with nothing to add."""

Word: TypeAlias = Literal["identified", "weakly identified", "not identifiable", "not trustworthy"]


@dataclass(frozen=True)
class VerdictLimits:
    """How precisely a parameter must be known to be called so.

    They follow from the use of such a value, not from any measurement. The natural frequency of a mode goes with the
    square root of a stiffness or a mass, and its height with a damping. Within 20 %, a value can be used in a
    prediction: it moves a natural frequency by less than 10 %, and a resonance by less than 2 dB. Within a factor of 3,
    only its order of magnitude is known.

    Parameters
    ----------
    identified : float
        Largest relative distance of the interval's ends from the estimate of an identified parameter.
    weakly_identified : float
        Largest ratio of the estimate to the interval's ends, or the reverse, of a weakly identified parameter.

    Raises
    ------
    ParameterError
        A limit is out of its range, or the first allows more than the second.
    """

    identified: float = 0.2
    weakly_identified: float = 3.0

    def __post_init__(self) -> None:
        for name, limit, least in (
            ("identified", self.identified, 0),
            ("weakly_identified", self.weakly_identified, 1),
        ):
            if isinstance(limit, bool) or not isinstance(limit, Real) or not least < limit < np.inf:
                raise ParameterError(Fault(name, f"{limit!r:.40} is not a limit.", f"a number greater than {least}"))
        if 1.0 + self.identified > self.weakly_identified:
            problem = f"{self.identified:g} is more than 'weakly_identified', a factor of {self.weakly_identified:g}."
            raise ParameterError(Fault("identified", problem, f"at most {self.weakly_identified - 1.0:g}"))


VERDICT_LIMITS = VerdictLimits()


@dataclass(frozen=True)
class Settings:
    """When a measurement determines a parameter, and how its precision is written."""

    gain: float = 0.5
    """Smallest share of the prior variance that the measurement removes from a parameter that it determines: its
    interval is then 0.7 times as wide as the one before the measurement. With less, the range says more than the
    measurement."""
    cut: float = 0.1
    """Distance of an end of the interval from the end of the range, over the width of the interval, below which the
    range cuts the interval off: in a wider range it would be wider. It is 0.055 for a parameter with any value up to
    the end, and 0.12 for a Gaussian whose own 90 % interval ends at the end of the range."""
    widening: float = 2.0
    """How many times as wide an interval is taken to be without the range that cuts it off: a Gaussian is 1.7 times as
    wide as its half."""
    per_cent: float = 1.5
    """Largest such ratio that is given in per cent."""
    hardly: float = 0.25
    """Gain below which the measurement is said hardly to depend on a parameter: the interval is at most an eighth
    narrower than before."""
    effective_samples: int = 50
    """Effective size of a group below which it is not divided."""
    gap: float = 1.0 / 3.0
    """Part of an interval's width that holds no sample, from which a parameter has separate groups of values. Of 50
    independent samples, evenly distributed, two neighbours are 0.08 of it apart."""


_SETTINGS = Settings()


@dataclass(frozen=True)
class Known:
    """What the samples say about one parameter.

    Parameters
    ----------
    estimate, low, high : float
        SI; the ends of the 90 % interval.
    gain : float
        As in `Verdict`.
    cut : str
        The end of the range, "lower" or "upper", that cuts the interval off; "both", or empty.
    """

    estimate: float
    low: float
    high: float
    gain: float
    cut: str = ""

    @property
    def is_determined(self) -> bool:
        """Whether the measurement, rather than the range, limits the parameter on one side at least."""
        return self.gain >= _SETTINGS.gain and self.cut != "both"

    @property
    def relative(self) -> float:
        """Relative distance of the farther end of the interval from the estimate."""
        return relative_error(self.estimate, self.low, self.high)

    @property
    def factor(self) -> float | None:
        """Largest ratio of the estimate to an end, or the reverse; None if the interval includes zero."""
        ends = self.low, self.estimate, self.high
        if min(ends) <= 0.0 <= max(ends):
            return None
        small, middle, large = sorted(abs(end) for end in ends)
        with np.errstate(over="ignore"):
            return float(max(np.float64(large) / middle, np.float64(middle) / small))


@dataclass(frozen=True)
class Group:
    """One of several separate groups of a parameter's likely values.

    Parameters
    ----------
    weight : float
        Its share of the posterior.
    estimate, interval_low, interval_high : float
        SI; the median, and the ends of the 90 % interval within the group.
    precision : str
        As in `Verdict`, within the group.
    factor : float or None
        Likewise.
    """

    weight: float
    estimate: float
    interval_low: float
    interval_high: float
    precision: str
    factor: float | None = None

    @staticmethod
    def of(weight: float, estimate: float, low: float, high: float) -> Group:
        """Return the group with this share, median and interval."""
        known = Known(estimate, low, high, gain=1.0)
        return Group(weight, estimate, low, high, precision_text(known), known.factor)

    def times(self, ratio: float) -> Group:
        """Return the group of a parameter that is a multiple of this one."""
        low, high = sorted((ratio * self.interval_low, ratio * self.interval_high))
        return Group(self.weight, ratio * self.estimate, low, high, self.precision, self.factor)


@dataclass(frozen=True)
class Verdict:
    """How well one parameter is known from the measurement.

    Parameters
    ----------
    word : str
        "identified", "weakly identified" or "not identifiable"; "not trustworthy" if the result is not trustworthy.
    gain : float
        Share of the prior variance that the measurement removes; 1 if the parameter is known exactly.
    reason : str
        A sentence.
    precision : str
        How far the true value may be from the estimate, with a probability of 90 %: "±4 %" or "factor 1.6".
        "lower bound" or "upper bound" if the range cuts off the other end of the interval, "may be zero" if the
        interval includes zero, "range only" ("prior only" for a normal prior) if the measurement hardly narrows what
        was known before, "2 groups" if the likely values are in separate groups. Empty if the result is not
        trustworthy.
    factor : float or None
        Largest ratio of the estimate to an end of the interval, or the reverse; None if the interval includes zero.
    """

    word: Word
    gain: float
    reason: str
    precision: str = ""
    factor: float | None = None


def relative_error(estimate: float, low: float, high: float) -> float:
    """Return the relative distance of the farther end of an interval from the estimate; infinite about zero."""
    farther = max(high - estimate, estimate - low)
    return farther / abs(estimate) if estimate else np.inf


def ends_cut(low: float, high: float) -> str:
    """Return the end of the range that cuts off an interval, given in fractions of the range, as in `Known`."""
    nearest = _SETTINGS.cut * (high - low)
    lower, upper = low < nearest, high > 1.0 - nearest
    return "both" if lower and upper else "lower" if lower else "upper" if upper else ""


def word_for(known: Known, limits: VerdictLimits = VERDICT_LIMITS) -> Word:
    """Return the verdict on one parameter, whose likely values are in one group.

    It does not depend on the width of the range, as long as the measurement limits the interval.
    """
    if not known.is_determined:
        return "not identifiable"
    if known.relative * (_SETTINGS.widening if known.cut else 1.0) <= limits.identified:
        return "identified"
    if known.cut:
        return "weakly identified"
    in_order = known.factor is None or known.factor <= limits.weakly_identified
    return "weakly identified" if in_order else "not identifiable"


def word_for_groups(groups: Sequence[Group], limits: VerdictLimits = VERDICT_LIMITS) -> Word:
    """Return the verdict on a parameter with separate groups of likely values: which of them is right is not known."""
    in_order = [group.factor is None or group.factor <= limits.weakly_identified for group in groups]
    return "weakly identified" if all(in_order) else "not identifiable"


def how_little(known: Known) -> str:
    """Say how little the measurement says about a parameter, to follow "the measurement"."""
    if known.is_determined:
        return "determines it only roughly"
    if known.gain < _SETTINGS.hardly:
        return "hardly depends on it"
    return "narrows its range only a little; in a wider range it would show what the measurement says by itself"


def precision_text(known: Known, limits: VerdictLimits = VERDICT_LIMITS, *, is_normal: bool = False) -> str:
    """Write how well a parameter is known, as in `Verdict`."""
    if not known.is_determined:
        return "prior only" if is_normal else "range only"
    if known.cut and word_for(known, limits) != "identified":
        return "upper bound" if known.cut == "lower" else "lower bound"
    if known.factor is None:
        return "may be zero"
    if known.factor < _SETTINGS.per_cent:
        per_cent = 100.0 * known.relative
        return "±0.01 %" if per_cent < 0.01 else f"±{per_cent:.2g} %"
    return f"factor {known.factor:.2g}" if known.factor < 100.0 else "factor over 100"


def separate_groups(values: NDArray[np.float64], weight: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the group (n,) of each sample of one parameter: 0 for the lowest values; all 0 if there is one group.

    Parameters
    ----------
    values : (n,) array
        In fractions of the range.
    weight : (n,) array
    """
    edges, waiting = list[float](), [np.ones(len(values), dtype=np.bool_)]
    while waiting:
        rows = waiting.pop()
        edge = _gap(values, weight, rows)
        if edge is not None:
            edges.append(edge)
            waiting += [rows & (values < edge), rows & (values >= edge)]
    return np.searchsorted(np.sort(edges), values, side="right")


def _gap(values: NDArray[np.float64], weight: NDArray[np.float64], rows: NDArray[np.bool_]) -> float | None:
    """Return the middle of the largest gap between samples, or None if it is small for the interval of these."""
    counted = rows & Alternating(len(rows)).given_measurement  # those about the best fit are no group of their own
    chosen, share = values[counted], weight[counted]
    if not share.sum() or weight[rows].sum() ** 2 < _SETTINGS.effective_samples * np.sum(weight[rows] ** 2):
        return None
    (low,), (high,) = quantiles(chosen[:, np.newaxis], share / share.sum(), ends_of(LEVEL))
    drawn = chosen[drawn_by_weight(share, len(share), np.random.default_rng(7))]
    ordered = np.sort(np.clip(drawn, low, high))
    gaps = np.diff(ordered)
    if not gaps.size or gaps.max() <= _SETTINGS.gap * (high - low):
        return None
    widest = int(np.argmax(gaps))
    return float(ordered[widest] + ordered[widest + 1]) / 2.0


def heaviest_combination(groups: NDArray[np.intp], weight: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return the samples (n,) of the combination of groups (n, m) that holds the largest share of the posterior."""
    _, combination = np.unique(groups, axis=0, return_inverse=True)
    combination = combination.reshape(-1)
    return np.asarray(combination == np.argmax(np.bincount(combination, weight)))


def quantiles(
    values: NDArray[np.float64], weight: NDArray[np.float64], levels: list[float]
) -> tuple[NDArray[np.float64], ...]:
    """Return weighted quantiles of the columns of (n, m) values, an (m,) array for each level.

    The weights sum to 1. The interval between two of the quantiles holds a further draw with the probability between
    their levels, however few samples there are: of n effective samples, 0.05 is the place 0.05 (n + 1), as in R. J.
    Hyndman and Y. Fan, Sample quantiles in statistical packages, The American Statistician 50 (1996) 361-365, type 6.
    """
    count = 1.0 / np.sum(weight**2)
    order = np.argsort(values, axis=0)
    ordered = np.take_along_axis(values, order, axis=0)
    below = np.cumsum(weight[order], axis=0) - 0.5 * weight[order]
    return tuple(
        np.array([np.interp(level, below[:, column], ordered[:, column]) for column in range(values.shape[1])])
        for level in (level + (level - 0.5) / count for level in levels)
    )


def split_half_difference(
    values: NDArray[np.float64], weight: NDArray[np.float64], level: float
) -> NDArray[np.float64]:
    """Return by how much the intervals of the first and of the second half of samples (n, m) differ, (m,).

    It is the larger difference of the two ends, over the width of the interval that all samples give; 1 where there are
    not two halves.
    """
    middle = len(weight) // 2
    halves = [(values[rows], weight[rows]) for rows in (slice(None, middle), slice(middle, None))]
    if min(half.sum() for _, half in halves) <= 0.0:
        return np.ones(values.shape[1])
    low, high = quantiles(values, weight, ends_of(level))
    first, second = (np.array(quantiles(rows, half / half.sum(), ends_of(level))) for rows, half in halves)
    return np.asarray(np.abs(first - second).max(axis=0) / np.maximum(high - low, np.finfo(float).tiny))


def ends_of(level: float) -> list[float]:
    """Return the quantiles at the ends of a central interval."""
    return [(1.0 - level) / 2.0, (1.0 + level) / 2.0]
