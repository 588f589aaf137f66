"""What a measurement says of each parameter: samples, estimates, intervals, and how far each can be known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from numbers import Integral
from typing import Any, Final, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly
from dovetail.errors import Fault, ParameterError, did_you_mean, listing
from dovetail.identification.posterior.likelihood import PRIOR_PRECISION, normal_from_unit, unit_from_normal
from dovetail.identification.posterior.model_error import ModelError

__all__ = [
    "LEVEL",
    "NOT_BELIEVED",
    "Form",
    "Posterior",
    "Verdict",
    "Word",
    "check_options",
    "drawn_by_weight",
    "quantiles",
    "split_half_difference",
]

LEVEL = 0.9
"""Probability that an interval holds the true value."""
_FEWEST_SAMPLES = 20  # of fewer, the ends of an interval would be the outermost samples

NOT_BELIEVED: Final = "not believed"
"""The verdict on every parameter of a result that is not to be believed."""

Word: TypeAlias = Literal["identified", "weakly identified", "not identifiable", "not believed"]

Form: TypeAlias = Literal["samples", "laplace"]


def check_options(samples: int, form: str = "samples") -> None:
    """Make sure that the form of a posterior is one, and the number of its samples an integer that is large enough.

    Raises
    ------
    ParameterError
    """
    if form not in get_args(Form):
        problem = f"'{form}' is no form of the posterior."
        raise ParameterError(Fault("form", problem, listing(get_args(Form)), did_you_mean(form, get_args(Form))))
    if not (isinstance(samples, Integral) and samples >= _FEWEST_SAMPLES):
        problem = f"{samples!r:.40} samples were asked for."
        raise ParameterError(Fault("samples", problem, f"{_FEWEST_SAMPLES} or more, for an interval of 90 %"))


@dataclass(frozen=True)
class Settings:
    """Limits of verdicts and warnings."""

    identified: float = 0.9
    """Smallest gain, the share of the prior variance that the measurement removes, of an identified parameter."""
    weakly_identified: float = 0.5
    """Smallest gain of a weakly identified parameter."""
    trading: float = 0.6
    """Correlation above which two parameters are said to trade with each other."""
    end_zone: float = 0.25
    """Width of the zone at an end of a parameter's range, over the width of its interval."""
    end_share: float = 1.0 / 3.0
    """Share of the posterior in this zone above which a parameter presses against the end. Half a Gaussian, cut off by
    the range, has 0.37 there; a parameter that is uniform over its range has 0.23."""
    effective_samples: int = 50
    """Below this effective sample size, a tail of an interval rests on two or three samples."""
    gap: float = 1.0 / 3.0
    """Part of an interval's width that holds no sample, from which a parameter has two separate groups of values. Of 50
    independent samples, evenly distributed, two neighbours are 0.08 of it apart."""
    split_half_difference: float = 0.5
    """Part of an interval's width by which its ends may differ between two halves of the samples."""


_SETTINGS = Settings()


