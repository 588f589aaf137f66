"""The lines of a measurement in a fit: those of a search, few, and the weights of all.

With them, residuals smoothed over neighbours, and delays.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from dovetail.frf.resonance_peaks import prominent_peaks
from dovetail.inference.fitting.whiteness import NOISE_ALARM, has_size_of_noise, is_of_few_lines, is_white
from dovetail.problem.least_squares import SumOfSquares
from dovetail.problem.observations import Observations, StackedResiduals
from dovetail.problem.residuals import Residual, Weighted


@dataclass(frozen=True)
class Settings:
    """Tuning constants of the lines of a search, and of weights."""

    even: int = 300
    """Evenly spaced lines of each response."""
    similar: int = 3
    """Every so many of these lines show how similar an FRF is to the measured one."""
    prominence: float = 6.0
    """Prominence of a clear resonance or antiresonance in dB."""
    most_peaks: int = 30
    """Largest number of resonances, and of antiresonances, around which lines are taken: the most prominent ones."""
    reach: float = 0.1
    """Distance of the last line around a resonance, relative to the band; it grows by `growth` from line to line."""
    growth: float = 1.5
    floor: float = 3.0
    """Standard deviations of the noise below which amplitudes are not distinguished."""
    smoothing: int = 3
    """Lines over which the square of an amplitude is averaged."""
    closeness: float = 0.05
    """Relative distance within which a resonance of the fitted FRF counts as that of the measured one."""
    cut: float = 3.0
    """Distance, in widths, beyond which a line has no weight."""
    sums_at_once: int = 16
    """Number of sums of smoothed residuals in one dense product, so small that most of their weights are not 0."""
    doubtful: float = 0.01
    """Probability of so large a sum of squares under noise below which another minimum is looked for nevertheless."""
    least_freedom: int = 8
    """Degrees of freedom that the residuals need for an estimate of the variance, to a half: sqrt(2 / 8)."""
    most_delays: int = 100
    """Largest number of delays of a response that are tried, eight for each turn of the phase at the highest line."""


_SETTINGS = Settings()


class SearchLines:
    """The lines on which a measurement is searched: evenly spaced ones, and those around each (anti)resonance.

    Parameters
    ----------
    observations : Observations
    variance : (n_lines,) array
        E|error|^2 of each line.

    Attributes
    ----------
    few, fewest : (n,) arrays
        Increasing indices of the concatenated lines of all responses.
    """

    def __init__(self, observations: Observations, variance: NDArray[np.float64]) -> None:
        self._observations = observations
        responses = zip(observations.firsts, observations.frfs, observations.split(variance), strict=True)
        few = [first + _search_lines(_level(frf.amplitude, error)) for first, frf, error in responses]
        self.few: NDArray[np.intp] = np.concatenate(few)
        self.fewest: NDArray[np.intp] = np.concatenate([lines[:: _SETTINGS.similar] for lines in few])

    def thinned(self, most: int) -> NDArray[np.intp]:
        """Return every n-th line, about `most` of each response at most, and in addition the few lines."""
        responses = zip(self._observations.firsts, self._observations.counts, strict=True)
        thinned = [np.arange(first, first + count, max(1, round(count / most))) for first, count in responses]
        return np.union1d(np.concatenate(thinned), self.few)

    def smoothed(self, residual: Residual, width: float) -> Smoothed:
        """Smooth residuals of the few lines with a Gaussian of a given relative width."""
        return Smoothed.over(self._observations.at(self.few), residual, width)

    def missed_resonances(self, variance: NDArray[np.float64], values: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the frequencies [Hz] of clear resonances that a model's FRFs (n_lines,) do not have."""
        missed: list[float] = []
        target = self._observations
        for frf, error, fitted in zip(target.frfs, target.split(variance), target.split(values), strict=True):
            measured = frf.frequency[_peaks(_level(frf.amplitude, error))]
            modelled = frf.frequency[_peaks(_level(np.abs(fitted), error))]
            missed += [at for at in measured.tolist() if not np.any(abs(modelled - at) <= _SETTINGS.closeness * at)]
        return np.array(missed)


