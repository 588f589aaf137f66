"""FRFs of an engine at a few lines, interpolated at the others with a rational function.

An FRF whose estimated error exceeds the tolerance is computed at every line.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.parallel import one_blas_thread
from dovetail.synthesis.coupled_system import Within
from dovetail.synthesis.engine import Engine
from dovetail.synthesis.joint_evaluation import Theta, sample_count
from dovetail.synthesis.plan import FactorsLike


@dataclass(frozen=True)
class Settings:
    """How many exact lines an FRF needs, and when interpolation saves time."""

    counts: tuple[int, ...] = (9, 13, 17, 21, 25, 27, 29, 33, 41, 49, 65, 81, 97)
    """Numbers of exact lines that are tried, in this order."""
    most_exact: float = 1 / 8
    """Share of exact lines above which interpolation hardly saves time."""
    most_rejected: float = 0.03
    """Share of the trial's FRFs that may exceed the tolerance."""
    fewest_multiplications: int = 100
    """Multiplications of the elimination at a line below which exact lines cost no more than interpolated ones."""
    fewest_samples: int = 32
    """Number of FRFs in a call below which the preparation takes longer than interpolation saves."""
    samples_at_once: int = 64
    """Chosen with `lines_at_once` so that the arrays of a block of FRFs stay in the second-level cache."""
    lines_at_once: int = 512


SETTINGS = Settings()


class InterpolatedFrfs:
    """FRFs of an engine, interpolated between exact lines (`FrfSource`).

    Parameters
    ----------
    engine : Engine
        Computes the FRFs that are not interpolated.
    tolerance : float
        Largest estimated relative error at any line. If an FRF of a parameter vector exceeds it, all its FRFs are
        computed exactly; so are calls for a few vectors.
    trial : mapping of str to (n, n_params) array
        Parameter vectors with which the number of exact lines is chosen.

    Attributes
    ----------
    rejections : int
        Number of FRFs so far that were computed exactly because of their estimated error.
    """

    def __init__(self, engine: Engine, tolerance: float, trial: Theta) -> None:
        self._engine = engine
        self.tolerance = tolerance
        self.rejections = 0
        self._trial = trial

    @cached_property
    def interpolant(self) -> RationalInterpolant | None:
        """The interpolant with the fewest exact lines that suffice, or None if interpolation saves no time."""
        engine, frequency = self._engine, self._engine.frequency
        if engine.program.multiplications < SETTINGS.fewest_multiplications:
            return None
        exact = engine.frfs(self._trial).reshape(-1, len(frequency))
        interpolated = np.empty_like(exact)
        for count in SETTINGS.counts:
            if count > SETTINGS.most_exact * len(frequency):
                break
            interpolant = RationalInterpolant(frequency, chebyshev_lines(count, len(frequency)))
            accepted = interpolant.fill(exact[:, interpolant.lines], interpolated) <= self.tolerance
            error = np.max(np.abs(interpolated - exact) / np.abs(exact), axis=1)
            if np.mean(accepted) >= 1 - SETTINGS.most_rejected and np.all(error[accepted] <= 10 * self.tolerance):
                return interpolant
        return None

    @cached_property
    def _exact_engine(self) -> Engine:
        assert self.interpolant is not None
        engine, frequency = self._engine, self._engine.frequency
        points, theta, chosen = engine.system.points, engine.probe_theta, frequency[self.interpolant.lines]
        return Engine(engine.graph, chosen, points, theta, pairs=engine.pairs, within=Within(frequency))

    def frfs(self, theta: Theta, factors: FactorsLike = None) -> NDArray[np.complex128]:
        """Return the FRFs of all pairs for each parameter vector, as `Engine.frfs` does."""
        return self._interpolate(theta, factors, np.complex128, self._engine.frfs)

    def amplitudes(self, theta: Theta, factors: FactorsLike) -> NDArray[np.float32]:
        """Return the magnitudes of the FRFs of all pairs, as `Engine.amplitudes` does."""
        return self._interpolate(theta, factors, np.float32, self._engine.amplitudes)

    def _interpolate(
        self, theta: Theta, factors: FactorsLike, dtype: type[np.generic], exactly: Callable[..., NDArray[Any]]
    ) -> NDArray[Any]:
        """Return interpolated FRFs, or exact ones for vectors with an FRF whose error exceeds the tolerance."""
        if sample_count(theta) < SETTINGS.fewest_samples or self.interpolant is None:
            return exactly(theta, factors)
        interpolant, size = self.interpolant, SETTINGS.samples_at_once
        self._exact_engine.threads = self._engine.threads
        exact = self._exact_engine.frfs(theta, self._engine.prepared(factors).values[:, interpolant.lines])
        shape = exact.shape[:2]
        exact = exact.reshape(-1, exact.shape[-1])
        result = np.empty((len(exact), len(self._engine.frequency)), dtype=dtype)
        error = np.empty(len(exact))

        def fill_block(first: int) -> None:
            block = slice(first, first + size)
            error[block] = interpolant.fill(exact[block], result[block])

        with one_blas_thread(), ThreadPoolExecutor(self._engine.threads) as pool:
            list(pool.map(fill_block, range(0, len(exact), size)))
        result = result.reshape(*shape, -1)
        rejected = ~(error <= self.tolerance).reshape(shape).all(axis=1)
        if rejected.any():
            result[rejected] = exactly({name: values[rejected] for name, values in theta.items()}, factors)
            self.rejections += int(np.count_nonzero(rejected)) * len(self._engine.pairs)
        return result


