"""Residuals of an assembly's FRFs against measured ones, with derivatives, for many parameter vectors at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import NDArray

from dovetail.assembly import FrfModel, ParameterScales, ResponseFrfs
from dovetail.frf import Frf
from dovetail.frf.rice import rice_mean
from dovetail.interfaces import NO_LIMIT, TimeLimit
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
        if self.combined is not None:
            return _end_to_end(self.combined.frfs(theta))
        return joined([assembly.frf(theta) for assembly in self.assemblies], axis=1)

    def frf_jacobian(self, theta: NDArray[np.float64]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return FRFs (n, n_lines) and their derivatives (n, n_lines, n_params)."""
        if self.combined is not None:
            values, derivatives = self.combined.jacobian(theta)
            return _end_to_end(values), _end_to_end(np.swapaxes(derivatives, 2, 3))
        frfs, jacobians = zip(*(assembly.frf_jacobian(theta) for assembly in self.assemblies), strict=True)
        return joined(frfs, axis=1), joined(jacobians, axis=1)

    def frf_by_fractions(self, theta: NDArray[np.float64]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return FRFs (n, n_lines) and their derivatives (n, n_params, n_lines) by fractions of the ranges."""
        return MultipliedFrfs(self, None).frf_by_fractions(theta)

    def slopes(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives (n, n_params) of theta by fractions of the ranges."""
        return self._scales.slopes(theta)

    @cached_property
    def _scales(self) -> ParameterScales:
        return ParameterScales(self.assemblies[0].parameters)

    @cached_property
    def combined(self) -> ResponseFrfs | None:
        """All responses computed together by one elimination, if they see the same structure on the same lines."""
        first, *others = self.assemblies
        return first.combined(others)

    def at(self, lines: NDArray[np.intp]) -> ModelFrfs:
        """Return the FRFs at some lines (increasing indices), without responses that have none of them."""
        pairs = zip(self.assemblies, split_by_response(lines, self.counts), strict=True)
        some = (assembly.on(assembly.frequency[rows], chosen=True) for assembly, rows in pairs if len(rows))
        return ModelFrfs(tuple(some), limit=self.limit)


def split_by_response(numbers: NDArray[np.intp], counts: tuple[int, ...]) -> list[NDArray[np.intp]]:
    """Split increasing indices of lines by response; in each response they count from 0."""
    ends = np.cumsum((0, *counts))
    return [numbers[(numbers >= first) & (numbers < end)] - first for first, end in pairwise(ends.tolist())]


def _end_to_end(array: NDArray[np.complex128], axis: int = 1) -> NDArray[np.complex128]:
    """Concatenate the lines of all responses: the axes (n_responses, n_freq) that begin at `axis` become one."""
    lines = array.shape[axis] * array.shape[axis + 1]
    return array.reshape(*array.shape[:axis], lines, *array.shape[axis + 2 :])


def joined(arrays: Sequence[NDArray[Any]], axis: int) -> NDArray[Any]:
    """Concatenate the arrays of all responses; a single one is not copied."""
    return arrays[0] if len(arrays) == 1 else np.concatenate(arrays, axis=axis)


class MultipliedFrfs:
    """FRFs of a model times factors of the lines, and their derivatives by fractions of the ranges.

    Where one elimination gives all responses, it multiplies by all factors itself, since arrays of derivatives take
    longer to multiply than to compute.

    Parameters
    ----------
    model : ModelFrfs
    factors : (n_lines,) array or None
        1 if None.
    """

    def __init__(self, model: ModelFrfs, factors: NDArray[np.float64] | None) -> None:
        self._model, self._factors, self._combined = model, factors, model.combined
        if factors is not None and self._combined is not None:
            self._combined = self._combined.times(factors.reshape(len(model.assemblies), -1))

    def frf(self, theta: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return FRFs (n, n_lines) at parameter vectors (n, n_params)."""
        if self._combined is not None:
            return _end_to_end(self._combined.frfs(theta))
        values = self._model.frf(theta)
        return values if self._factors is None else values * self._factors

    def frf_by_fractions(self, theta: NDArray[np.float64]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return FRFs (n, n_lines) and their derivatives (n, n_params, n_lines) by fractions of the ranges."""
        if self._combined is not None:
            values, derivatives = self._combined.jacobian(theta, self._model.slopes(theta))
            one = derivatives.shape[1] == 1
            return _end_to_end(values), derivatives[:, 0] if one else _end_to_end(np.swapaxes(derivatives, 1, 2), 2)
        values, derivatives = self._model.frf_jacobian(theta)
        derivatives = np.swapaxes(derivatives, 1, 2) * self._model.slopes(theta)[:, :, np.newaxis]
        return (values, derivatives) if self._factors is None else (values * self._factors, derivatives * self._factors)


class Residual(Protocol):
    """Real residuals of FRFs, whose squares are summed."""

    def of(self, frf: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the residuals (n, m) of FRFs (n, f)."""
        ...

    def jacobian(self, frf: NDArray[np.complex128], frf_jacobian: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the residuals' derivatives (n, p, m) from FRFs (n, f) and their derivatives (n, p, f)."""
        ...

    def factored(self) -> tuple[NDArray[np.float64] | None, Residual]:
        """Return factors (f,) of the lines, and the same residuals as functions of FRFs times these; None for 1."""
        return None, self


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
        self._factors, self._residual = residual.factored()
        self.limit = self._model.limit

    @cached_property
    def _frfs(self) -> MultipliedFrfs:
        return MultipliedFrfs(self._model, self._factors)

    def residuals(self, fraction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals (n, m) at fractions (n, p) of the ranges."""
        return self._residual.of(self._frfs.frf(self._assembly.from_unit(fraction)))

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
        nothing_follows = self._factors is not None and change is None  # the engine has its own blocks
        if nothing_follows or len(theta) <= size:
            return self._linearised(theta, change)
        first = self._linearised(theta[:size], change)
        residuals = np.empty((len(theta), first.residuals.shape[1]))
        jacobian = np.empty((*theta.shape, first.residuals.shape[1]))
        residuals[:size], jacobian[:size] = first.residuals, first.jacobian

        def fill(start: int) -> None:
            block = slice(start, start + size)
            part = self._linearised(theta[block], change)
            residuals[block], jacobian[block] = part.residuals, part.jacobian

        starts, workers = range(size, len(theta), size), cores()
        with one_blas_thread():
            list(map(fill, starts) if workers == 1 else threads("residuals", workers).map(fill, starts))
        return Linearisation(residuals, jacobian)

    def _linearised(
        self, theta: NDArray[np.float64], change: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None
    ) -> Linearisation:
        frf, derivatives = self._frfs.frf_by_fractions(theta)
        jacobian, residuals = self._residual.jacobian(frf, derivatives), self._residual.of(frf)
        return Linearisation(*(residuals, jacobian) if change is None else (change(residuals), change(jacobian)))


class LogAmplitude(Residual):
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
        return _real_products(frf_jacobian, self._weight / frf)


@dataclass(frozen=True, eq=False)
class Weighted(Residual):
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
            differences = frf - self.measured
            differences *= self.weight
            return _reals(differences)
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
        return _real_products(frf_jacobian, np.conj(frf) / amplitude * slope * self.weight)

    def factored(self) -> tuple[NDArray[np.float64] | None, Residual]:
        """Return the weights and the differences of weighted values, if there is a phase."""
        return (self.weight, Differences(self.measured * self.weight)) if self.has_phase else (None, self)


@dataclass(frozen=True, eq=False)
class Differences(Residual):
    """Differences of complex values from measured ones (n_freq,): of each line the real part, then the imaginary part.

    Parameters
    ----------
    measured : (n_freq,) complex array
    """

    measured: NDArray[Any]

    def of(self, frf: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the residuals (n, 2 f) of FRFs (n, f)."""
        return _reals(frf - self.measured)

    def jacobian(self, _frf: NDArray[np.complex128], frf_jacobian: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return their derivatives (n, p, 2 f) from those of the FRFs (n, p, f), without a copy if possible."""
        return _reals(frf_jacobian)


def _reals(values: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return real and imaginary parts (..., 2 f) of values (..., f); they share memory if lines lie side by side."""
    side_by_side = values.strides[-1] == values.itemsize
    return (values if side_by_side else np.ascontiguousarray(values)).view(np.float64)


def _real_products(derivatives: NDArray[np.complex128], factors: NDArray[Any]) -> NDArray[np.float64]:
    """Return the real parts (n, p, f) of derivatives (n, p, f) times factors (n, f)."""
    products: NDArray[np.float64] = derivatives.real * factors.real[:, np.newaxis]
    products -= derivatives.imag * factors.imag[:, np.newaxis]
    return products


def _rice_deviation(target: Frf, variance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the standard deviation of |amplitude + complex noise|, for an amplitude smoothed over neighbours."""
    smooth = scipy.ndimage.uniform_filter1d(target.amplitude**2, _SETTINGS.smoothing, mode="nearest")
    square = np.maximum(smooth - variance, 0.0)
    mean, _ = rice_mean(np.sqrt(square), variance)
    clear = square > _SETTINGS.clear * variance
    rice = np.maximum(square + variance - mean**2, _SETTINGS.least_rice * variance)
    return np.sqrt(np.where(clear, variance / 2.0, rice))
