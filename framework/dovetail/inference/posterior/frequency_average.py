"""Residuals that allow for errors of a model: averaged over neighbouring lines if natural frequencies are off.

The residuals at a resonance that is misplaced by several widths no longer depend linearly on its frequency. Averaged
over a band as wide as the error of natural frequencies they do, and all methods for small errors apply.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky_banded, solve_banded
from scipy.sparse import csr_array

from dovetail.frf import Frf
from dovetail.frf.resonances import fit_resonances
from dovetail.inference.posterior.model_error import ModelError
from dovetail.problem.observations import Observations, StackedResiduals
from dovetail.problem.residuals import Residual


@dataclass(frozen=True)
class Settings:
    """How residuals are averaged."""

    averaged_from: float = 1e-3
    """Relative error of natural frequencies above which lines are averaged; below, its effect is nearly linear."""
    width: float = 2.0
    """Standard deviation of the Gaussian that weights the lines, over the error of natural frequencies. With averages
    this wide, the effect of displacing a resonance by several times this error is still nearly linear."""
    spacing: float = 1.5
    """Distance between averages, in standard deviations of the Gaussian."""
    reach: float = 4.0
    """Standard deviations beyond which lines have no weight."""
    narrow: float = 0.7
    """Standard deviation, in spacings of the lines, below which a line is not averaged."""
    jitter: float = 1e-9
    """Relative increase of the variance, since averages that share most of their lines are nearly dependent."""
    lines_per_deviation: float = 1.5
    """Smallest number of lines of the model in a standard deviation of the Gaussian."""
    lines_per_width: float = 1.4
    """Lines of the model in half the width of a resonance; with one, the sum over a Lorentzian errs by exp(-2 pi)."""
    wander: float = 5.0
    """Displacement of a resonance, in errors of natural frequencies, up to which lines are as close as it needs."""


_SETTINGS = Settings()


def needs_average(size: ModelError) -> bool:
    """Return whether the error of natural frequencies is so large that lines are averaged."""
    return size.natural_frequency >= _SETTINGS.averaged_from


def weigh(
    target: Observations,
    variance: NDArray[np.float64],
    used: NDArray[np.bool_],
    values: NDArray[np.complex128],
    size: ModelError,
) -> tuple[NDArray[np.intp], Residual]:
    """Return residuals that allow for errors of a model, and the lines on which these need the model's FRFs.

    Parameters
    ----------
    target : Observations
    variance : (n_lines,) array
        E|random error|^2 of each line.
    used : (n_lines,) bool array
    values : (n_lines,) complex array
        The model's FRFs.
    size : ModelError
        Errors without a shape are added to the random error. If `needs_average`, the relative standard deviation of the
        Gaussian that weights the lines is twice the error of natural frequencies.

    Returns
    -------
    lines : (m,) array
        Increasing indices; fewer than all if lines are averaged and resonances are broad.
    residuals : Residual
        Of single lines (`Weighted`), or averaged over neighbouring ones (`AveragedResiduals`), of the FRFs on these
        lines.
    """
    deviation = unshaped_deviation(target, values, size)
    if not needs_average(size):
        return np.arange(len(values)), target.weighted(variance + deviation**2, used)
    poles = fit_resonances(target.frfs, target.split(values)).poles
    width = _SETTINGS.width * size.natural_frequency
    lines, averaged = [], []
    responses = zip(target.firsts, target.frfs, *map(target.split, (variance, used, deviation)), strict=True)
    for first, frf, noise, counted, unshaped in responses:
        needed = _needed_lines(frf.frequency, poles, width)
        averaged.append(AveragedResiduals(frf, noise, counted, needed, width, unshaped))
        lines.append(first + needed)
    return np.concatenate(lines), StackedResiduals(tuple(averaged), tuple(len(needed) for needed in lines))


def with_deviations(
    averages: Residual, frf: NDArray[np.complex128], frf_jacobian: NDArray[np.complex128]
) -> Callable[[Sequence[NDArray[np.float64]]], NDArray[np.float64]]:
    """Average FRFs once, for residuals with several standard deviations of the additional errors.

    Parameters
    ----------
    averages : Residual
        Of lines that are averaged, from `weigh`.
    frf : (f,) array
        The FRFs of all responses.
    frf_jacobian : (p, f) array
        Their derivatives.

    Returns
    -------
    callable
        Takes the standard deviations (n_freq,) of each response to residuals and their derivatives, (1 + p, m).
    """
    assert isinstance(averages, StackedResiduals)
    ends = np.cumsum(averages.counts)[:-1]
    blocks = zip(averages.responses, np.split(frf, ends), np.split(frf_jacobian, ends, axis=1), strict=True)
    scalings = [response.with_deviations(*block) for response, *block in blocks]

    def scaled(deviations: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
        pairs = zip(scalings, deviations, strict=True)
        return np.concatenate([scaling(deviation) for scaling, deviation in pairs], axis=1)

    return scaled


def unshaped_deviation(target: Observations, values: NDArray[np.complex128], size: ModelError) -> NDArray[np.float64]:
    """Return the standard deviation (n_lines,) of the errors of a model that have no shape.

    They are relative to the larger of the model's and the measured amplitude: at an antiresonance of the model, its
    amplitude may be a thousandth of the measured one.
    """
    return np.asarray(size.other * np.maximum(np.abs(values), target.amplitude))


def _needed_lines(frequency: NDArray[np.float64], poles: NDArray[np.complex128], width: float) -> NDArray[np.intp]:
    """Return the indices of the lines on which averages of FRFs with resonances near `poles` are computed."""
    spacing = width * frequency / _SETTINGS.lines_per_deviation
    for pole in poles:
        off_resonance = np.abs(frequency - pole.real) - _SETTINGS.wander * width * pole.real
        spacing = np.minimum(spacing, np.maximum(pole.imag, off_resonance) / _SETTINGS.lines_per_width)
    step = _steps(frequency)
    density = np.cumsum(step / np.maximum(spacing, step))
    lines = np.searchsorted(density, np.arange(density[0], density[-1]) - 1e-9)
    return np.unique(np.concatenate([lines, [0, len(frequency) - 1]]))


def _steps(frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the spacing around each line (n_freq,); 1 for a single one."""
    return np.gradient(frequency) if len(frequency) > 1 else np.ones(1)