def chebyshev_lines(count: int, lines: int) -> NDArray[np.intp]:
    """Return the indices of `count` out of `lines` lines, spaced like Chebyshev points: denser towards both ends."""
    fraction = (1.0 - np.cos(np.pi * (np.arange(count) + 0.5) / count)) / 2.0
    return np.unique(np.round(fraction * (lines - 1)).astype(np.intp))


class _BarycentricRational:
    """Rational functions of frequency in barycentric form, with the same support lines for all FRFs.

    r(f) = n(f) / d(f), n(f) = sum_j w_j h_j / (f - f_j), d(f) = sum_j w_j / (f - f_j). It has the values h_j at the
    support frequencies f_j for any weights. The weights are chosen so that it has the correct values at the other lines
    too (Antoulas and Anderson 1986).
    """

    def __init__(self, nodes: NDArray[np.float64], support: NDArray[np.intp], others: NDArray[np.intp]) -> None:
        self.support = support
        self._others = others
        self._nodes = nodes
        self._cauchy = 1.0 / (nodes[others][:, None] - nodes[support])

    def weights(self, values: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return weights w (n, n_support) for the values h (n, n_nodes), scaled so that the last column is 1."""
        h_support, h_others = values[:, self.support], values[:, self._others]
        loewner = (h_others[:, :, None] - h_support[:, None, :]) * self._cauchy / np.abs(h_others)[:, :, None]
        weights = np.ones_like(h_support)
        weights[:, :-1] = -np.linalg.solve(loewner[:, :, :-1], loewner[:, :, -1:])[:, :, 0]
        return weights

    def basis(self, frequency: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return 1 / (f - f_j), (n_support, n_freq), or the unit vector of a support line at that line."""
        distance = frequency[None, :] - self._nodes[self.support][:, None]
        hit = distance == 0.0
        basis = 1.0 / np.where(hit, 1.0, distance)
        basis[:, hit.any(axis=0)] = 0.0
        basis[hit] = 1.0
        return basis


class RationalInterpolant:
    """A rational function through the exact lines of an FRF, with an error estimate from one of lower degree.

    Parameters
    ----------
    frequency : (n_freq,) array
        Hz, where the FRFs are computed.
    lines : (n_nodes,) array
        Indices of the exact lines, an odd number of nine or more.

    Notes
    -----
    The first function has its support at every other exact line and passes through all exact lines. The second has its
    support at the lines between and passes through all exact lines except two, a and b. The functions agree at the
    others, so that the numerator of their difference is a constant. Relative to the first function the difference is

        kappa / ((f - a) (f - b) n_1(f) d_2(f)),   kappa = (a - b) w_a (h_a d_2(a) - n_2(a)),

    at every frequency. Its largest magnitude over all lines is the error estimate; it is not a bound.
    """

    def __init__(self, frequency: NDArray[np.float64], lines: NDArray[np.intp]) -> None:
        nodes = frequency[lines]
        even, odd = np.arange(0, len(lines), 2), np.arange(1, len(lines), 2)
        self._a, self._b = len(even) // 3, 2 * len(even) // 3
        a, b = nodes[even[self._a]], nodes[even[self._b]]
        self.lines = lines
        self._high = _BarycentricRational(nodes, even, odd)
        self._low = _BarycentricRational(nodes, odd, np.delete(even, [self._a, self._b]))
        self._high_basis, self._low_basis = self._high.basis(frequency), self._low.basis(frequency)
        self._at_a = self._low.basis(np.array([a]))[:, 0]
        self._span = a - b
        self._distance = ((frequency - a) * (frequency - b)) ** 2
        self._distance[lines] = np.inf

    def fill(self, exact: NDArray[np.complex128], result: NDArray[Any]) -> NDArray[np.float64]:
        """Interpolate FRFs between their exact lines.

        Parameters
        ----------
        exact : (n, n_nodes) complex array
        result : (n, n_freq) array
            Filled with complex values if it is complex, with magnitudes otherwise.

        Returns
        -------
        (n,) array
            Largest estimated relative error; infinite or NaN if there is no such function.
        """
        smallest = np.full(len(exact), np.inf)
        with np.errstate(all="ignore"):
            try:
                high, low = self._high.weights(exact), self._low.weights(exact)
            except np.linalg.LinAlgError:
                return np.full(len(exact), np.inf)
            numerator = high * exact[:, self._high.support]
            rows = np.concatenate([numerator.real, numerator.imag, high.real, high.imag])
            low_rows = np.concatenate([low.real, low.imag])
            for first in range(0, result.shape[1], SETTINGS.lines_at_once):
                lines = slice(first, min(first + SETTINGS.lines_at_once, result.shape[1]))
                n, d = (rows @ self._high_basis[:, lines]).reshape(2, 2, len(exact), -1)
                d_low = (low_rows @ self._low_basis[:, lines]).reshape(2, len(exact), -1)
                if result.dtype.kind == "c":
                    result[:, lines] = (n[0] + 1j * n[1]) / (d[0] + 1j * d[1])
                n_square = _squared_magnitude(n)
                if result.dtype.kind != "c":
                    result[:, lines] = np.sqrt(n_square / _squared_magnitude(d))
                n_square *= _squared_magnitude(d_low)
                n_square *= self._distance[lines]
                np.minimum(smallest, n_square.min(axis=1), out=smallest)
            error: NDArray[np.float64] = np.abs(self._kappa(exact, high, low)) / np.sqrt(smallest)
        return error

    def _kappa(
        self, exact: NDArray[np.complex128], high: NDArray[np.complex128], low: NDArray[np.complex128]
    ) -> NDArray[np.complex128]:
        at_a = low * self._at_a
        difference = exact[:, self._high.support[self._a]] * at_a.sum(1) - (at_a * exact[:, self._low.support]).sum(1)
        kappa: NDArray[np.complex128] = self._span * high[:, self._a] * difference
        return kappa


def _squared_magnitude(halves: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the squared magnitudes of numbers from their real and imaginary parts (2, ...), which are overwritten."""
    halves *= halves
    squared: NDArray[np.float64] = np.add(halves[0], halves[1], out=halves[0])
    return squared
