"""What a measurement says of each parameter: samples, estimates, intervals, and how far each can be known."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from numbers import Integral
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import Fault, ParameterError, listing
from dovetail.inference.posterior.evidence import Evidence
from dovetail.inference.posterior.likelihood import PRIOR_PRECISION, normal_from_unit, unit_from_normal
from dovetail.inference.posterior.model_error import ModelError
from dovetail.inference.posterior.verdicts import (
    FIXED,
    LEVEL,
    NOT_TRUSTWORTHY,
    VERDICT_LIMITS,
    Group,
    Known,
    Verdict,
    VerdictLimits,
    ends_cut,
    ends_of,
    heaviest_combination,
    how_little,
    precision_text,
    quantiles,
    separate_groups,
    split_half_difference,
    word_for,
    word_for_groups,
)
from dovetail.inference.posterior.weights import drawn_by_weight
from dovetail.interfaces import Parameter
from dovetail.problem.definition import values_at

_NUMBERS = {2: "two", 3: "three", 4: "four"}
_FEWEST_SAMPLES = 20  # of fewer, the ends of an interval would be the outermost samples

Form: TypeAlias = Literal["samples", "laplace"]


def check_options(samples: int) -> None:
    """Make sure that the number of a posterior's samples is an integer that is large enough.

    Raises
    ------
    ParameterError
    """
    if not (isinstance(samples, Integral) and samples >= _FEWEST_SAMPLES):
        problem = f"{samples!r:.40} samples were asked for."
        raise ParameterError(Fault("samples", problem, f"{_FEWEST_SAMPLES} or more, for an interval of 90 %"))


@dataclass(frozen=True)
class Settings:
    """Limits of reasons and warnings."""

    trading: float = 0.6
    """Correlation above which two parameters are said to trade with each other."""
    effective_samples: int = 50
    """Below this effective sample size, a tail of an interval rests on two or three samples."""
    split_half_difference: float = 0.5
    """Part of an interval's width by which its ends may differ between two halves of the samples."""


