"""An engine that computes a few lines of each FRF and interpolates the others, as far as its error estimate allows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.synthesis.coupled_system import Point
from dovetail.synthesis.engine import Engine
from dovetail.synthesis.graph import Graph
from dovetail.synthesis.joint_evaluation import Theta

__all__ = ["InterpolatedEngine", "RationalPair", "chebyshev_lines"]

_COUNTS = (9, 13, 17, 21, 25, 27, 29, 33, 41, 49, 65, 81, 97)
"""Numbers of exact lines that are tried, in this order."""
_MOST_OF_ALL_LINES = 1 / 8
_MOST_REFUSED = 0.03
"""Part of the trial's FRFs that may fail the tolerance."""
_FEWEST_MULTIPLICATIONS = 100
"""Of the elimination at one line, below which exact lines cost no more than interpolated ones."""
_BLOCK = 64
_FEWEST = 32
"""FRFs in one call below which interpolating them is not worth its preparation."""


class InterpolatedEngine(Engine):
    """An engine whose FRFs at the drive point are interpolated between exact lines.

    Parameters
    ----------
    graph, frequency, points, probe, sought
        As of `Engine`.
    tolerance : float
        Greatest relative error at any line, as estimated. An FRF that exceeds it is computed exactly, as are calls
        for a few FRFs, sensitivities and transfer FRFs.
    trial : mapping of str to (n, n_params) array
        Parameter vectors by which the number of exact lines is chosen.

    Attributes
    ----------
    refused : int
        FRFs computed exactly so far because their estimated error exceeded the tolerance.
    """

    def __init__(
        self,
        graph: Graph,
        frequency: NDArray[np.float64],
        points: Sequence[Point],
        probe: Theta,
        sought: Mapping[str, list[int]] | None = None,
        *,
        tolerance: float,
        trial: Theta,
    ) -> None:
        super().__init__(graph, frequency, points, probe, sought)
        self.tolerance = tolerance
        self.refused = 0
        self._probe, self._trial = probe, trial

    @cached_property
    def pair(self) -> RationalPair | None:
        """The rational functions through the fewest exact lines that do, or None where none pays."""
        if self.program.multiplications < _FEWEST_MULTIPLICATIONS:
            return None
        exact = super().drive_point(self._trial)
        scratch = np.empty_like(exact)
        for count in _COUNTS:
            if count > _MOST_OF_ALL_LINES * len(self.frequency):
                break
            pair = RationalPair(self.frequency, chebyshev_lines(count, len(self.frequency)))
            estimated = pair.complex_values(exact[:, pair.lines], scratch)
            accepted = estimated <= self.tolerance
            true = np.max(np.abs(scratch - exact) / np.abs(exact), axis=1)
            if np.mean(accepted) >= 1 - _MOST_REFUSED and np.all(true[accepted] <= 10 * self.tolerance):
                return pair
        return None

    @cached_property
    def _at_nodes(self) -> Engine:
        assert self.pair is not None
        return Engine(self.graph, self.frequency[self.pair.lines], self.system.points[:1], self._probe)

    @cached_property
    def _blas(self) -> Any:
        from threadpoolctl import ThreadpoolController

        return ThreadpoolController()

    def drive_point(self, theta: Theta, factor: NDArray[np.complex128] | None = None) -> NDArray[np.complex128]:
        """FRF at the first point for each parameter vector, as `Engine.drive_point`."""
        if self._too_few(theta):
            return super().drive_point(theta, factor)
        assert self.pair is not None
        result = self._interpolated(theta, factor, np.complex128, self.pair.complex_values)
        return self._corrected(theta, result, lambda some: super(InterpolatedEngine, self).drive_point(some, factor))

    def amplitude(self, theta: Theta, factor: NDArray[np.complex128]) -> NDArray[np.float32]:
        """Magnitude of the FRF at the first point, as `Engine.amplitude`."""
        if self._too_few(theta):
            return super().amplitude(theta, factor)
        assert self.pair is not None
        result = self._interpolated(theta, factor, np.float32, self.pair.amplitudes)
        return self._corrected(theta, result, lambda some: super(InterpolatedEngine, self).amplitude(some, factor))

    def _too_few(self, theta: Theta) -> bool:
        count = len(next(iter(theta.values()))) if theta else 1
        return count < _FEWEST or self.pair is None

    def _interpolated(
        self,
        theta: Theta,
        factor: NDArray[np.complex128] | None,
        dtype: type[np.generic],
        fill: Callable[[NDArray[np.complex128], Any], NDArray[np.float64]],
    ) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """Return the FRFs, and which of them fail the tolerance."""
        assert self.pair is not None
        self._at_nodes.threads = self.threads
        known = self._at_nodes.drive_point(theta, None if factor is None else factor[self.pair.lines])
        result = np.empty((len(known), len(self.frequency)), dtype=dtype)
        error = np.empty(len(known))

        def fill_block(first: int) -> None:
            block = slice(first, first + _BLOCK)
            error[block] = fill(known[block], result[block])

        with self._blas.limit(limits=1, user_api="blas"), ThreadPoolExecutor(self.threads) as pool:
            list(pool.map(fill_block, range(0, len(known), _BLOCK)))
        return result, ~(error <= self.tolerance)

    def _corrected(
        self, theta: Theta, found: tuple[NDArray[Any], NDArray[np.bool_]], exactly: Callable[[Theta], NDArray[Any]]
    ) -> NDArray[Any]:
        result, refused = found
        if refused.any():
            result[refused] = exactly({name: values[refused] for name, values in theta.items()})
            self.refused += int(np.count_nonzero(refused))
        return result


