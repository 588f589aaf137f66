"""How far the FRFs of an assembly are from a measured one, with derivatives, for many parameter vectors at once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.special import ive

from dovetail.assembly import Assembly
from dovetail.frf import Frf
from dovetail.identification.fitting.levenberg_marquardt import Linear

__all__ = ["FrfMisfit", "Frfs", "LogAmplitude", "Residual", "SideBySide", "Weighted", "parted"]

_LINES_AT_ONCE = 150_000
"""Lines, of all parameter vectors together, whose complex derivatives are in memory at the same time."""
_SMOOTHED = 9
"""Lines over which a measured amplitude is averaged to tell how its noise is distributed."""
_SEARCH_ERROR = 0.1
"""Relative error that the search for the right neighbourhood allows in every line."""


class Residual(Protocol):
    """Real residuals of FRFs, whose squares are summed."""

    def of(self, values: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the residuals (n, m) of FRFs (n, f)."""
        ...

    def slopes(self, values: NDArray[np.complex128], of_values: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the residuals' derivatives (n, p, m) from FRFs (n, f) and their derivatives (n, p, f)."""
        ...


_Each = TypeVar("_Each", "Weighted", "LogAmplitude")


class FrfMisfit:
    """Sums of squared residuals against one measured FRF, or against one for each response.

    Parameters
    ----------
    assembly : Assembly or Frfs
        With parameters to seek.
    residual : Residual
        Against the FRFs of the assembly's responses, in their quantities, one response behind the other.
    """

    def __init__(self, assembly: Assembly | Frfs, residual: Residual) -> None:
        self._frfs = Frfs.of(assembly) if isinstance(assembly, Assembly) else assembly
        self._assembly = self._frfs.assemblies[0]
        self._residual = residual

    @cached_property
    def _span(self) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        """Which parameters have a logarithmic scale, and how wide each range is on its scale."""
        parameters = self._assembly.parameters
        log = np.array([p.scale == "log" for p in parameters])
        return log, np.array([np.log(p.upper / p.lower) if p.scale == "log" else p.upper - p.lower for p in parameters])

    def residuals(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, m) at fractions (n, p) of the ranges."""
        return self._residual.of(self._frfs.frf(self._assembly.from_unit(fraction)))

    def linear(self, fraction: NDArray[np.float64]) -> Linear:
        """Return residuals and their derivatives at fractions (n, p) of the ranges."""
        at_once = max(1, _LINES_AT_ONCE // len(self._assembly.frequency))
        parts = [self._linear(fraction[first : first + at_once]) for first in range(0, len(fraction), at_once)]
        return Linear(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))

    def _linear(self, fraction: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        values, of_values = self.frf(fraction)
        residuals, slopes = self._residual.of(values), self._residual.slopes(values, of_values)
        return residuals, slopes, np.einsum("npm,nm->np", slopes, residuals), slopes @ np.swapaxes(slopes, 1, 2)

    def frf(self, fraction: NDArray[np.float64]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return FRFs (n, f) and their derivatives (n, p, f) in fractions of the ranges."""
        theta = self._assembly.from_unit(fraction)
        values, jacobian = self._frfs.frf_jacobian(theta)
        log, width = self._span
        return values, np.swapaxes(jacobian, 1, 2) * np.where(log, theta * width, width)[:, :, np.newaxis]


class LogAmplitude:
    """Logarithms of the amplitudes compared: shallow, with few local minima, for the search.

    Parameters
    ----------
    target : Frf
        In the quantity of the assembly's response.
    variance : (n_freq,) array
        E|error|^2 of its complex values.
    """

    def __init__(self, target: Frf, variance: NDArray[np.float64]) -> None:
        amplitude = np.maximum(target.amplitude, np.sqrt(variance))
        self._target = np.log(amplitude)
        self._weight = 1.0 / np.hypot(_SEARCH_ERROR, np.sqrt(variance / 2.0) / amplitude)

    def of(self, values: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return weighted differences of logarithms."""
        return (np.log(np.abs(values)) - self._target) * self._weight

    def slopes(self, values: NDArray[np.complex128], of_values: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return their derivatives."""
        return np.real(of_values * (self._weight / values)[:, np.newaxis])


@dataclass(frozen=True, eq=False)
class Weighted:
    """Differences over their standard deviation: complex, or of amplitudes where there is no phase.

    Parameters
    ----------
    measured : (n_freq,) array
        Complex values, or amplitudes.
    variance : (n_freq,) array
        E|error|^2 of the complex values.
    weight : (n_freq,) array
        By which a line's differences are multiplied.
    has_phase : bool

    Notes
    -----
    Where there is no phase, the amplitude of a complex value with noise follows Rice's distribution; it is compared
    with that distribution's mean, over its standard deviation, which both differ from the noiseless ones only where
    the noise is as large as the value.
    """

    measured: NDArray[Any]
    variance: NDArray[np.float64]
    weight: NDArray[np.float64]
    has_phase: bool

    @staticmethod
    def against(target: Frf, variance: NDArray[np.float64], used: NDArray[np.bool_]) -> Weighted:
        """Return the residuals against an FRF in the quantity of the assembly's response, of the lines `used`."""
        weight = np.sqrt(2.0 / variance) if target.has_phase else 1.0 / _rice_deviation(target, variance)
        measured = target.values if target.has_phase else target.amplitude
        return Weighted(measured, variance, used * weight, target.has_phase)

    @property
    def parts(self) -> int:
        """Residuals of each line: 2 where there is a phase."""
        return 2 if self.has_phase else 1

    def at(self, lines: NDArray[np.intp]) -> Weighted:
        """Return the residuals of some lines."""
        return Weighted(self.measured[lines], self.variance[lines], self.weight[lines], self.has_phase)

    def scaled(self, factor: float) -> Weighted:
        """Return the residuals multiplied by a factor."""
        return replace(self, weight=factor * self.weight)

    def lines_of(self, residuals: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return the lines that residuals belong to, both by their numbers; increasing, each once."""
        return np.unique(residuals // self.parts)

    def residuals_of(self, lines: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return the residuals of lines, both by their numbers."""
        return np.asarray((self.parts * lines[:, np.newaxis] + np.arange(self.parts)).ravel())

    def of(self, values: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return weighted differences, real and imaginary parts beside each other."""
        if self.has_phase:
            return _reals((values - self.measured) * self.weight)
        mean, _ = _rice_mean(np.abs(values), self.variance)
        return np.asarray((mean - self.measured) * self.weight)

    def size(self, values: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the size (f,) of each line's residual, 1 where it is as large as the noise, for one FRF (f,)."""
        residuals = self.of(values)
        if self.has_phase:
            return np.asarray(np.hypot(residuals[0::2], residuals[1::2]) / np.sqrt(2.0))
        return np.abs(residuals)

    def slopes(self, values: NDArray[np.complex128], of_values: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return their derivatives."""
        if self.has_phase:
            return _reals(of_values * self.weight)
        amplitude = np.maximum(np.abs(values), np.finfo(float).tiny)
        _, slope = _rice_mean(amplitude, self.variance)
        return np.asarray(np.real(of_values * (np.conj(values) / amplitude * slope * self.weight)[:, np.newaxis]))


@dataclass(frozen=True, eq=False)
class SideBySide(Generic[_Each]):
    """Residuals of several responses, those of one behind those of the other.

    Parameters
    ----------
    each : tuple of Weighted or of LogAmplitude
        Of each response.
    counts : tuple of int
        Lines of each response.
    """

    each: tuple[_Each, ...]
    counts: tuple[int, ...]

    def of(self, values: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the residuals (n, m) of FRFs (n, f)."""
        return np.concatenate([one.of(own) for one, own in self._parts(values)], axis=-1)

    def slopes(self, values: NDArray[np.complex128], of_values: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return their derivatives (n, p, m) from FRFs (n, f) and their derivatives (n, p, f)."""
        parts = zip(self._parts(values), self._split(of_values), strict=True)
        return np.concatenate([one.slopes(own, slopes) for (one, own), slopes in parts], axis=-1)

    def size(self: SideBySide[Weighted], values: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the size (f,) of each line's residual, as `Weighted.size`."""
        return np.concatenate([one.size(own) for one, own in self._parts(values)])

    def at(self: SideBySide[Weighted], lines: NDArray[np.intp]) -> SideBySide[Weighted]:
        """Return the residuals of some lines (increasing numbers); a response without any of them is left out."""
        kept = [(one, own) for one, own in zip(self.each, parted(lines, self.counts), strict=True) if len(own)]
        return SideBySide(tuple(one.at(own) for one, own in kept), tuple(len(own) for _, own in kept))

    def scaled(self: SideBySide[Weighted], factor: float) -> SideBySide[Weighted]:
        """Return the residuals multiplied by a factor."""
        return SideBySide(tuple(one.scaled(factor) for one in self.each), self.counts)

    def lines_of(self: SideBySide[Weighted], residuals: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return the lines that residuals belong to, both by their numbers; increasing, each once."""
        return np.unique(np.repeat(np.arange(sum(self.counts)), self._parts_of_lines)[residuals])

    def residuals_of(self: SideBySide[Weighted], lines: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return the residuals of lines, both by their numbers."""
        owners = np.repeat(np.arange(sum(self.counts)), self._parts_of_lines)
        return np.flatnonzero(np.isin(owners, lines))

    @property
    def _parts_of_lines(self: SideBySide[Weighted]) -> NDArray[np.intp]:
        return np.repeat([one.parts for one in self.each], self.counts)

    def _parts(self, values: NDArray[np.complex128]) -> list[tuple[_Each, NDArray[np.complex128]]]:
        return list(zip(self.each, self._split(values), strict=True))

    def _split(self, values: NDArray[np.complex128]) -> list[NDArray[np.complex128]]:
        return np.split(values, np.cumsum(self.counts)[:-1], axis=-1)


def _reals(values: NDArray[np.complex128]) -> NDArray[np.float64]:
    return np.ascontiguousarray(values).view(np.float64)


def _rice_mean(
    amplitude: NDArray[np.float64], variance: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean of |amplitude + complex noise| and its derivative by the amplitude."""
    half = amplitude**2 / (2.0 * variance)
    zero, one = ive(0, half), ive(1, half)
    mean = np.sqrt(np.pi * variance) / 2.0 * ((1.0 + 2.0 * half) * zero + 2.0 * half * one)
    return mean, np.sqrt(np.pi / variance) / 2.0 * amplitude * (zero + one)


def _rice_deviation(target: Frf, variance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the standard deviation of |amplitude + complex noise|, the amplitude told from the lines around."""
    square = np.maximum(uniform_filter1d(target.amplitude**2, _SMOOTHED, mode="nearest") - variance, 0.0)
    mean, _ = _rice_mean(np.sqrt(square), variance)
    clear = square > 1e4 * variance  # where the difference of squares would lose its digits
    return np.sqrt(np.where(clear, variance / 2.0, np.maximum(square + variance - mean**2, 0.2 * variance)))


@dataclass(frozen=True, eq=False)
class Frfs:
    """FRFs and sensitivities with the lines of each response behind those of the one before.

    Parameters
    ----------
    assemblies : tuple of Assembly
        One for each response.
    """

    assemblies: tuple[Assembly, ...]

    @staticmethod
    def of(assembly: Assembly) -> Frfs:
        """Return those of all responses, at all lines."""
        return Frfs(assembly.each_response)

    @property
    def counts(self) -> tuple[int, ...]:
        """Lines of each response."""
        return tuple(len(one.frequency) for one in self.assemblies)

    def frf(self, theta: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return FRFs (n, n_lines) at parameter vectors (n, n_params)."""
        return _joined([one.frf(theta) for one in self.assemblies], axis=1)

    def frf_jacobian(self, theta: NDArray[np.float64]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return FRFs (n, n_lines) and their derivatives (n, n_lines, n_params)."""
        found = [one.frf_jacobian(theta) for one in self.assemblies]
        return _joined([values for values, _ in found], axis=1), _joined([slopes for _, slopes in found], axis=1)

    def at(self, lines: NDArray[np.intp]) -> Frfs:
        """Return those at some lines (increasing numbers); a response without any of them is left out."""
        each = zip(self.assemblies, parted(lines, self.counts), strict=True)
        return Frfs(tuple(one.on(one.frequency[own]) for one, own in each if len(own)))


def parted(numbers: NDArray[np.intp], counts: tuple[int, ...]) -> list[NDArray[np.intp]]:
    """Part increasing numbers of lines by the response that they belong to, each counted from its own first line."""
    ends = np.cumsum((0, *counts))
    return [numbers[(numbers >= first) & (numbers < end)] - first for first, end in pairwise(ends.tolist())]


def _joined(parts: list[NDArray[np.complex128]], axis: int) -> NDArray[np.complex128]:
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=axis)
