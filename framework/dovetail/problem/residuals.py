"""Residuals of an assembly's FRFs against measured ones, with derivatives, for many parameter vectors at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import NDArray

from dovetail.assembly import FrfModel, ParameterScales, ResponseFrfs
from dovetail.frf import Frf
from dovetail.frf.rice import rice_mean
from dovetail.interfaces import NO_LIMIT, Parameter, TimeLimit
from dovetail.parallel import cores, one_blas_thread, threads
from dovetail.problem.least_squares import Linearisation, SumOfSquares


@dataclass(frozen=True)
class Settings:
    """Tuning constants of the residuals."""

    search_error: float = 0.1
    """Relative error that the search for the right neighbourhood allows every line, so that no sharp peak dominates."""
    smoothing: int = 9
    """Lines over which the square of a measured amplitude is averaged: noise goes, a resonance stays."""
    clear: float = 1e4
    """Squared amplitude over variance above which Rice's distribution is normal to four digits, and above which the
    difference of squares would lose digits to cancellation."""
    least_rice: float = 0.2
    """Smallest variance of an amplitude over that of the complex value: Rice's distribution at amplitude 0."""
    derivatives_at_once: float = 1.5e5
    """Number of complex derivatives that a thread computes at a time: they stay in the processor's cache."""


_SETTINGS = Settings()

_HALF_LOG_2_PI = float(np.log(2.0 * np.pi) / 2.0)