_LINES_AT_ONCE = 512
"""So that the arrays of a block of FRFs stay in the second-level cache."""


def chebyshev_lines(count: int, lines: int) -> NDArray[np.intp]:
    """Return `count` of `lines` lines, denser towards both ends, as Chebyshev's points are."""
    place = (1.0 - np.cos(np.pi * (np.arange(count) + 0.5) / count)) / 2.0
    return np.unique(np.round(place * (lines - 1)).astype(np.intp))


class _Rational:
    """Rational functions of frequency in barycentric form, through the same support lines for all FRFs.

    r(f) = n(f) / d(f), n(f) = sum_j w_j h_j / (f - f_j), d(f) = sum_j w_j / (f - f_j). It takes the values h_j at the
    support frequencies f_j whatever the weights are; they make it take those at the other lines too (Antoulas and
    Anderson 1986).
    """

    def __init__(self, nodes: NDArray[np.float64], support: NDArray[np.intp], others: NDArray[np.intp]) -> None:
        self.support = support
        self._others = others
        self._nodes = nodes
        self._cauchy = 1.0 / (nodes[others][:, None] - nodes[support])

    def weights(self, values: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return w (n, n_support) for the values h (n, n_nodes), scaled by its last column."""
        held, met = values[:, self.support], values[:, self._others]
        loewner = (met[:, :, None] - held[:, None, :]) * self._cauchy / np.abs(met)[:, :, None]
        weights = np.ones_like(held)
        weights[:, :-1] = -np.linalg.solve(loewner[:, :, :-1], loewner[:, :, -1:])[:, :, 0]
        return weights

    def basis(self, frequency: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return 1 / (f - f_j), (n_support, n_freq); at a support line only its own column counts."""
        distance = frequency[None, :] - self._nodes[self.support][:, None]
        hit = distance == 0.0
        basis = 1.0 / np.where(hit, 1.0, distance)
        basis[:, hit.any(axis=0)] = 0.0
        basis[hit] = 1.0
        return basis


class RationalPair:
    """Two rational functions of different degree through the exact lines of an FRF.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz, where the FRFs are wanted.
    lines : (n_nodes,) array
        Numbers of the lines that are known exactly, an odd number of nine or more.

    Notes
    -----
    The first function has its support at every other exact line and passes through all of them. The second is of lower
    degree, has its support where the first has not, and passes through all but two, a and b. Both meet at all others:
    nothing is left of the numerator of their difference but a constant: relative to the first it is

        kappa / ((f - a) (f - b) n_1(f) d_2(f)),   kappa = (a - b) w_a (h_a d_2(a) - n_2(a)),

    at every frequency. Its greatest value over all lines is returned as the error: an estimate, and not a bound.
    """

    def __init__(self, frequency: NDArray[np.float64], lines: NDArray[np.intp]) -> None:
        nodes = frequency[lines]
        even, odd = np.arange(0, len(lines), 2), np.arange(1, len(lines), 2)
        self._a, self._b = len(even) // 3, 2 * len(even) // 3
        a, b = nodes[even[self._a]], nodes[even[self._b]]
        self.lines = lines
        self._high = _Rational(nodes, even, odd)
        self._low = _Rational(nodes, odd, np.delete(even, [self._a, self._b]))
        self._high_basis, self._low_basis = self._high.basis(frequency), self._low.basis(frequency)
        self._at_a = self._low.basis(np.array([a]))[:, 0]
        self._span = a - b
        self._distance = ((frequency - a) * (frequency - b)) ** 2
        self._distance[lines] = np.inf

    def amplitudes(self, known: NDArray[np.complex128], result: NDArray[np.float32]) -> NDArray[np.float64]:
        """Fill `result` (n, n_freq) with the magnitudes of FRFs whose exact lines `known` (n, n_nodes) are.

        Returns
        -------
        (n,) array
            Estimated greatest relative error; infinite or NaN where there is no such function.
        """
        return self._fill(known, result)

    def complex_values(self, known: NDArray[np.complex128], result: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Do the same with complex values."""
        return self._fill(known, result)

    def _fill(self, known: NDArray[np.complex128], result: NDArray[Any]) -> NDArray[np.float64]:
        smallest = np.full(len(known), np.inf)
        with np.errstate(all="ignore"):
            try:
                high, low = self._high.weights(known), self._low.weights(known)
            except np.linalg.LinAlgError:
                return np.full(len(known), np.inf)
            above = high * known[:, self._high.support]
            rows = np.concatenate([part for weights in (above, high) for part in (weights.real, weights.imag)])
            low_rows = np.concatenate([low.real, low.imag])
            for first in range(0, result.shape[1], _LINES_AT_ONCE):
                lines = slice(first, min(first + _LINES_AT_ONCE, result.shape[1]))
                n, d = (rows @ self._high_basis[:, lines]).reshape(2, 2, len(known), -1)
                other = (low_rows @ self._low_basis[:, lines]).reshape(2, len(known), -1)
                if result.dtype.kind == "c":
                    result[:, lines] = (n[0] + 1j * n[1]) / (d[0] + 1j * d[1])
                n_square = _square(n)
                if result.dtype.kind != "c":
                    result[:, lines] = np.sqrt(n_square / _square(d))
                n_square *= _square(other)
                n_square *= self._distance[lines]
                np.minimum(smallest, n_square.min(axis=1), out=smallest)
            error: NDArray[np.float64] = np.abs(self._kappa(known, high, low)) / np.sqrt(smallest)
        return error

    def _kappa(
        self, known: NDArray[np.complex128], high: NDArray[np.complex128], low: NDArray[np.complex128]
    ) -> NDArray[np.complex128]:
        at_a = low * self._at_a
        missed = known[:, self._high.support[self._a]] * at_a.sum(1) - (at_a * known[:, self._low.support]).sum(1)
        kappa: NDArray[np.complex128] = self._span * high[:, self._a] * missed
        return kappa


def _square(parts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the squared magnitudes of numbers given by their real and imaginary parts, (2, ...), destroying these."""
    parts *= parts
    squared: NDArray[np.float64] = np.add(parts[0], parts[1], out=parts[0])
    return squared
