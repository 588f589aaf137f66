"""Sizes of the errors of a model, estimated from the measurement around the best fit.

Errors of each kind are normally distributed. Their standard deviation is the one that makes the residuals most probable
once parameters and errors are marginalised (empirical Bayes with a prior). Residuals are averaged more and more widely.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize

from dovetail.inference.adequacy.error_effects import ErrorEffects
from dovetail.inference.adequacy.evidence import marginalised_products, misfit_and_moments, removed_variance
from dovetail.inference.adequacy.verdict import word_for
from dovetail.inference.posterior.frequency_average import needs_average, unshaped_deviation, with_deviations
from dovetail.inference.posterior.likelihood import PRIOR_PRECISION, marginalised_squares
from dovetail.inference.posterior.model_error import KINDS, MODEL_ERROR, ModelError, typical_model_error
from dovetail.interfaces import Progress, silent
from dovetail.meanwhile import SharedProgress, in_parts


@dataclass(frozen=True)
class Settings:
    """How the sizes are estimated."""

    narrowest: float = 5e-4
    """Relative error of natural frequencies for which residuals are averaged first; then `wider` times more."""
    wider: float = 2.0
    widest: float = 0.15
    """The largest error for which residuals are averaged."""
    consistent: float = 2.0
    """Largest ratio of an estimate to this error, either way; a larger estimate needs wider averages."""
    unexplained: float = 0.05
    """Size of other errors up to which averages are wide enough."""
    fewest_apart: int = 2
    """Smallest number of widths that is worth another process."""
    settled: float = 0.1
    """Relative change of all sizes at which the alternation ends."""
    other_settled: float = 0.02
    """Relative change of the size of other errors at which its search ends."""
    usual_frequency: float = 4.0
    """Factor by which errors of natural frequencies usually differ from `MODEL_ERROR`: the standard deviation of a
    log-normal prior. The parameters imitate most of a small error, and the rest suggests a size far too small."""
    usual_ratio: float = 10.0
    """The same for the other errors' ratio to their typical sizes; a few resonances say little about it."""
    least: float = 1e-4
    """Size below which errors are negligible."""
    smallest: float = 1e-6
    """Smallest size of an error that has a shape."""
    most: float = 10.0
    """Largest size of errors; above it, the FRF is not informative."""
    fewest_values: float = 3.0
    """Independent values from which a size is known: within a factor of two with a probability of 90 %."""
    alternations: int = 6
    """Largest number of alternations between errors that have a shape and others."""


_SETTINGS = Settings()


@dataclass(frozen=True, eq=False)
class FitWithError:
    """The parameters that fit best when the model may have errors.

    Parameters
    ----------
    fraction : (p,) array
        Fractions of the ranges.
    values : (n_lines,) complex array
        The FRFs there.
    size : ModelError
        The errors that were allowed.
    information : (p, p) array
        Fisher information of the fractions, with these errors.
    chi_squared : float
        Mean square of the residuals with parameters and errors marginalised: 1 if errors have the size allowed.
    unknown : tuple of str
        Kinds of errors whose size the measurement does not determine: it is a usual one then.
    """

    fraction: NDArray[np.float64]
    values: NDArray[np.complex128]
    size: ModelError
    information: NDArray[np.float64]
    chi_squared: float
    unknown: tuple[str, ...] = ()


def fit_with_error(effects: ErrorEffects, size: ModelError) -> FitWithError:
    """Refit the parameters, starting from a fit, with errors of the model of a given size allowed."""
    return _Linearised(effects, effects.refit(size), size).result(size)


def judge_with_error(effects: ErrorEffects, size: ModelError) -> FitWithError:
    """Return what errors of given sizes, and others that make chi-squared 1, make of a fit with its parameters."""
    linearised = _Linearised(effects, effects.fraction, size)
    return linearised.result(linearised.with_other(size))