_SETTINGS = Settings()


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
        SI; posterior means, taken on the parameters' scales. Where likely values are in separate groups, the means of
        the combination of groups that holds the largest share of the posterior.
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
    warning : str
        That of the `Identification`: why no interval is trustworthy; empty if they may be.
    moved_by_causes : mapping of str to str
        By parameter, what the `Identification` says of a change with which it lies far beyond its interval.
    log_likelihood : (n,) array or None
        Of the measurement at each sample, up to a constant; None as `evidence`.
    normal : tuple of str
        Parameters whose prior is normal; that of the others is even over the range.
    evidence : Evidence or None
        The marginal likelihood; None if too few searches count for it, and with the form "laplace".
    least_log_evidence : float
        A lower bound of its logarithm, which few searches suffice for; not in the result's file.
    effective : float
        How many independent samples Metropolis steps left, where there were any: moved samples still resemble one
        another where they were drawn from the same few.
    limits : VerdictLimits
        Of the verdicts.
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
    warning: str = ""
    moved_by_causes: Mapping[str, str] = field(default_factory=dict)
    log_likelihood: NDArray[np.float64] | None = None
    normal: tuple[str, ...] = ()
    evidence: Evidence | None = None
    least_log_evidence: float = -np.inf
    effective: float = np.inf
    limits: VerdictLimits = VERDICT_LIMITS

    def __repr__(self) -> str:
        warning = f" {self.warning}" if self.warning else ""
        return f"<Posterior:{warning} {len(self.theta)} samples of {listing(self.names)}>"

    @staticmethod
    def from_fractions(
        parameters: Sequence[Parameter],
        fraction: NDArray[np.float64],
        weight: NDArray[np.float64],
        *,
        model_error: ModelError,
        searches: int,
        lines: int,
        seconds: float,
        log_likelihood: NDArray[np.float64] | None = None,
        evidence: Evidence | None = None,
        least_log_evidence: float = -np.inf,
        effective: float = np.inf,
    ) -> Posterior:
        """Return the posterior of parameters with these samples, in fractions of the ranges."""
        normal = np.array([parameter.prior == "normal" for parameter in parameters])
        return Posterior(
            names=tuple(parameter.name for parameter in parameters),
            theta=values_at(parameters, fraction),
            fraction=fraction,
            weight=weight,
            estimate=values_at(parameters, central_fractions(fraction, weight, normal)),
            model_error=model_error,
            searches=searches,
            lines=lines,
            seconds=seconds,
            log_likelihood=log_likelihood,
            normal=tuple(parameter.name for parameter in parameters if parameter.prior == "normal"),
            evidence=evidence,
            least_log_evidence=least_log_evidence,
            effective=effective,
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
        return float(min(1.0 / np.sum(self.weight**2), self.effective))

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
    def groups(self) -> Mapping[str, tuple[Group, ...]]:
        """The separate groups of the likely values of a parameter, by its name; of others there is no entry.

        There are several where equal parts can be exchanged, for example.
        """
        numbers = _group_numbers(self.fraction, self.weight)
        columns = np.flatnonzero(numbers.any(axis=0)).tolist()
        return {self.names[column]: tuple(self._groups(column, numbers[:, column])) for column in columns}

    def _groups(self, column: int, numbers: NDArray[np.intp]) -> Iterator[Group]:
        for number in range(int(numbers.max()) + 1):
            rows = numbers == number
            share = float(self.weight[rows].sum())
            levels = [ends_of(LEVEL)[0], 0.5, ends_of(LEVEL)[1]]
            ends = quantiles(self.theta[rows, column, np.newaxis], self.weight[rows] / share, levels)
            low, middle, high = (float(end[0]) for end in ends)
            yield Group.of(share, middle, low, high)

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
                f"The effective sample size is only {self.effective_sample_size:.0f}: the ends of "
                "the intervals are rough. Ask for more samples."
            )
        most = _SETTINGS.split_half_difference
        unstable = [f"{n} ({100 * part:.0f} %)" for n, part in self.split_half_difference.items() if part > most]
        if unstable:
            messages.append(
                f"Two halves of the samples disagree on the intervals, in parts of their width: {', '.join(unstable)}. "
                "Ask for more samples."
            )
        return tuple(messages)

    def interval(self, level: float = LEVEL) -> Mapping[str, tuple[float, float]]:
        """Return the central interval of each parameter, SI, by name."""
        ends = quantiles(self.theta, self.weight, ends_of(level))
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
        places = zip(*quantiles(self.fraction, self.weight, ends_of(LEVEL)), strict=True)
        known = [
            # a normal prior has no end that could cut anything off
            Known(estimate, *ends, gain, "" if name in self.normal else ends_cut(*place))
            for (name, ends), place, estimate, gain in zip(
                self.interval().items(), places, self.estimate.tolist(), gains.tolist(), strict=True
            )
        ]
        return {name: self._verdict(index, known[index]) for index, name in enumerate(self.names)}

    def _verdict(self, index: int, known: Known) -> Verdict:
        if self.warning:
            return Verdict(NOT_TRUSTWORTHY, known.gain, self.warning)
        name = self.names[index]
        word = word_for(known, self.limits)
        precision = precision_text(known, self.limits, is_normal=name in self.normal)
        reasons = []
        if known.is_determined and known.cut:
            reasons.append(f"it presses against the {known.cut} end of its range, which cuts its interval off")
        if word != "identified":
            reasons.append(self._explanation(index, known))
        if groups := self.groups.get(name, ()):
            word, precision = word_for_groups(groups, self.limits), f"{len(groups)} groups"
            several = _NUMBERS.get(len(groups), str(len(groups)))
            reasons.append(f"its likely values are in {several} separate groups; the estimate is that of the likeliest")
        if name in self.moved_by_causes:
            reasons.append(self.moved_by_causes[name])
            word = "weakly identified" if word == "identified" else word
        reason = "; ".join(reasons)
        sentence = f"{reason[0].upper()}{reason[1:]}." if reason else FIXED
        return Verdict(word, known.gain, sentence, precision, known.factor)

    def _explanation(self, index: int, known: Known) -> str:
        """Say with which parameters this one trades, or that the FRF says little about it."""
        row = self.correlation[index].copy()
        row[index] = 0.0
        partners = [int(other) for other in np.argsort(-np.abs(row))[:2] if abs(row[other]) >= _SETTINGS.trading]
        if not partners:
            return f"the measurement {how_little(known)}"
        named = " and ".join(f"{self.names[other]} (correlation {row[other]:+.2f})" for other in partners)
        return f"it trades with {named}"

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the fractions as plain values, fit for JSON."""
        intervals = self.interval()
        return {
            "form": self.form,
            "warning": self.warning,
            "level": LEVEL,
            "limits": asdict(self.limits),
            "warnings": list(self.warnings),
            "parameters": {
                name: {
                    "estimate": float(estimate),
                    "interval": list(intervals[name]),
                    "verdict": self.verdicts[name].word,
                    "precision": self.verdicts[name].precision,
                    "factor": self.verdicts[name].factor,
                    "groups": [asdict(group) for group in self.groups.get(name, ())],
                    "gain": self.verdicts[name].gain,
                    "reason": self.verdicts[name].reason,
                    "unreliable": name in self.unreliable,
                    "halves_apart": self.split_half_difference[name],
                }
                for name, estimate in zip(self.names, self.estimate, strict=True)
            },
            "correlation": self.correlation.tolist(),
            "effective_samples": self.effective_sample_size,
            "reached": self.converged_fraction,
            "model_error": self.model_error.to_dict(),
            "evidence": None if self.evidence is None else asdict(self.evidence),
            "lines": self.lines,
            "seconds": self.seconds,
            "mode": None if self.mode is None else self.mode.tolist(),
            "samples": {
                "theta": self.theta.tolist(),
                "weight": self.weight.tolist(),
                "log_likelihood": None if self.log_likelihood is None else self.log_likelihood.tolist(),
            },
        }


def central_fractions(
    fraction: NDArray[np.float64], weight: NDArray[np.float64], normal: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return the estimates (n_params,) of weighted samples, in fractions of the ranges, as in `Posterior`.

    Parameters
    ----------
    fraction : (n, n_params) array
    weight : (n,) array
    normal : (n_params,) array of bool
        Which parameters have a normal prior: the mean of these is taken on its quantiles.
    """

    def means(rows: NDArray[np.bool_]) -> NDArray[np.float64]:
        share = weight[rows] / weight[rows].sum()
        mean = share @ fraction[rows]
        mean[normal] = unit_from_normal(share @ normal_from_unit(fraction[rows][:, normal]))
        return np.asarray(mean)

    numbers = _group_numbers(fraction, weight)
    mean = means(np.ones(len(weight), dtype=np.bool_))
    grouped = numbers.any(axis=0)
    if grouped.any():
        mean[grouped] = means(heaviest_combination(numbers[:, grouped], weight))[grouped]
    return mean


def _group_numbers(fraction: NDArray[np.float64], weight: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the group (n, n_params) of each sample for each parameter; 0 everywhere if there is one group."""
    return np.stack([separate_groups(column, weight) for column in fraction.T], axis=1)