class AveragedResiduals(Residual):
    """Residuals of one response, averaged over neighbouring lines and scaled to covariance 1.

    Parameters
    ----------
    measured : Frf
    variance : (n_freq,) array
        E|random error|^2 of each line.
    used : (n_freq,) bool array
    lines : (m,) array
        The lines on which FRFs are given.
    width : float
        Standard deviation of the Gaussian that weights the lines, relative to the frequency in its middle.
    deviation : (n_freq,) array
        Standard deviation of an additional error of each average, at each line.
    """

    def __init__(
        self,
        measured: Frf,
        variance: NDArray[np.float64],
        used: NDArray[np.bool_],
        lines: NDArray[np.intp],
        width: float,
        deviation: NDArray[np.float64],
    ) -> None:
        self._has_phase = measured.has_phase
        frequency = measured.frequency[used]
        averages = _averages(frequency, width)
        weights = _gaussian_weights(frequency, averages)
        self._weights = _gaussian_weights(measured.frequency[lines], averages)
        values = measured.values if measured.has_phase else measured.amplitude
        self._measured = weights @ values[used]
        self._count = len(averages) * (2 if measured.has_phase else 1)
        self._used, self._used_weights = used, weights
        self._covariance = _banded_covariance(weights, variance[used] / 2.0)
        self._factor = self._factor_with(deviation)

    @property
    def log_scale(self) -> float:
        """Logarithm of the residuals' density where they are 0, as a density of the averages of the measured values."""
        parts = 2.0 if self._has_phase else 1.0
        return -parts * float(np.sum(np.log(self._factor[0])) + len(self._factor[0]) * np.log(2.0 * np.pi) / 2.0)

    def _factor_with(self, deviation: NDArray[np.float64]) -> NDArray[np.float64]:
        covariance = self._covariance.copy()
        covariance[0] += (self._used_weights @ deviation[self._used]) ** 2 / 2.0
        return np.asarray(cholesky_banded(covariance, lower=True))

    def of(self, frf: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the residuals (n, m) of FRFs (n, f)."""
        return self._scaled(self._differences(frf), self._factor)

    def jacobian(self, frf: NDArray[np.complex128], frf_jacobian: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return their derivatives (n, p, m) from FRFs (n, f) and their derivatives (n, p, f)."""
        return self._scaled(self._changes(frf, frf_jacobian), self._factor)

    def with_deviations(
        self, frf: NDArray[np.complex128], frf_jacobian: NDArray[np.complex128]
    ) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
        """Return residuals and derivatives (1 + p, m) as a function of the deviation; see the function of that name."""
        differences = self._differences(frf[np.newaxis])
        both = np.concatenate([differences, self._changes(frf[np.newaxis], frf_jacobian[np.newaxis])[0]])
        return lambda deviation: self._scaled(both, self._factor_with(deviation))

    def _differences(self, frf: NDArray[np.complex128]) -> NDArray[Any]:
        return np.asarray(self._averaged(frf if self._has_phase else np.abs(frf)) - self._measured)

    def _changes(self, frf: NDArray[np.complex128], frf_jacobian: NDArray[np.complex128]) -> NDArray[Any]:
        if self._has_phase:
            return self._averaged(frf_jacobian)
        amplitude = np.maximum(np.abs(frf), np.finfo(float).tiny)
        return self._averaged(np.real(frf_jacobian * (np.conj(frf) / amplitude)[:, np.newaxis]))

    def _averaged(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return averages (..., n_averages) of values (..., f)."""
        columns = np.ascontiguousarray(values.reshape(-1, values.shape[-1]).T)
        return np.asarray((self._weights @ columns).T.reshape(*values.shape[:-1], self._weights.shape[0]))

    def _scaled(self, averages: NDArray[Any], factor: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return averages (..., n_averages) scaled to covariance 1; each real part precedes its imaginary part."""
        columns = averages.reshape(-1, averages.shape[-1]).T
        white = np.ascontiguousarray(solve_banded((len(factor) - 1, 0), factor, columns).T)
        return np.asarray(white.view(np.float64).reshape(*averages.shape[:-1], self._count))


Average = tuple[float, float]
"""Middle and standard deviation [Hz]; the latter is 0 for a single line."""


def _averages(frequency: NDArray[np.float64], width: float) -> list[Average]:
    step = _steps(frequency)
    averages, line = list[Average](), 0
    while line < len(frequency):
        middle = float(frequency[line])
        deviation = width * middle
        if deviation < _SETTINGS.narrow * step[line]:
            averages.append((middle, 0.0))
            line += 1
        else:
            averages.append((middle, deviation))
            line = max(line + 1, int(np.searchsorted(frequency, middle + _SETTINGS.spacing * deviation)))
    return averages


def _gaussian_weights(frequency: NDArray[np.float64], averages: Sequence[Average]) -> csr_array:
    """Return the weights (n_averages, n_freq) of the lines in the averages; each row sums to 1."""
    step = _steps(frequency)
    rows, columns, weights = [], [], []
    for row, (middle, deviation) in enumerate(averages):
        low, high = np.searchsorted(frequency, middle + _SETTINGS.reach * deviation * np.array([-1.0, 1.0]))
        if high <= low:
            low = min(max(low - 1, 0) + int(np.argmin(np.abs(frequency[max(low - 1, 0) : low + 1] - middle))), low)
            high = low + 1
        lines = np.arange(low, high)
        weight = step[lines]
        if deviation:
            weight = weight * np.exp(-0.5 * ((frequency[lines] - middle) / deviation) ** 2)
        rows.append(np.full(len(lines), row))
        columns.append(lines)
        weights.append(weight / weight.sum())
    indices = np.concatenate(rows), np.concatenate(columns)
    return csr_array((np.concatenate(weights), indices), shape=(len(rows), len(frequency)))


def _banded_covariance(weights: csr_array, variance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the covariance of the averages of lines with a variance, as `scipy.linalg.cholesky_banded` takes it."""
    covariance = ((weights * variance) @ weights.T).tocoo()
    below = covariance.row - covariance.col
    lower = below >= 0
    bands = np.zeros((int(below.max()) + 1, covariance.shape[0]))
    bands[below[lower], covariance.col[lower]] = covariance.data[lower]
    bands[0] *= 1.0 + _SETTINGS.jitter
    return bands