def estimate_model_error(effects: ErrorEffects, progress: Progress = silent) -> FitWithError:
    """Estimate the sizes of the model's errors around a fit.

    Parameters
    ----------
    effects : ErrorEffects
        The parameters of its fit are not changed. If a model has many errors, a fit that allows for all of them would
        give up the clear features, such as the peaks, for unclear ones.
    progress : Progress
    """
    size = _most_plausible(_estimates(effects, progress))
    linearised = _Linearised(effects, effects.fraction, size)
    return replace(linearised.result(size), unknown=_unknown(effects, linearised, size))


def _unknown(effects: ErrorEffects, linearised: _Linearised, size: ModelError) -> tuple[str, ...]:
    """Return the kinds of errors whose size neither the residuals nor the peaks determine.

    A standard deviation that is estimated from n values has a relative error of 1 / sqrt(2 n).
    """
    distance, _, heights = effects.peak_differences()
    from_peaks = {"natural_frequency": distance, "damping": heights}
    return tuple(
        kind
        for kind, values in linearised.determined_values(size).items()
        if values < _SETTINGS.fewest_values and _SETTINGS.consistent * from_peaks.get(kind, 0.0) < getattr(size, kind)
    )


def _estimates(effects: ErrorEffects, progress: Progress) -> list[tuple[float, ModelError]]:
    """Return the widths of averages, as errors of natural frequencies, and the sizes estimated with them."""
    least, distance, heights = effects.peak_differences()
    most = _SETTINGS.most if distance is None else _SETTINGS.consistent * max(_SETTINGS.narrowest, distance)
    widths, width = [], max(least, _SETTINGS.narrowest)
    while width <= min(most, _SETTINGS.widest):
        widths.append(width)
        width *= _SETTINGS.wider
    shared, limit = SharedProgress(progress), effects.problem.limit
    every = np.arange(len(widths))
    alternately = np.concatenate([every[::2], every[1::2]])  # narrow and wide ones in each half

    def estimate(rows: NDArray[np.intp]) -> list[tuple[float, ModelError]]:
        estimates = []
        for done, number in enumerate(alternately[rows].tolist()):
            shared("model error", done, len(widths))
            size = _estimate_by(effects, widths[number], least=least, heights=heights, most=most)
            estimates.append((widths[number], size))
        return estimates

    parts = in_parts(estimate, len(widths), _SETTINGS.fewest_apart, lambda: limit.was_stopped)
    return sorted(chain.from_iterable(parts), key=lambda estimate: estimate[0])


def _estimate_by(effects: ErrorEffects, width: float, *, least: float, heights: float, most: float) -> ModelError:
    """Return the sizes estimated with averages of one width, at least those that the peaks show, and at most `most`."""
    fraction = effects.fraction
    size = _Linearised(effects, fraction, typical_model_error(width), most).estimate()
    if width > _SETTINGS.narrowest:  # what is far below the width of an average is hidden in it
        size = replace(size, natural_frequency=max(size.natural_frequency, width / _SETTINGS.consistent))
    damping = np.sqrt(max(size.damping**2, heights**2 - size.magnitude**2))
    by_peaks = replace(size, natural_frequency=max(size.natural_frequency, least), damping=float(damping))
    if word_for(by_peaks) != "does not fit":  # peaks may have been taken for each other
        size = by_peaks
    estimate = _Linearised(effects, fraction, size).with_other(size)  # by the averages that intervals will use
    if word_for(estimate) != "does not fit":
        return estimate
    size = _Linearised(effects, fraction, typical_model_error(width), most).estimate_with_other_errors()
    moderate = _Linearised(effects, fraction, size).with_other(size)
    return estimate if word_for(moderate) == "does not fit" else moderate


def _most_plausible(by_width: list[tuple[float, ModelError]]) -> ModelError:
    """Return the estimate from the narrowest averages that leaves hardly more unexplained than wider ones.

    Estimates with which the model fits are preferred.
    """
    plausible = [size for width, size in by_width if size.natural_frequency <= _SETTINGS.consistent * width]
    plausible = [size for size in plausible if word_for(size) != "does not fit"] or plausible
    if not plausible:
        return by_width[-1][1]
    limit = max(_SETTINGS.unexplained, _SETTINGS.consistent * min(size.other for size in plausible))
    return next(size for size in plausible if size.other <= limit)


