"""What a measurement says of each parameter: samples, estimates, intervals, and how far each can be known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly

__all__ = ["FEWEST", "LEVEL", "MOST_APART", "Form", "Posterior", "Verdict", "Word", "halves_apart", "quantiles"]

LEVEL = 0.9
"""Probability that an interval holds the true value."""

Word: TypeAlias = Literal["identified", "weakly identified", "not identifiable"]

Form: TypeAlias = Literal["samples", "laplace"]

_IDENTIFIED, _WEAKLY = 0.9, 0.5
"""Part of the prior variance that the measurement must take away."""
_TRADES = 0.6
"""Correlation from which two parameters are said to trade with each other."""
_AT_END, _MUCH = 0.25, 1.0 / 3.0
"""A parameter presses against an end of its range if so much of its posterior lies within this part of its own interval
from that end: where nothing holds it there but the range, half a Gaussian, it is 0.37; even over the range, 0.23."""


@dataclass(frozen=True)
class Verdict:
    """How far one parameter can be known from the measurement.

    Parameters
    ----------
    word : str
        "identified", "weakly identified" or "not identifiable".
    gain : float
        Part of the variance before the measurement that it takes away: 1 where it tells all.
    reason : str
        A sentence.
    """

    word: Word
    gain: float
    reason: str


@dataclass(frozen=True, eq=False)
class Posterior:
    """Weighted samples of the parameters given a measurement.

    Parameters
    ----------
    names : tuple of str
    theta : (n, n_params) array
        SI.
    fraction : (n, n_params) array
        The same in fractions of the ranges, on the parameters' scales.
    weight : (n,) array
        Sums to 1.
    estimate : (n_params,) array
        SI; posterior means, taken on the parameters' scales.
    model_error : float
        Standard deviation of the relative error of natural frequencies that the model was allowed.
    drawn : int
        Searches; n of them reached their target.
    lines : int
        Lines to which the FRF was reduced.
    seconds : float
    form : {"samples", "laplace"}
        Whether the samples are those of the posterior, or of a Gaussian that stands for it.
    mode : (n_params,) array or None
        SI; the most probable place, with the form "laplace".
    doubtful : tuple of str
        Parameters whose interval is not to be trusted, since the posterior is not that Gaussian.
    """

    names: tuple[str, ...]
    theta: NDArray[np.float64]
    fraction: NDArray[np.float64]
    weight: NDArray[np.float64]
    estimate: NDArray[np.float64]
    model_error: float
    drawn: int
    lines: int
    seconds: float
    form: Form = "samples"
    mode: NDArray[np.float64] | None = None
    doubtful: tuple[str, ...] = ()

    @staticmethod
    def of(
        assembly: Assembly,
        fraction: NDArray[np.float64],
        weight: NDArray[np.float64],
        *,
        model_error: float,
        drawn: int,
        lines: int,
        seconds: float,
        form: Form = "samples",
        mode: NDArray[np.float64] | None = None,
        doubtful: tuple[str, ...] = (),
    ) -> Posterior:
        """Return the posterior with these samples, in fractions of the assembly's ranges."""
        return Posterior(
            names=tuple(parameter.name for parameter in assembly.parameters),
            theta=assembly.from_unit(fraction),
            fraction=fraction,
            weight=weight,
            estimate=assembly.from_unit(weight @ fraction),
            model_error=model_error,
            drawn=drawn,
            lines=lines,
            seconds=seconds,
            form=form,
            mode=mode,
            doubtful=doubtful,
        )

    @property
    def effective(self) -> float:
        """Effective sample size: so many independent, equally weighted samples tell as much (Kish)."""
        return float(1.0 / np.sum(self.weight**2))

    @property
    def reached(self) -> float:
        """Part of the searches that reached their target; the others are where the posterior folds over."""
        return len(self.weight) / self.drawn

    @cached_property
    def halves_apart(self) -> Mapping[str, float]:
        """By what part of its width each interval differs between two halves of the samples, on the parameters' scales.

        With n effective samples that are sound it is about 1.3 over the root of n.
        """
        apart = halves_apart(self.fraction, self.weight, LEVEL)
        return dict(zip(self.names, apart.tolist(), strict=True))

    @property
    def warnings(self) -> tuple[str, ...]:
        """What must be known before the intervals are believed."""
        found = []
        if self.doubtful:
            found.append(
                f"The form 'laplace' misleads on {', '.join(self.doubtful)}: the posterior is bent, the Gaussian is "
                "not. Do not trust these intervals; the form 'samples' gives better ones."
            )
        if self.effective < FEWEST:
            found.append(
                f"The samples tell no more than {self.effective:.0f} independent ones would: the ends of the "
                "intervals are rough. Ask for more samples."
            )
        apart = [f"{name} ({part:.0%})" for name, part in self.halves_apart.items() if part > MOST_APART]
        if apart:
            found.append(
                f"Two halves of the samples disagree on the intervals, in parts of their width: {', '.join(apart)}. "
                "Ask for more samples."
            )
        return tuple(found)

    def interval(self, level: float = LEVEL) -> Mapping[str, tuple[float, float]]:
        """Return the central interval of each parameter, SI, by name."""
        ends = quantiles(self.theta, self.weight, [(1.0 - level) / 2.0, (1.0 + level) / 2.0])
        return {name: (float(low), float(high)) for name, low, high in zip(self.names, *ends, strict=True)}

    @cached_property
    def correlation(self) -> NDArray[np.float64]:
        """(n_params, n_params) correlations, on the parameters' scales."""
        centred = self.fraction - self.weight @ self.fraction
        covariance = (centred * self.weight[:, np.newaxis]).T @ centred
        deviation = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
        return np.asarray(covariance / np.outer(deviation, deviation))

    @cached_property
    def verdicts(self) -> Mapping[str, Verdict]:
        """How far each parameter can be known, by name."""
        mean = self.weight @ self.fraction
        gains = np.clip(1.0 - 12.0 * (self.weight @ (self.fraction - mean) ** 2), 0.0, 1.0)
        return {name: self._verdict(index, float(gains[index])) for index, name in enumerate(self.names)}

    def _verdict(self, index: int, gain: float) -> Verdict:
        word: Word = (
            "identified" if gain >= _IDENTIFIED else "weakly identified" if gain >= _WEAKLY else "not identifiable"
        )
        end = self._pressed_end(index)
        reasons = [f"it presses against the {end} end of its range"] if end else []
        if word != "identified":
            reasons.append(self._trade(index, word))
        reason = "; ".join(reasons) or "the measurement fixes it"
        return Verdict(word, gain, f"{reason[0].upper()}{reason[1:]}.")

    def _pressed_end(self, index: int) -> str:
        """Return the end of the range, "lower" or "upper", that a parameter presses against; empty if none."""
        column = self.fraction[:, [index]]
        low, high = quantiles(column, self.weight, [(1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0])
        near = _AT_END * (high[0] - low[0])
        shares = {
            "lower": float(self.weight @ (column[:, 0] < near)),
            "upper": float(self.weight @ (column[:, 0] > 1.0 - near)),
        }
        end = max(shares, key=lambda one: shares[one])
        return end if shares[end] >= _MUCH else ""

    def _trade(self, index: int, word: Word) -> str:
        """Say with what a parameter that is not well known trades, or that the FRF tells little of it."""
        row = self.correlation[index].copy()
        row[index] = 0.0
        partners = [int(other) for other in np.argsort(-np.abs(row))[:2] if abs(row[other]) >= _TRADES]
        if not partners:
            return "the FRF hardly depends on it" if word == "not identifiable" else "the FRF tells little of it"
        named = " and ".join(f"{self.names[other]} (correlation {row[other]:+.2f})" for other in partners)
        return f"it trades with {named}"

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the samples as plain values, fit for JSON."""
        intervals = self.interval()
        return {
            "form": self.form,
            "level": LEVEL,
            "warnings": list(self.warnings),
            "parameters": {
                name: {
                    "estimate": float(estimate),
                    "interval": list(intervals[name]),
                    "verdict": self.verdicts[name].word,
                    "gain": self.verdicts[name].gain,
                    "reason": self.verdicts[name].reason,
                    "doubtful": name in self.doubtful,
                    "halves_apart": self.halves_apart[name],
                }
                for name, estimate in zip(self.names, self.estimate, strict=True)
            },
            "correlation": self.correlation.tolist(),
            "effective_samples": self.effective,
            "reached": self.reached,
            "model_error": self.model_error,
            "lines": self.lines,
            "seconds": self.seconds,
            "mode": None if self.mode is None else self.mode.tolist(),
            "samples": {"theta": self.theta.tolist(), "weight": self.weight.tolist()},
        }


def quantiles(
    values: NDArray[np.float64], weight: NDArray[np.float64], levels: list[float]
) -> tuple[NDArray[np.float64], ...]:
    """Return weighted quantiles of the columns of (n, m) values, an (m,) array for each level."""
    order = np.argsort(values, axis=0)
    ordered = np.take_along_axis(values, order, axis=0)
    below = np.cumsum(weight[order], axis=0) - 0.5 * weight[order]
    return tuple(
        np.array([np.interp(level, below[:, column], ordered[:, column]) for column in range(values.shape[1])])
        for level in levels
    )


FEWEST = 50
"""Effective samples below which a tail of an interval rests on two or three."""
MOST_APART = 0.5
"""Part of an interval's width by which its ends may differ between two halves of the samples."""


def halves_apart(values: NDArray[np.float64], weight: NDArray[np.float64], level: float) -> NDArray[np.float64]:
    """Return by how much the intervals of the first and of the second half of the samples differ.

    Parameters
    ----------
    values : (n, m) array
        Samples, in the order in which they were drawn.
    weight : (n,) array
    level : float
        Probability of the interval.

    Returns
    -------
    (m,) array
        The larger difference of the two ends, over the width of the interval that all samples give; 1 where there
        are not two halves.
    """
    middle = len(weight) // 2
    halves = [(values[part], weight[part]) for part in (slice(None, middle), slice(middle, None))]
    if min(half.sum() for _, half in halves) <= 0.0:
        return np.ones(values.shape[1])
    levels = [(1.0 - level) / 2.0, (1.0 + level) / 2.0]
    low, high = quantiles(values, weight, levels)
    first, second = (np.array(quantiles(part, half / half.sum(), levels)) for part, half in halves)
    return np.asarray(np.abs(first - second).max(axis=0) / np.maximum(high - low, np.finfo(float).tiny))