@dataclass(frozen=True)
class Verdict:
    """How far one parameter can be known from the measurement.

    Parameters
    ----------
    word : str
        "identified", "weakly identified" or "not identifiable"; "not believed" if the result is not to be believed.
    gain : float
        Share of the prior variance that the measurement removes; 1 if the parameter is known exactly.
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
    model_error : ModelError
        The errors that the model was allowed.
    searches : int
        Number of searches, each for one sample; n of them converged.
    lines : int
        Number of lines with which the posterior was computed; with the form "samples", after the reduction to few.
    seconds : float
    form : {"samples", "laplace"}
        Samples of the posterior itself, or of its Laplace approximation.
    mode : (n_params,) array or None
        SI; the posterior mode, with the form "laplace".
    unreliable : tuple of str
        Parameters for which the Laplace approximation fails; their intervals are not to be trusted.
    caveat : str
        That of the `Identification`: why no interval is to be believed; empty if they may be.
    doubts : mapping of str to str
        By parameter, what the `Identification` says of a change with which it lies far beyond its interval.
    log_likelihood : (n,) array or None
        Of the measurement at each sample, up to a constant; None with the form
        "laplace" and with a result of an earlier version.
    normal : tuple of str
        Parameters whose prior is normal; that of the others is even over the range.
    """

    names: tuple[str, ...]
    theta: NDArray[np.float64]
    fraction: NDArray[np.float64]
    weight: NDArray[np.float64]
    estimate: NDArray[np.float64]
    model_error: ModelError
    searches: int
    lines: int
    seconds: float
    form: Form = "samples"
    mode: NDArray[np.float64] | None = None
    unreliable: tuple[str, ...] = ()
    caveat: str = ""
    doubts: Mapping[str, str] = field(default_factory=dict)
    log_likelihood: NDArray[np.float64] | None = None
    normal: tuple[str, ...] = ()

    @staticmethod
    def from_fractions(
        assembly: Assembly,
        fraction: NDArray[np.float64],
        weight: NDArray[np.float64],
        *,
        model_error: ModelError,
        searches: int,
        lines: int,
        seconds: float,
        log_likelihood: NDArray[np.float64] | None = None,
    ) -> Posterior:
        """Return the posterior with these samples, in fractions of the assembly's ranges."""
        normal = np.array([parameter.prior == "normal" for parameter in assembly.parameters])
        mean = weight @ fraction
        mean[normal] = unit_from_normal(weight @ normal_from_unit(fraction[:, normal]))
        return Posterior(
            names=tuple(parameter.name for parameter in assembly.parameters),
            theta=assembly.from_unit(fraction),
            fraction=fraction,
            weight=weight,
            estimate=assembly.from_unit(mean),
            model_error=model_error,
            searches=searches,
            lines=lines,
            seconds=seconds,
            log_likelihood=log_likelihood,
            normal=tuple(parameter.name for parameter in assembly.parameters if parameter.prior == "normal"),
        )

    def sample(self, count: int, seed: int = 0) -> NDArray[np.float64]:
        """Return samples of equal weight (count, n_params) in SI, drawn from `theta` by weight."""
        return np.asarray(self.theta[self.draw(count, np.random.default_rng([seed, 5]))])

    def draw(self, count: int, random: np.random.Generator) -> NDArray[np.intp]:
        """Return the indices (count,) of samples drawn by weight, in random order."""
        return random.permutation(drawn_by_weight(self.weight, count, random))

    @property
    def effective_sample_size(self) -> float:
        """Number of independent samples of equal weight with the same information (Kish)."""
        return float(1.0 / np.sum(self.weight**2))

    @property
    def converged_fraction(self) -> float:
        """Fraction of the searches that converged; the others fail where the posterior folds over."""
        return len(self.weight) / self.searches

    @cached_property
    def split_half_difference(self) -> Mapping[str, float]:
        """Difference of each interval between two halves of the samples, relative to its width, by name.

        It is taken on the parameters' scales. For n independent samples it is about 1.3 / sqrt(n).
        """
        differences = split_half_difference(self.fraction, self.weight, LEVEL)
        return dict(zip(self.names, differences.tolist(), strict=True))

    @cached_property
    def in_two_groups(self) -> tuple[str, ...]:
        """Parameters with two separate groups of values, as where two equal parts can be exchanged."""
        fraction, weight = self.fraction[::2], self.weight[::2]  # the others may be about the best fit, no second group
        low, high = quantiles(fraction, weight, _ends_of(LEVEL))
        drawn = fraction[drawn_by_weight(weight, len(weight), np.random.default_rng(7))]
        gaps = np.diff(np.sort(np.clip(drawn, low, high), axis=0), axis=0).max(axis=0, initial=0.0)
        enough = self.effective_sample_size >= _SETTINGS.effective_samples
        apart = enough & (gaps > _SETTINGS.gap * (high - low))
        return tuple(name for name, is_apart in zip(self.names, apart, strict=True) if is_apart)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings that a reader of the intervals must know."""
        messages = []
        if self.unreliable:
            messages.append(
                f"The form 'laplace' misleads on {', '.join(self.unreliable)}: the posterior is bent, the Gaussian is "
                "not. Do not trust these intervals; the form 'samples' gives better ones."
            )
        if self.effective_sample_size < _SETTINGS.effective_samples:
            messages.append(
                f"The samples tell no more than {self.effective_sample_size:.0f} independent ones would: the ends of "
                "the intervals are rough. Ask for more samples."
            )
        differences = self.split_half_difference.items()
        unstable = [f"{name} ({part:.0%})" for name, part in differences if part > _SETTINGS.split_half_difference]
        if unstable:
            messages.append(
                f"Two halves of the samples disagree on the intervals, in parts of their width: {', '.join(unstable)}. "
                "Ask for more samples."
            )
        return tuple(messages)

    def interval(self, level: float = LEVEL) -> Mapping[str, tuple[float, float]]:
        """Return the central interval of each parameter, SI, by name."""
        ends = quantiles(self.theta, self.weight, _ends_of(level))
        return {name: (float(low), float(high)) for name, low, high in zip(self.names, *ends, strict=True)}

    @cached_property
    def _deviations(self) -> NDArray[np.float64]:
        """(n, n_params) samples on the parameters' scales, in standard deviations of the prior from its middle."""
        deviations = np.sqrt(PRIOR_PRECISION) * (self.fraction - 0.5)
        normal = [name in self.normal for name in self.names]
        deviations[:, normal] = normal_from_unit(self.fraction[:, normal])
        return np.asarray(deviations)

    @cached_property
    def correlation(self) -> NDArray[np.float64]:
        """(n_params, n_params) correlations, on the parameters' scales."""
        centred = self._deviations - self.weight @ self._deviations
        covariance = (centred * self.weight[:, np.newaxis]).T @ centred
        deviation = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
        return np.asarray(covariance / np.outer(deviation, deviation))

    @cached_property
    def verdicts(self) -> Mapping[str, Verdict]:
        """How far each parameter can be known, by name."""
        mean = self.weight @ self._deviations
        gains = np.clip(1.0 - self.weight @ (self._deviations - mean) ** 2, 0.0, 1.0)
        return {name: self._verdict(index, float(gains[index])) for index, name in enumerate(self.names)}

    def _verdict(self, index: int, gain: float) -> Verdict:
        if self.caveat:
            return Verdict(NOT_BELIEVED, gain, self.caveat)
        word: Word = "not identifiable"
        if gain >= _SETTINGS.weakly_identified:
            word = "identified" if gain >= _SETTINGS.identified else "weakly identified"
        end = self._nearest_end(index)
        reasons = [f"it presses against the {end} end of its range"] if end else []
        if word != "identified":
            reasons.append(self._explanation(index, word))
        name = self.names[index]
        if name in self.in_two_groups:
            reasons.append("its values are in two separate groups, and the estimate is their mean")
        if name in self.doubts:
            reasons.append(self.doubts[name])
        if word == "identified" and (name in self.in_two_groups or name in self.doubts):
            word = "weakly identified"
        reason = "; ".join(reasons) or "the measurement fixes it"
        return Verdict(word, gain, f"{reason[0].upper()}{reason[1:]}.")

    def _nearest_end(self, index: int) -> str:
        """Return the end of the range, "lower" or "upper", that a parameter presses against; empty if none.

        A normal prior has no end to press against.
        """
        if self.names[index] in self.normal:
            return ""
        column = self.fraction[:, [index]]
        low, high = quantiles(column, self.weight, _ends_of(LEVEL))
        zone = _SETTINGS.end_zone * (high[0] - low[0])
        shares = {
            "lower": float(self.weight @ (column[:, 0] < zone)),
            "upper": float(self.weight @ (column[:, 0] > 1.0 - zone)),
        }
        end = max(shares, key=lambda name: shares[name])
        return end if shares[end] >= _SETTINGS.end_share else ""

    def _explanation(self, index: int, word: Word) -> str:
        """Say with which parameters this one trades, or that the FRF says little about it."""
        row = self.correlation[index].copy()
        row[index] = 0.0
        partners = [int(other) for other in np.argsort(-np.abs(row))[:2] if abs(row[other]) >= _SETTINGS.trading]
        if not partners:
            return f"the measurement {'hardly depends on it' if word == 'not identifiable' else 'tells little of it'}"
        named = " and ".join(f"{self.names[other]} (correlation {row[other]:+.2f})" for other in partners)
        return f"it trades with {named}"

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the fractions as plain values, fit for JSON."""
        intervals = self.interval()
        return {
            "form": self.form,
            "caveat": self.caveat,
            "level": LEVEL,
            "warnings": list(self.warnings),
            "parameters": {
                name: {
                    "estimate": float(estimate),
                    "interval": list(intervals[name]),
                    "verdict": self.verdicts[name].word,
                    "gain": self.verdicts[name].gain,
                    "reason": self.verdicts[name].reason,
                    "doubtful": name in self.unreliable,
                    "halves_apart": self.split_half_difference[name],
                }
                for name, estimate in zip(self.names, self.estimate, strict=True)
            },
            "correlation": self.correlation.tolist(),
            "effective_samples": self.effective_sample_size,
            "reached": self.converged_fraction,
            "model_error": self.model_error.to_dict(),
            "lines": self.lines,
            "seconds": self.seconds,
            "mode": None if self.mode is None else self.mode.tolist(),
            "samples": {
                "theta": self.theta.tolist(),
                "weight": self.weight.tolist(),
                "log_likelihood": None if self.log_likelihood is None else self.log_likelihood.tolist(),
            },
        }


def drawn_by_weight(weight: NDArray[np.float64], count: int, random: np.random.Generator) -> NDArray[np.intp]:
    """Return increasing indices (count,) of samples drawn by weight (systematic resampling)."""
    levels = (np.arange(count) + random.random()) / count * weight.sum()
    return np.asarray(np.minimum(np.searchsorted(np.cumsum(weight), levels), len(weight) - 1))


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
    low, high = quantiles(values, weight, _ends_of(level))
    first, second = (np.array(quantiles(rows, half / half.sum(), _ends_of(level))) for rows, half in halves)
    return np.asarray(np.abs(first - second).max(axis=0) / np.maximum(high - low, np.finfo(float).tiny))


def _ends_of(level: float) -> list[float]:
    """Return the quantiles at the ends of a central interval."""
    return [(1.0 - level) / 2.0, (1.0 + level) / 2.0]