class _Linearised:
    """A fit with residuals that are linearised in the parameters and in the errors of the model."""

    def __init__(
        self, effects: ErrorEffects, fraction: NDArray[np.float64], size: ModelError, most: float = _SETTINGS.most
    ) -> None:
        self._effects, self.fraction, self._size, self._most = effects, fraction, size, most
        frf, jacobian = effects.model.frf_by_fractions(effects.problem.from_unit(fraction[np.newaxis]))
        self._frf, self._jacobian = frf, jacobian
        self._changes = {"parameters": jacobian[0] / np.sqrt(PRIOR_PRECISION), **effects.shapes(frf[0], size)}

    def _whitened(self, size: ModelError) -> tuple[NDArray[np.float64], dict[str, NDArray[np.float64]]]:
        """Return residuals (m,), whitened with the other errors, and their derivatives (k, m) by kind of error."""
        rows = self._rows(size.other)
        ends = np.cumsum([len(change) for change in self._changes.values()])[:-1]
        return rows[0], dict(zip(self._changes, np.split(rows[1:], ends), strict=True))

    @cached_property
    def _rows(self) -> Callable[[float], NDArray[np.float64]]:
        """Takes the size of other errors to residuals and derivatives (1 + k, m); FRFs are averaged only once."""
        effects, values, changes = self._effects, self._frf[0], np.concatenate(list(self._changes.values()))

        def sized(other: float) -> ModelError:
            return replace(self._size, other=other)

        def of_lines(other: float) -> NDArray[np.float64]:
            _, residual = effects.residual(values, sized(other))
            derivatives = residual.jacobian(values[np.newaxis], changes[np.newaxis])[0]
            return np.concatenate([residual.of(values[np.newaxis]), derivatives])

        if not needs_average(self._size):
            return of_lines
        lines, averages = effects.residual(values, sized(0.0))
        scaled, target = with_deviations(averages, values[lines], changes[:, lines]), effects.target
        return lambda other: scaled(target.split(unshaped_deviation(target, values, sized(other))))

    def estimate(self) -> ModelError:
        """Return the most probable sizes."""
        size = self._size
        for _ in range(_SETTINGS.alternations):
            before, size = size, self._estimate_shaped(self.with_other(size))
            if _change(size, before) < _SETTINGS.settled:
                break
        return size

    def _factors(self, size: ModelError) -> dict[str, float]:
        """Return the ratios of sizes to those of the shapes."""
        return {kind: getattr(size, kind) / (getattr(self._size, kind) or 1.0) for kind in KINDS}

    def _estimate_shaped(self, size: ModelError) -> ModelError:
        """Return the most probable sizes of the errors that have a shape.

        Parameters and nonlinear terms, of sizes that are known, are marginalised first.
        """
        residuals, changes = self._whitened(size)
        gram, along = marginalised_products(residuals, changes)
        counts = [len(changes[kind]) for kind in KINDS]

        def sizes(logarithms: NDArray[np.float64]) -> ModelError:
            return replace(size, **dict(zip(KINDS, np.exp(logarithms).tolist(), strict=True)))

        def improbability(logarithms: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
            """Return -2 log of the density of residuals and sizes, up to a constant, and its derivatives."""
            tried = sizes(logarithms)
            scale = np.repeat(list(self._factors(tried).values()), counts)
            misfit, moments = misfit_and_moments(gram * np.outer(scale, scale), scale * along)
            slopes = [2.0 * float(np.sum(1.0 - part)) for part in np.split(moments, np.cumsum(counts)[:-1])]
            prior, prior_slopes = _improbability(tried)
            return prior + misfit, prior_slopes + slopes

        least, start = np.log(_SETTINGS.smallest), np.log([getattr(size, kind) for kind in KINDS])
        ends = np.log([self._most, *(3 * [_SETTINGS.most])])
        bounds = [(least, end) if count else (at, at) for count, at, end in zip(counts, start, ends, strict=True)]
        return sizes(minimize(improbability, start, jac=True, method="L-BFGS-B", bounds=bounds).x)

    def estimate_with_other_errors(self) -> ModelError:
        """Return the most probable sizes with other errors of 5 %, without which huge ones may cancel each other."""
        return self._estimate_shaped(replace(self._size, other=_SETTINGS.unexplained))

    def with_other(self, size: ModelError) -> ModelError:
        """Return sizes in which the other errors are those that make chi-squared 1."""

        def excess(logarithm: float) -> float:
            return self.chi_squared(replace(size, other=float(np.exp(logarithm)))) - 1.0

        least, most = np.log(_SETTINGS.least), np.log(_SETTINGS.most)
        if excess(least) <= 0.0:
            return replace(size, other=0.0)
        root = most if excess(most) >= 0.0 else brentq(excess, least, most, xtol=_SETTINGS.other_settled)
        return replace(size, other=float(np.exp(root)))

    def chi_squared(self, size: ModelError) -> float:
        """Return the mean square of the residuals with parameters and errors marginalised."""
        return _mean_square(*self._scaled(size))

    def _scaled(self, size: ModelError) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return residuals (m,), and their changes (k, m) by one standard deviation of parameters and errors."""
        residuals, changes = self._whitened(size)
        factors = {"parameters": 1.0, "higher": 1.0, "background": 1.0, **self._factors(size)}
        return residuals, np.concatenate([factors[name] * change for name, change in changes.items()])

    def determined_values(self, size: ModelError) -> dict[str, float]:
        """Return by kind how many independent values of errors the measurement determines.

        Each error counts as the part of its variance that the measurement removes: 0 if parameters follow it.
        """
        residuals, changes = self._whitened(size)
        gram, _ = marginalised_products(residuals, changes)
        counts = [len(changes[kind]) for kind in KINDS]
        scale = np.repeat(list(self._factors(size).values()), counts)
        parts = np.split(removed_variance(gram * np.outer(scale, scale)), np.cumsum(counts)[:-1])
        return {kind: float(part.sum()) for kind, part in zip(KINDS, parts, strict=True)}

    def result(self, size: ModelError) -> FitWithError:
        residuals, columns = self._scaled(size)
        errors, parameters = columns[self._jacobian.shape[1] :], columns[: self._jacobian.shape[1]]
        along = parameters @ errors.T
        inner = np.linalg.solve(np.eye(len(errors)) + errors @ errors.T, along.T)
        information = PRIOR_PRECISION * (parameters @ parameters.T - along @ inner)
        return FitWithError(self.fraction, self._frf[0], size, information, _mean_square(residuals, columns))


def _mean_square(residuals: NDArray[np.float64], changes: NDArray[np.float64]) -> float:
    return float(marginalised_squares(residuals[np.newaxis], changes)[0]) / len(residuals)


def _improbability(size: ModelError) -> tuple[float, NDArray[np.float64]]:
    """Return -2 log of the prior density of sizes, up to a constant, and its derivatives by their logarithms."""
    compared = size, *(typical_model_error(factor * size.natural_frequency) for factor in (1.0, 2.0))
    actual, typical, doubled = np.array([[getattr(sizes, kind) for kind in KINDS[1:]] for sizes in compared])
    ratio, frequency = (1.0 / np.log(limit) ** 2 for limit in (_SETTINGS.usual_ratio, _SETTINGS.usual_frequency))
    off, far = np.log(typical / actual), float(np.log(size.natural_frequency / MODEL_ERROR))
    along = frequency * far + ratio * off @ (doubled > typical)  # up to a limit, typical sizes grow
    return frequency * far**2 + ratio * float(off @ off), 2.0 * np.array([along, *(-ratio * off)])


def _change(size: ModelError, before: ModelError) -> float:
    """Return the largest change of the logarithms of sizes that are not negligible."""
    now, then = (np.array([getattr(sizes, name) for name in (*KINDS, "other")]) for sizes in (size, before))
    return float(np.max(np.abs(np.log(np.maximum(now, _SETTINGS.least) / np.maximum(then, _SETTINGS.least)))))
