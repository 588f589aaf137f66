"""Measured FRFs, one for each response of an assembly, each on its own lines; their lines are concatenated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from typing import Any, Generic, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from dovetail.description import Description
from dovetail.errors import Fault, MeasurementError
from dovetail.frf import Frf, Quantity
from dovetail.problem.random_error import (
    estimated_variance,
    is_too_short,
    isolated_lines,
    known_variance,
    least_variance,
    most_likely_parts,
    normal_residuals,
    random_error_variance,
    residual_variance,
)
from dovetail.problem.residuals import LogAmplitude, Residual, Weighted, joined, split_by_response

Weights = Literal["coherence", "amplitude"] | NDArray[np.float64]
"""How much each line counts if not by its random error; see `weighted_variance`."""
_LEAST_COHERENCE = 1e-3
"""Smallest coherence, and smallest distance from 1, by which lines are weighted."""

_LEAST_DISCREPANCY = 1e-6
"""Relative error of a model that is negligible."""


def one_per_response(description: Description, measured: Frf | Sequence[Frf]) -> tuple[Frf, ...]:
    """Return the measured FRFs, one for each described response in its order.

    Raises
    ------
    MeasurementError
        There are more or fewer.
    """
    frfs = (measured,) if isinstance(measured, Frf) else tuple(measured)
    labels = description.response_labels
    if len(frfs) == len(labels):
        return frfs
    wanted = "; ".join(f"{number}. {label}" for number, label in enumerate(labels, start=1))
    received = f"{_counted(len(frfs), 'measured FRF')} {'was' if len(frfs) == 1 else 'were'} given"
    expected = f"'{description.name}' has {_counted(len(labels), 'response')}"
    remedy = "Give one FRF for each response, in this order."
    raise MeasurementError(Fault("measured", f"{received}, and {expected}.", wanted, remedy))


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"


_Kind = TypeVar("_Kind", bound=Residual)


@dataclass(frozen=True, eq=False)
class StackedResiduals(Residual, Generic[_Kind]):
    """Residuals of one response or several, concatenated.

    Parameters
    ----------
    responses : tuple of residuals of one kind
        The residuals of each response.
    counts : tuple of int
        Lines of each response.
    """

    responses: tuple[_Kind, ...]
    counts: tuple[int, ...]

    def of(self, frf: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the residuals (n, m) of FRFs (n, f)."""
        pairs = zip(self.responses, self._split(frf), strict=True)
        return joined([residual.of(block) for residual, block in pairs], axis=-1)

    def jacobian(self, frf: NDArray[np.complex128], frf_jacobian: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return their derivatives (n, p, m) from FRFs (n, f) and their derivatives (n, p, f)."""
        blocks = zip(self.responses, self._split(frf), self._split(frf_jacobian), strict=True)
        return joined([residual.jacobian(*block) for residual, *block in blocks], axis=-1)

    def factored(self) -> tuple[NDArray[np.float64] | None, Residual]:
        """Return the factors of all responses and the rest of their residuals, if one of them has factors."""
        pairs = [residual.factored() for residual in self.responses]
        if all(factors is None for factors, _ in pairs):
            return None, self
        each = zip(pairs, self.counts, strict=True)
        factors = [np.ones(count) if factor is None else factor for (factor, _), count in each]
        return joined(factors, axis=0), StackedResiduals(tuple(residual for _, residual in pairs), self.counts)

    @property
    def log_scale(self: StackedResiduals[Any]) -> float:
        """Logarithm of the residuals' density where they are 0, as a density of the measured values."""
        return float(sum(residual.log_scale for residual in self.responses))

    def size(self: StackedResiduals[Weighted], frf: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the size (f,) of each line's residual, as `Weighted.size`."""
        pairs = zip(self.responses, self._split(frf), strict=True)
        return joined([residual.size(block) for residual, block in pairs], axis=-1)

    def at(self: StackedResiduals[Weighted], lines: NDArray[np.intp]) -> StackedResiduals[Weighted]:
        """Return the residuals of some lines (increasing indices), without responses that have none of them."""
        pairs = zip(self.responses, split_by_response(lines, self.counts), strict=True)
        kept = [(residual.at(rows), len(rows)) for residual, rows in pairs if len(rows)]
        return StackedResiduals(*zip(*kept, strict=True))

    def lines_of(self: StackedResiduals[Weighted], residuals: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return the indices of the lines to which residuals belong, increasing, each once."""
        return np.unique(self._lines[residuals])

    def residuals_of(self: StackedResiduals[Weighted], lines: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return the indices of the residuals of some lines."""
        return np.flatnonzero(np.isin(self._lines, lines))

    @property
    def _lines(self: StackedResiduals[Weighted]) -> NDArray[np.intp]:
        """(m,) the line of each residual."""
        numbers_per_line = np.repeat([2 if residual.has_phase else 1 for residual in self.responses], self.counts)
        return np.repeat(np.arange(sum(self.counts)), numbers_per_line)

    def _split(self, values: NDArray[np.complex128]) -> list[NDArray[np.complex128]]:
        return [values] if len(self.counts) == 1 else np.split(values, np.cumsum(self.counts)[:-1], axis=-1)


@dataclass(frozen=True, eq=False)
class Observations:
    """Measured FRFs as arrays over the lines of all responses, concatenated response by response.

    Parameters
    ----------
    frfs : tuple of Frf
        One for each response, in its quantity, on its frequencies in the assembly.
    recorded : tuple of str
        Quantity in which each was measured, if it may be another one.
    """

    frfs: tuple[Frf, ...]
    recorded: tuple[Quantity, ...] = ()

    @staticmethod
    def of(description: Description, measured: Frf | Sequence[Frf]) -> Observations:
        """Return the observations of one FRF, or of one for each described response, in any quantities.

        Raises
        ------
        MeasurementError
            There are more or fewer than responses.
        """
        frfs = one_per_response(description, measured)
        pairs = zip(frfs, description.responses, strict=True)
        in_quantities = tuple(frf.to(response.quantity) for frf, response in pairs)
        return Observations(in_quantities, tuple(frf.quantity for frf in frfs))

    @property
    def recorded_quantities(self) -> tuple[Quantity, ...]:
        """Quantity in which each FRF was measured."""
        return self.recorded or tuple(frf.quantity for frf in self.frfs)

    @property
    def counts(self) -> tuple[int, ...]:
        """Lines of each response."""
        return tuple(len(frf.frequency) for frf in self.frfs)

    @property
    def firsts(self) -> tuple[int, ...]:
        """Number of the first line of each response."""
        return tuple(accumulate(self.counts[:-1], initial=0))

    @property
    def frequency(self) -> NDArray[np.float64]:
        """(n_lines,) Hz."""
        return np.concatenate([frf.frequency for frf in self.frfs])

    @cached_property
    def values(self) -> NDArray[np.complex128]:
        """(n_lines,) measured; real where there is no phase."""
        return np.concatenate([frf.values for frf in self.frfs])

    @cached_property
    def amplitude(self) -> NDArray[np.float64]:
        """(n_lines,) of the measured values."""
        return np.concatenate([frf.amplitude for frf in self.frfs])

    def at(self, lines: NDArray[np.intp]) -> Observations:
        """Return the observations at some lines (increasing indices), without responses that have none of them."""
        pairs = zip(self.frfs, split_by_response(lines, self.counts), strict=True)
        return Observations(
            tuple(
                Frf(frf.frequency[rows], frf.values[rows], frf.quantity, has_phase=frf.has_phase)
                for frf, rows in pairs
                if len(rows)
            )
        )

    def split(self, lines: NDArray[Any]) -> list[NDArray[Any]]:
        """Split an array (..., n_lines) into those of the responses."""
        return np.split(lines, np.cumsum(self.counts)[:-1], axis=-1)

    @cached_property
    def _known_variances(self) -> list[NDArray[np.float64] | None]:
        return [known_variance(frf) for frf in self.frfs]

    @property
    def variance_known(self) -> bool:
        """Whether the random error of every measurement is known."""
        return all(variance is not None for variance in self._known_variances)

    def variance(self, model: NDArray[np.complex128] | None = None) -> NDArray[np.float64]:
        """Return E|error|^2 (n_lines,) of each line: known, or estimated from the scatter.

        Parameters
        ----------
        model : (n_lines,) array, optional
            A model's values, which improve the estimate.
        """
        models = [None] * len(self.frfs) if model is None else self.split(model)
        responses = zip(self.frfs, self._known_variances, models, strict=True)
        return np.concatenate(
            [_estimated(frf, values) if variance is None else variance for frf, variance, values in responses]
        )

    def assumes(self, variance: NDArray[np.float64]) -> bool:
        """Return whether a response's variance (n_lines,) is assumed, since it has too few lines to estimate it."""
        return bool(self.assumed(variance).any())

    def assumed(self, variance: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which lines belong to such a response."""
        responses = zip(self.frfs, self._known_variances, self.split(variance), strict=True)
        assumed = [
            known is None and is_too_short(frf) and np.array_equal(variances, estimated_variance(frf))
            for frf, known, variances in responses
        ]
        return np.repeat(np.array(assumed, dtype=np.bool_), self.counts)

    def residual_variance(
        self, model: NDArray[np.complex128], used: NDArray[np.bool_], share: float
    ) -> NDArray[np.float64]:
        """Return E|error|^2 (n_lines,) of each line: known, or estimated from the residuals of a model.

        Parameters
        ----------
        model : (n_lines,) array
            Values whose residuals are nothing but noise.
        used : (n_lines,) bool array
            Lines that were not left out.
        share : float
            Degrees of freedom over residuals: the part of the random error that a fit leaves in them.
        """
        responses = zip(self.frfs, self._known_variances, self.split(model), self.split(used), strict=True)
        return np.concatenate(
            [
                known if known is not None else residual_variance(frf, values, lines) / share
                for frf, known, values, lines in responses
            ]
        )

    def by_line(self, residuals: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Return whitened residuals (m,) as an array (n_freq, n) for each response, a row for each line.

        Those of noise are normally distributed, even if the variance is itself an estimate from few averages.
        """
        counts = [(len(frf.frequency), 2 if frf.has_phase else 1) for frf in self.frfs]
        ends = np.cumsum([lines * width for lines, width in counts])[:-1]
        parts = zip(self.frfs, np.split(residuals, ends), counts, strict=True)
        return [normal_residuals(frf, part.reshape(shape)) for frf, part, shape in parts]

    def weighted(self, variance: NDArray[np.float64], used: NDArray[np.bool_]) -> StackedResiduals[Weighted]:
        """Return the whitened residuals of the lines `used`."""
        responses = zip(self.frfs, self.split(variance), self.split(used), strict=True)
        return StackedResiduals(tuple(Weighted.against(*response) for response in responses), self.counts)

    def logarithms(self, variance: NDArray[np.float64]) -> Residual:
        """Return the residuals of the amplitudes' logarithms."""
        pairs = zip(self.frfs, self.split(variance), strict=True)
        return StackedResiduals(tuple(LogAmplitude(*pair) for pair in pairs), self.counts)

    def squares(self, model: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return |difference|^2 (n_lines,) from a model's values; without a phase, twice that of the amplitudes."""
        pairs = zip(self.frfs, self.split(model), strict=True)
        return np.concatenate(
            [np.abs(_difference(frf, values)) ** 2 * (1.0 if frf.has_phase else 2.0) for frf, values in pairs]
        )

    @cached_property
    def level(self) -> NDArray[np.float64]:
        """Median amplitude of each line's response (n_lines,): the reference of errors that are equal on all lines."""
        levels = [float(np.median(frf.amplitude)) or float(frf.amplitude.mean()) for frf in self.frfs]
        return np.repeat(levels, self.counts)

    def discrepancy(
        self,
        model: NDArray[np.complex128],
        magnitude: NDArray[np.float64],
        variance: NDArray[np.float64],
        used: NDArray[np.bool_],
    ) -> tuple[float, float]:
        """Return the most likely errors of a model's values (n_lines,), in addition to the random error.

        They are standard deviations relative to a magnitude (n_lines,), and to the level of each response.
        """
        size, level = (np.maximum(each[used] ** 2, np.finfo(float).tiny) for each in (magnitude, self.level))
        least = _LEAST_DISCREPANCY**2 * float(level.min())
        background, relative = most_likely_parts(self.squares(model)[used], level, size, least, variance[used])
        return float(np.sqrt(relative)), float(np.sqrt(background))

    def isolated(self, size: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which lines (n_lines,) are isolated in their response, by the size of their residuals."""
        return np.concatenate([isolated_lines(sizes) for sizes in self.split(size)])

    def residual_count(self, used: NDArray[np.bool_]) -> int:
        """Return how many residuals the lines `used` have: two each where there is a phase."""
        pairs = zip(self.frfs, self.split(used), strict=True)
        return sum((2 if frf.has_phase else 1) * int(np.count_nonzero(lines)) for frf, lines in pairs)


def _difference(frf: Frf, model: NDArray[np.complex128]) -> NDArray[Any]:
    """Return a model's values (n_freq,) minus the measured ones: complex, or of amplitudes where there is no phase."""
    return model - frf.values if frf.has_phase else np.abs(model) - frf.amplitude


def _estimated(frf: Frf, model: NDArray[np.complex128] | None) -> NDArray[np.float64]:
    return estimated_variance(frf, model if model is None or frf.has_phase else np.abs(model))


def weighted_variance(frf: Frf, weights: Weights) -> NDArray[np.float64]:
    """Return the variance (n_freq,) that gives lines these weights, at the level of the random error.

    Parameters
    ----------
    frf : Frf
    weights : {"coherence", "amplitude"} or (n_freq,) array
        With "coherence", the variance is proportional to (1 - c) / c times the squared amplitude; with "amplitude", to
        the squared amplitude itself, so that relative errors count, as with logarithms; with an array, to its inverse.

    Raises
    ------
    MeasurementError
        There is no coherence, or the array has another length or is not positive.
    """
    importance = _importance(frf, weights)
    magnitude = 1.0 if isinstance(weights, np.ndarray) else np.maximum(frf.amplitude**2, least_variance(frf))
    shape = magnitude / importance
    ratio = random_error_variance(frf) / shape
    if isinstance(weights, str) and weights == "amplitude":
        return np.asarray(shape * np.median(ratio))  # lines of no amplitude have any relative error
    return np.asarray(shape * np.sum(ratio * importance) / np.sum(importance))


def _importance(frf: Frf, weights: Weights) -> NDArray[np.float64]:
    """Return how much each line counts (n_freq,), up to a factor of its magnitude."""
    if isinstance(weights, np.ndarray):
        if weights.shape != frf.frequency.shape or not (np.isfinite(weights).all() and (weights > 0).all()):
            problem = f"weights of shape {weights.shape} were given for {frf.frequency.size} lines."
            raise MeasurementError(Fault(frf.label, problem, "a positive number for each line of the measurement"))
        return weights.astype(np.float64)
    if weights == "amplitude":
        return np.ones_like(frf.frequency)
    if frf.coherence is None:
        raise MeasurementError(Fault(frf.label, "it has no coherence by which its lines could be weighted."))
    coherence = np.clip(frf.coherence, _LEAST_COHERENCE, 1.0 - _LEAST_COHERENCE)
    return np.asarray(coherence / (1.0 - coherence))
