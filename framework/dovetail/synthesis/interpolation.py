"""An engine that computes a few lines of each FRF and interpolates the others, as far as its error estimate allows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.synthesis.barycentric import RationalPair, chebyshev_lines
from dovetail.synthesis.engine import Engine
from dovetail.synthesis.graph import Graph
from dovetail.synthesis.system import Point, Theta

__all__ = ["InterpolatedEngine"]

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