@dataclass(frozen=True, eq=False)
class Smoothed(Residual):
    """Weighted sums of neighbouring residuals with unit variance, which sense a narrow resonance from further away.

    Parameters
    ----------
    residual : Residual
        Whitened.
    means : (n, m) sparse array
        Weights of the m residuals in each of the n sums.
    """

    residual: Residual
    means: scipy.sparse.csr_array

    @staticmethod
    def over(observations: Observations, residual: Residual, width: float) -> Smoothed:
        """Smooth the residuals of all lines with a Gaussian of a given relative width."""
        blocks = [
            scipy.sparse.kron(_neighbours(np.log(frf.frequency), width), np.eye(2 if frf.has_phase else 1))
            for frf in observations.frfs
        ]
        return Smoothed(residual, scipy.sparse.csr_array(scipy.sparse.block_diag(blocks)))

    def of(self, frf: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the residuals (n, m) of FRFs (n, f)."""
        return self._smoothed(self.residual.of(frf))

    def jacobian(self, frf: NDArray[np.complex128], frf_jacobian: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return their derivatives (n, p, m) from FRFs (n, f) and their derivatives (n, p, f)."""
        return self._smoothed(self.residual.jacobian(frf, frf_jacobian))

    def factored(self) -> tuple[NDArray[np.float64] | None, Residual]:
        """Return the factors of the lines and the rest, smoothed."""
        factors, residual = self.residual.factored()
        return factors, Smoothed(residual, self.means)

    def _smoothed(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        rows = values.reshape(-1, values.shape[-1])
        smoothed = np.empty((len(rows), self.means.shape[0]))
        for sums, summed, weights in self._blocks:
            np.matmul(rows[:, summed], weights, out=smoothed[:, sums])
        return smoothed.reshape(*values.shape[:-1], -1)

    @cached_property
    def _blocks(self) -> list[tuple[slice, slice, NDArray[np.float64]]]:
        """Some sums, the residuals that they are of, and the weights: dense products are faster than a sparse one."""
        blocks = []
        for first in range(0, self.means.shape[0], _SETTINGS.sums_at_once):
            sums = slice(first, first + _SETTINGS.sums_at_once)
            indices = self.means[sums].indices
            summed = slice(int(indices.min()), int(indices.max()) + 1)
            blocks.append((sums, summed, np.ascontiguousarray(self.means[sums, summed].toarray().T)))
        return blocks


def _neighbours(position: NDArray[np.float64], width: float) -> scipy.sparse.csr_array:
    """Return the weights of lines in Gaussian sums, one around the middle of each stretch of one width with lines."""
    _, stretch = np.unique(np.floor(position / width), return_inverse=True)
    middles = np.bincount(stretch, position) / np.bincount(stretch)
    distance = (position - middles[:, np.newaxis]) / width
    weight = np.exp(-0.5 * distance**2) * (np.abs(distance) <= _SETTINGS.cut)
    return scipy.sparse.csr_array(weight / np.linalg.norm(weight, axis=1, keepdims=True))


class LineWeights:
    """The weights of a measurement's lines.

    Parameters
    ----------
    target : Observations
    unknowns : int
        Number of parameters that are fitted.

    Attributes
    ----------
    variance : (n_lines,) array
        E|random error|^2.
    model_variance : (n_lines,) array
        That of the model's errors, which is added: 0 unless it is set.
    used : (n_lines,) bool array
        Lines that count.
    """

    def __init__(self, target: Observations, unknowns: int) -> None:
        self._target, self._unknowns = target, unknowns
        self.variance = target.variance()
        self.model_variance = np.zeros_like(self.variance)
        self.used = np.ones_like(self.variance, dtype=np.bool_)

    @property
    def residual(self) -> StackedResiduals[Weighted]:
        """The residuals of a fit, weighted by all errors."""
        return self._target.weighted(self.variance + self.model_variance, self.used)

    @property
    def residual_count(self) -> int:
        """Number of residuals that count."""
        return self._target.residual_count(self.used)

    @property
    def freedom(self) -> int:
        """Degrees of freedom of a fit, 1 or more."""
        return max(1, self.residual_count - self._unknowns)

    def search_lines(self) -> SearchLines:
        """Choose the lines of searches."""
        return SearchLines(self._target, self.variance)

    def estimate(self, values: NDArray[np.complex128]) -> None:
        """Estimate the random error by the scatter about FRFs (n_lines,)."""
        self.variance = self._target.variance(values)

    def estimate_from_residuals(self, values: NDArray[np.complex128]) -> bool:
        """Estimate the random error from all residuals of FRFs, if these may be nothing else; return whether it was."""
        if self.freedom < _SETTINGS.least_freedom or not self._has_size_of_noise(self.whitened(values), NOISE_ALARM):
            return False
        share = self.freedom / self.residual_count
        self.variance = self._target.residual_variance(values, self.used, share)
        return True

    def leave_out_isolated(self, values: NDArray[np.complex128]) -> bool:
        """Use all lines but isolated ones, or all if the residuals of FRFs are noise; return whether that differs."""
        noise = self.is_noise(values)
        used = np.ones_like(self.used) if noise else ~self._target.isolated(self._sizes(values))
        differs = not np.array_equal(used, self.used)
        self.used = used
        return differs

    def estimate_model_errors(
        self, values: NDArray[np.complex128], magnitude: NDArray[np.float64]
    ) -> tuple[float, float]:
        """Estimate the variance of the model's errors from the residuals of FRFs.

        Returns its part of each line's magnitude (n_lines,), and its part of the level everywhere.
        """
        relative, background = self._target.discrepancy(values, magnitude, self.variance, self.used)
        self.model_variance = (relative * magnitude) ** 2 + (background * self._target.level) ** 2
        return relative, background

    def whitened(self, values: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the residuals (m,) of FRFs (n_lines,) over the random error."""
        return np.asarray(self._target.weighted(self.variance, self.used).of(values[np.newaxis])[0])

    def _sizes(self, values: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the size (n_lines,) of each line's residual over the random error, also where it does not count."""
        return np.asarray(self._target.weighted(self.variance, np.ones_like(self.used)).size(values))

    def is_noise(self, values: NDArray[np.complex128], false_alarm: float = NOISE_ALARM) -> bool:
        """Return whether the residuals of FRFs are no larger than the random error, and white."""
        residuals = self.whitened(values)
        return self._has_size_of_noise(residuals, false_alarm) and all(map(is_white, self._target.by_line(residuals)))

    def is_doubtful(self, values: NDArray[np.complex128]) -> bool:
        """Return whether other parameters than those of these FRFs may be the right ones."""
        few_lines = not self._target.variance_known and is_of_few_lines(self.variance)
        return few_lines or not self.is_noise(values, _SETTINGS.doubtful)

    def _has_size_of_noise(self, residuals: NDArray[np.float64], false_alarm: float) -> bool:
        """Return whether whitened residuals (m,) are no larger than noise is."""
        squares = sum(float(np.sum(block**2)) for block in self._target.by_line(residuals))
        lines, known = self.residual_count // 2, self._target.variance_known
        return has_size_of_noise(squares, self.freedom, lines, variance_known=known, false_alarm=false_alarm)


def lines_represented(observations: Observations, lines: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return for chosen lines (n,) how many of all lines of their response are nearest to each.

    So weighted, a mean over few lines that crowd around resonances is that over all lines.
    """
    counts = []
    for first, count in zip(observations.firsts, observations.counts, strict=True):
        chosen = lines[(lines >= first) & (lines < first + count)] - first
        if chosen.size:
            nearest = np.searchsorted((chosen[1:] + chosen[:-1]) / 2.0, np.arange(count))
            counts.append(np.bincount(nearest, minlength=chosen.size).astype(np.float64))
    return np.concatenate(counts)


def with_best_delays(
    misfit: SumOfSquares, turns: Mapping[int, float], position: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Set the delays at some positions (n, p), in fractions of the ranges, to the values that fit best.

    The amplitudes of a search do not depend on them.

    Parameters
    ----------
    misfit : SumOfSquares
    turns : mapping of int to float
        By how many turns each delay, by its column, changes the phase of the highest line over its range.
    position : (n, p) array
    """
    for column, number in turns.items():
        tried = np.repeat(position[np.newaxis], 1 + min(_SETTINGS.most_delays, int(8 * number) + 1), axis=0)
        tried[1:, :, column] = np.linspace(0.0, 1.0, len(tried) - 1)[:, np.newaxis]
        costs = np.array([np.sum(misfit.residuals(each) ** 2, axis=1) for each in tried])
        position = tried[np.argmin(costs, axis=0), np.arange(len(position))]
    return position


def _level(amplitude: NDArray[np.float64], variance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return smoothed amplitudes in dB, with the noise as their floor."""
    square = uniform_filter1d(amplitude**2, _SETTINGS.smoothing, mode="nearest")
    return np.asarray(10.0 * np.log10(square + _SETTINGS.floor**2 * variance))


def _peaks(level: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the lines of the most prominent peaks."""
    tops, prominences = prominent_peaks(level, _SETTINGS.prominence)
    most = np.argsort(-prominences, kind="stable")[: _SETTINGS.most_peaks]
    return np.asarray(tops[most])


def _search_lines(level: NDArray[np.float64]) -> NDArray[np.intp]:
    count = len(level)
    even = np.linspace(0, count - 1, min(count, _SETTINGS.even)).round().astype(np.intp)
    around = np.array([0, *_distances(_SETTINGS.reach * count)])
    tops = np.concatenate([_peaks(level), _peaks(-level)])
    lines = np.concatenate([even, (tops[:, np.newaxis] + around).ravel(), (tops[:, np.newaxis] - around).ravel()])
    return np.unique(lines[(lines >= 0) & (lines < count)])


def _distances(most: float) -> Iterator[int]:
    """Yield 1, 2, 3, 5, 7, 11, ...: integers that grow by a factor."""
    distance = 1.0
    while distance <= most:
        yield round(distance)
        distance = max(distance + 1.0, distance * _SETTINGS.growth)