@dataclass(frozen=True, eq=False)
class ModelFrfs:
    """FRFs of an assembly and their derivatives, the lines of all responses concatenated.

    Parameters
    ----------
    assemblies : tuple of FrfModel
        One for each response.
    limit : TimeLimit
        The time for searches with them.
    """

    assemblies: tuple[FrfModel, ...]
    limit: TimeLimit = field(default=NO_LIMIT, kw_only=True)

    @staticmethod
    def of(assembly: FrfModel, limit: TimeLimit = NO_LIMIT) -> ModelFrfs:
        """Return the FRFs of all responses at all lines."""
        return ModelFrfs(assembly.each_response, limit=limit)

    @property
    def counts(self) -> tuple[int, ...]:
        """Lines of each response."""
        return tuple(len(assembly.frequency) for assembly in self.assemblies)

    def frf(self, theta: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return FRFs (n, n_lines) at parameter vectors (n, n_params)."""
        if self._together is not None:
            return _end_to_end(self._together.frfs(theta))
        return _joined([assembly.frf(theta) for assembly in self.assemblies], axis=1)

    def frf_jacobian(self, theta: NDArray[np.float64]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return FRFs (n, n_lines) and their derivatives (n, n_lines, n_params)."""
        if self._together is not None:
            values, derivatives = self._together.jacobian(theta)
            return _end_to_end(values), _end_to_end(np.swapaxes(derivatives, 2, 3))
        frfs, jacobians = zip(*(assembly.frf_jacobian(theta) for assembly in self.assemblies), strict=True)
        return _joined(frfs, axis=1), _joined(jacobians, axis=1)

    def frf_by_fractions(self, theta: NDArray[np.float64]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return FRFs (n, n_lines) and their derivatives (n, n_params, n_lines) by fractions of the ranges."""
        frf, jacobian = self.frf_jacobian(theta)
        return frf, np.swapaxes(jacobian, 1, 2) * self.slopes(theta)[:, :, np.newaxis]

    def slopes(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives (n, n_params) of theta by fractions of the ranges."""
        return self._scales.slopes(theta)

    @cached_property
    def _scales(self) -> ParameterScales:
        return ParameterScales(self.assemblies[0].parameters)

    @cached_property
    def _together(self) -> ResponseFrfs | None:
        """All responses computed together by one elimination, if they see the same structure on the same lines."""
        first, *others = self.assemblies
        return first.combined(others) if others else None

    def at(self, lines: NDArray[np.intp]) -> ModelFrfs:
        """Return the FRFs at some lines (increasing indices), without responses that have none of them."""
        pairs = zip(self.assemblies, split_by_response(lines, self.counts), strict=True)
        some = (assembly.on(assembly.frequency[rows]) for assembly, rows in pairs if len(rows))
        return ModelFrfs(tuple(some), limit=self.limit)


def split_by_response(numbers: NDArray[np.intp], counts: tuple[int, ...]) -> list[NDArray[np.intp]]:
    """Split increasing indices of lines by response; in each response they count from 0."""
    ends = np.cumsum((0, *counts))
    return [numbers[(numbers >= first) & (numbers < end)] - first for first, end in pairwise(ends.tolist())]


def _end_to_end(array: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Concatenate the lines of all responses: (n, n_responses, n_freq, ...) becomes (n, n_lines, ...)."""
    return array.reshape(len(array), array.shape[1] * array.shape[2], *array.shape[3:])


def _joined(arrays: Sequence[NDArray[Any]], axis: int) -> NDArray[Any]:
    """Concatenate the arrays of all responses; a single one is not copied."""
    return arrays[0] if len(arrays) == 1 else np.concatenate(arrays, axis=axis)


class Residual(Protocol):
    """Real residuals of FRFs, whose squares are summed."""

    def of(self, frf: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the residuals (n, m) of FRFs (n, f)."""
        ...

    def jacobian(self, frf: NDArray[np.complex128], frf_jacobian: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the residuals' derivatives (n, p, m) from FRFs (n, f) and their derivatives (n, p, f)."""
        ...


class FrfResiduals(SumOfSquares):
    """Residuals against one measured FRF, or against one for each response, as functions of the parameters.

    Parameters
    ----------
    model : FrfModel or ModelFrfs
        With parameters to identify.
    residual : Residual
        Of the concatenated FRFs of the assembly's responses, in their quantities.
    """

    def __init__(self, model: FrfModel | ModelFrfs, residual: Residual) -> None:
        self._model = model if isinstance(model, ModelFrfs) else ModelFrfs.of(model)
        self._assembly = self._model.assemblies[0]
        self._residual = residual
        self.limit = self._model.limit

    def residuals(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, m) at fractions (n, p) of the ranges."""
        return self._residual.of(self._model.frf(self._assembly.from_unit(fraction)))

    def linearise(
        self, fraction: NDArray[np.float64], change: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None
    ) -> Linearisation:
        """Return residuals and their derivatives at fractions (n, p) of the ranges, in small blocks on all cores.

        Parameters
        ----------
        fraction : (n, p) array
        change : callable, optional
            A linear map of arrays (..., m), which is applied to residuals and derivatives.
        """
        theta = self._assembly.from_unit(fraction)
        size = max(1, int(_SETTINGS.derivatives_at_once / max(1, sum(self._model.counts) * theta.shape[1])))
        if len(theta) <= size:
            return self._linearised(theta, change)
        first = self._linearised(theta[:size], change)
        residuals = np.empty((len(theta), first.residuals.shape[1]))
        jacobian = np.empty((*theta.shape, first.residuals.shape[1]))
        residuals[:size], jacobian[:size] = first.residuals, first.jacobian

        def fill(start: int) -> None:
            block = slice(start, start + size)
            part = self._linearised(theta[block], change)
            residuals[block], jacobian[block] = part.residuals, part.jacobian

        with one_blas_thread():
            list(threads("residuals", cores()).map(fill, range(size, len(theta), size)))
        return Linearisation(residuals, jacobian)

    def _linearised(
        self, theta: NDArray[np.float64], change: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None
    ) -> Linearisation:
        frf, jacobian = self._model.frf_jacobian(theta)
        by_fraction = self._residual.jacobian(frf, np.swapaxes(jacobian, 1, 2))
        by_fraction *= self._model.slopes(theta)[:, :, np.newaxis]
        residuals = self._residual.of(frf)
        return (
            Linearisation(residuals, by_fraction)
            if change is None
            else Linearisation(change(residuals), change(by_fraction))
        )


class WithPrior(SumOfSquares):
    """Residuals of a measurement, followed by those of normal priors: the parameters' deviations from the means.

    Parameters
    ----------
    misfit : SumOfSquares
        Of fractions of the ranges.
    parameters : sequence of Parameter
    """

    def __init__(self, misfit: SumOfSquares, parameters: Sequence[Parameter]) -> None:
        self._misfit, self.limit = misfit, misfit.limit
        self._normal = [(column, p) for column, p in enumerate(parameters) if p.prior == "normal"]

    def residuals(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, m) at fractions (n, p) of the ranges."""
        return np.concatenate([self._misfit.residuals(fraction), self._prior(fraction)[0]], axis=1)

    def linearise(self, fraction: NDArray[np.float64]) -> Linearisation:
        """Return residuals and their derivatives at fractions (n, p) of the ranges."""
        linear = self._misfit.linearise(fraction)
        deviations, jacobian = self._prior(fraction)
        residuals = np.concatenate([linear.residuals, deviations], axis=1)
        return Linearisation(residuals, np.concatenate([linear.jacobian, jacobian], axis=2))

    def _prior(self, fraction: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        deviations = np.empty((len(fraction), len(self._normal)))
        jacobian = np.zeros((*fraction.shape, len(self._normal)))
        for row, (column, parameter) in enumerate(self._normal):
            deviations[:, row], jacobian[:, column, row] = parameter.normal_residual(fraction[:, column])
        return deviations, jacobian


class LogAmplitude:
    """Differences of the logarithms of amplitudes: a shallow sum of squares with few local minima, for the search.

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
        self._weight = 1.0 / np.hypot(_SETTINGS.search_error, np.sqrt(variance / 2.0) / amplitude)

    def of(self, frf: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the residuals (n, f) of FRFs (n, f)."""
        return (np.log(np.abs(frf)) - self._target) * self._weight

    def jacobian(self, frf: NDArray[np.complex128], frf_jacobian: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return their derivatives (n, p, f) from FRFs (n, f) and their derivatives (n, p, f)."""
        return np.real(frf_jacobian * (self._weight / frf)[:, np.newaxis])


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
        Factor of each line's difference.
    has_phase : bool

    Notes
    -----
    Without a phase, the amplitude of a complex value with noise follows Rice's distribution. It is compared with the
    mean of that distribution, over its standard deviation. Both differ from the noiseless ones only where the noise is
    as large as the value.
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

    def at(self, lines: NDArray[np.intp]) -> Weighted:
        """Return the residuals of some lines."""
        return Weighted(self.measured[lines], self.variance[lines], self.weight[lines], self.has_phase)

    def of(self, frf: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the residuals (n, m) of FRFs (n, f); with a phase, a line's real part, then its imaginary part."""
        if self.has_phase:
            return _reals((frf - self.measured) * self.weight)
        mean, _ = rice_mean(np.abs(frf), self.variance)
        return np.asarray((mean - self.measured) * self.weight)

    @property
    def log_scale(self) -> float:
        """Logarithm of the residuals' density where they are 0, as a density of the measured values."""
        counted = self.weight[self.weight > 0.0]
        return (2.0 if self.has_phase else 1.0) * float(np.sum(np.log(counted)) - len(counted) * _HALF_LOG_2_PI)

    def size(self, frf: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the size (f,) of each line's residual for one FRF (f,): 1 where it is as large as the noise."""
        residuals = self.of(frf)
        if self.has_phase:
            return np.asarray(np.hypot(residuals[0::2], residuals[1::2]) / np.sqrt(2.0))
        return np.abs(residuals)

    def jacobian(self, frf: NDArray[np.complex128], frf_jacobian: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return their derivatives (n, p, m) from FRFs (n, f) and their derivatives (n, p, f)."""
        if self.has_phase:
            return _reals(frf_jacobian * self.weight)
        amplitude = np.maximum(np.abs(frf), np.finfo(float).tiny)
        _, slope = rice_mean(amplitude, self.variance)
        return np.asarray(np.real(frf_jacobian * (np.conj(frf) / amplitude * slope * self.weight)[:, np.newaxis]))


_Kind = TypeVar("_Kind", bound=Residual)


@dataclass(frozen=True, eq=False)
class StackedResiduals(Generic[_Kind]):
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
        return _joined([residual.of(block) for residual, block in pairs], axis=-1)

    def jacobian(self, frf: NDArray[np.complex128], frf_jacobian: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return their derivatives (n, p, m) from FRFs (n, f) and their derivatives (n, p, f)."""
        blocks = zip(self.responses, self._split(frf), self._split(frf_jacobian), strict=True)
        return _joined([residual.jacobian(*block) for residual, *block in blocks], axis=-1)

    @property
    def log_scale(self: StackedResiduals[Any]) -> float:
        """Logarithm of the residuals' density where they are 0, as a density of the measured values."""
        return float(sum(residual.log_scale for residual in self.responses))

    def size(self: StackedResiduals[Weighted], frf: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the size (f,) of each line's residual, as `Weighted.size`."""
        pairs = zip(self.responses, self._split(frf), strict=True)
        return _joined([residual.size(block) for residual, block in pairs], axis=-1)

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
        of_each = np.repeat([2 if residual.has_phase else 1 for residual in self.responses], self.counts)
        return np.repeat(np.arange(sum(self.counts)), of_each)

    def _split(self, values: NDArray[np.complex128]) -> list[NDArray[np.complex128]]:
        return np.split(values, np.cumsum(self.counts)[:-1], axis=-1)


def _reals(values: NDArray[np.complex128]) -> NDArray[np.float64]:
    return np.ascontiguousarray(values).view(np.float64)


def _rice_deviation(target: Frf, variance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the standard deviation of |amplitude + complex noise|, for an amplitude smoothed over neighbours."""
    smooth = scipy.ndimage.uniform_filter1d(target.amplitude**2, _SETTINGS.smoothing, mode="nearest")
    square = np.maximum(smooth - variance, 0.0)
    mean, _ = rice_mean(np.sqrt(square), variance)
    clear = square > _SETTINGS.clear * variance
    rice = np.maximum(square + variance - mean**2, _SETTINGS.least_rice * variance)
    return np.sqrt(np.where(clear, variance / 2.0, rice))
