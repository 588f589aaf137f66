"""Derivatives of a joint's matrices: exact if they are linear in a parameter, else by finite differences."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces.matrices import StructuralMatrices

Matrices = Callable[[NDArray[np.float64]], StructuralMatrices]
"""Matrices (n, d, d) of parameter vectors (n, n_params)."""


@dataclass(frozen=True)
class Settings:
    """How derivatives are computed.

    The steps follow from the rounding of double precision. They were checked on the bundled joints, on powers and on
    exponentials, and are tested on joints with stops and gaps.

    Attributes
    ----------
    step : float
        Step of the differences, relative to the parameter. Their truncation error is about step^4 and their rounding
        error about 1e-16 / step; here both are near 1e-12 of the derivative.
    least_step : float
        Smallest step, relative to the parameter's range, for a parameter near zero.
    greatest_step : float
        Largest step, relative to the parameter's range, so that a stencil fits into it.
    kink : float
        Difference between the derivatives of fourth and of second order above which the function is assumed to have a
        kink within the stencil. It is relative to the derivative or, if that vanishes, to the value over the parameter;
        for a smooth function it is near step^2.
    shorter : tuple of float
        Factors of the step with which the derivative is computed again if there may be a kink.
    better : float
        Factor by which a shorter step must reduce this difference to be used. For a noisy function the difference is
        the same at any step, and the longest step is kept.
    probes : int
        Number of parameter vectors at which slopes are compared.
    rounding : float
        Largest difference, relative to the entry, that counts as rounding.
    block_bytes : float
        Memory of the matrices that are evaluated at a time: few calls, and they stay in the processor's cache.
    """

    step: float = 1e-3
    least_step: float = 1e-6
    greatest_step: float = 0.1
    kink: float = 1e-4
    shorter: tuple[float, ...] = (1e-2, 1e-4)
    better: float = 0.1
    probes: int = 4
    rounding: float = 1e-12
    block_bytes: float = 4e6


SETTINGS = Settings()

_NODES = np.array([[1.0, -1.0, 2.0, -2.0], [1.0, 2.0, 3.0, 4.0], [-1.0, -2.0, -3.0, -4.0]])
"""Distances, in steps, of the points of a central, a forward and a backward difference, without the middle."""
_FOURTH_ORDER = np.array([[8.0, -8.0, -1.0, 1.0], [48.0, -36.0, 16.0, -3.0], [-48.0, 36.0, -16.0, 3.0]]) / 12.0
_SECOND_ORDER = np.array([[0.5, -0.5, 0.0, 0.0], [2.0, -0.5, 0.0, 0.0], [-2.0, 0.5, 0.0, 0.0]])
"""Weights of the values at these points; that of the value in the middle makes their sum zero."""


def differences(
    function: Callable[[NDArray[np.float64]], NDArray[Any]],
    theta: NDArray[np.float64],
    columns: Sequence[int],
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
) -> NDArray[Any]:
    """Return derivatives by some parameters, computed with differences of fourth order.

    At the ends of a range they are one-sided, so that no parameter vector outside the ranges is needed. If the function
    seems to have a kink within the stencil, as at a stop, the step is shortened.

    Parameters
    ----------
    function : callable
        Values (n, ...) of parameter vectors (n, n_params), each independent of the others.
    theta : (n, n_params) array
    columns : sequence of int
        The parameters by which to differentiate.
    lower, upper : (n_params,) arrays
        Ranges of the parameters.

    Returns
    -------
    (n_columns, n, ...) array
        Per unit of the parameter.
    """
    column = np.repeat(np.asarray(columns, dtype=np.intp), len(theta))
    vectors = np.tile(theta, (len(columns), 1))
    at, width = vectors[np.arange(len(column)), column], (upper - lower)[column]
    step = np.maximum(SETTINGS.step * np.abs(at), SETTINGS.least_step * width)
    step = np.minimum(step, SETTINGS.greatest_step * width)

    def shortened(pairs: NDArray[np.intp], factor: float) -> tuple[NDArray[Any], NDArray[np.float64]]:
        size, varied = factor * step[pairs], column[pairs]
        inside = (lower[varied] <= at[pairs]) & (at[pairs] <= upper[varied])
        forward = inside & (at[pairs] - 2.0 * size < lower[varied])
        backward = inside & ~forward & (at[pairs] + 2.0 * size > upper[varied])
        kind = np.where(forward, 1, np.where(backward, 2, 0))
        return _difference(function, vectors[pairs], varied, size, kind)

    derivatives, disagreement = shortened(np.arange(len(column)), 1.0)
    for factor in SETTINGS.shorter:
        pairs = np.flatnonzero(disagreement > SETTINGS.kink)
        if not len(pairs):
            break
        shorter, remaining = shortened(pairs, factor)
        better = remaining < SETTINGS.better * disagreement[pairs]
        derivatives[pairs[better]], disagreement[pairs[better]] = shorter[better], remaining[better]
    return derivatives.reshape(len(columns), len(theta), *derivatives.shape[1:])


def _difference(
    function: Callable[[NDArray[np.float64]], NDArray[Any]],
    vectors: NDArray[np.float64],
    column: NDArray[np.intp],
    step: NDArray[np.float64],
    kind: NDArray[np.intp],
) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """Return each vector's derivative by one parameter, and its relative difference between the two orders."""
    moved = np.repeat(vectors[np.newaxis], _NODES.shape[1], axis=0)
    moved[:, np.arange(len(column)), column] += (_NODES[kind] * step[:, np.newaxis]).T
    values = function(moved.reshape(-1, vectors.shape[1]))
    shape = (len(column), *values.shape[1:])
    values = values.reshape(_NODES.shape[1], len(column), -1)
    size = np.abs(values).max(axis=0)
    one_sided = np.flatnonzero(kind)
    if len(one_sided):
        values[:, one_sided] -= function(vectors[one_sided]).reshape(len(one_sided), -1)
    changing = (values != values[0]).any(axis=(0, 1)) | (values[:, one_sided] != 0).any(axis=(0, 1))
    values, per_step = values[..., changing], 1.0 / step[:, np.newaxis]
    fourth = _weighted_sum(_FOURTH_ORDER[kind], values) * per_step
    second = _weighted_sum(_SECOND_ORDER[kind], values) * per_step
    scale = np.maximum(np.maximum(np.abs(fourth), np.abs(second)), SETTINGS.step * size[:, changing] * per_step)
    disagreement = np.divide(np.abs(fourth - second), scale, out=np.zeros_like(scale), where=scale > 0)
    derivative = np.zeros((len(column), changing.size), dtype=values.dtype)
    derivative[:, changing] = fourth
    return derivative.reshape(shape), disagreement.max(axis=1, initial=0.0)


def _weighted_sum(weights: NDArray[np.float64], values: NDArray[Any]) -> NDArray[Any]:
    """Sum values (n_nodes, n, n_entries) with weights (n, n_nodes), in an order that does not depend on n."""
    total: NDArray[Any] = weights[:, :1] * values[0]
    for node in range(1, len(values)):
        total += weights[:, node, np.newaxis] * values[node]
    return total


@dataclass(frozen=True, eq=False)
class _Entries:
    """The entries of M, K, C and D that are differentiated; all others have been zero so far.

    Parameters
    ----------
    numbers : (n_entries,) int array
        Indices of the entries, row by row, those of M, then those of K, C and D.
    slopes : (n_linear, n_entries) array
        Derivatives by the parameters in which the matrices are linear.
    """

    numbers: NDArray[np.intp]
    slopes: NDArray[np.float64]


class Differentiation:
    """Derivatives of matrices by their parameters.

    If the matrices are linear in a parameter over its whole range, with a slope that does not depend on the other
    parameters, that slope is the derivative. It is computed once, from a few probes, and verified with the matrices at
    each parameter vector. All other derivatives are differences, and so are all derivatives at a parameter vector where
    the verification fails.

    Parameters
    ----------
    matrices : callable
    size : int
        Number d of DOFs.
    lower, upper : (n_params,) arrays
        Ranges of the parameters.
    known : mapping of int to (4 d^2,) array, optional
        Slopes by parameters in which the matrices are known to be linear, for which nothing has to be verified.
    """

    def __init__(
        self,
        matrices: Matrices,
        size: int,
        lower: NDArray[np.float64],
        upper: NDArray[np.float64],
        known: Mapping[int, NDArray[np.float64]] | None = None,
    ) -> None:
        self._matrices, self._size, self._lower, self._upper = matrices, size, lower, upper
        self._filled = np.zeros(4 * size**2, dtype=np.bool_)
        self._known = {column: slope.reshape(4, 1, size, size) for column, slope in (known or {}).items()}
        unknown = [column for column in range(len(lower)) if column not in self._known]
        slopes = {column: self._constant_slope(column) for column in unknown}
        self._slopes = {column: slope for column, slope in slopes.items() if slope is not None}
        self._nonlinear = [column for column, slope in slopes.items() if slope is None]
        self._entries = self._entries_of(self._filled)
        self._at_lower_ends: tuple[_Entries, NDArray[np.float64]] | None = None
        self._constant: tuple[int, dict[int, StructuralMatrices]] = (0, {})

    def jacobian(self, theta: NDArray[np.float64]) -> list[StructuralMatrices]:
        """Return the derivatives (n, d, d) by each parameter at parameter vectors (n, n_params)."""
        while True:
            entries = self._entries
            differences = self._differences(theta, self._nonlinear, entries)
            deviating = self._deviates(theta, entries)
            corrections = self._differences(theta[deviating], list(self._slopes), entries) if deviating.any() else {}
            if self._entries is entries:
                break
        derivatives = {**self._constant_derivatives(len(theta)), **self._spread(differences, entries)}
        for column, derivative in self._spread(corrections, entries).items():
            whole = np.broadcast_to(self._slopes[column], (4, len(theta), self._size, self._size)).copy()
            whole[:, deviating] = np.stack([derivative.M, derivative.K, derivative.C, derivative.D])
            derivatives[column] = StructuralMatrices(*whole)
        return [derivative for _, derivative in sorted(derivatives.items())]

    def _constant_derivatives(self, count: int) -> dict[int, StructuralMatrices]:
        """Return the slopes, repeated for `count` parameter vectors; they are cached."""
        kept, constant = self._constant
        if kept != count:
            shape = (4, count, self._size, self._size)
            slopes = (self._known | self._slopes).items()
            constant = {column: StructuralMatrices(*np.broadcast_to(slope, shape)) for column, slope in slopes}
            self._constant = count, constant
        return constant

    def _constant_slope(self, column: int) -> NDArray[np.float64] | None:
        """Return the slope (4, 1, d, d) of M, K, C and D by a parameter, or None if it is not constant."""
        low, width = self._lower, self._upper - self._lower
        slope: NDArray[np.float64] | None = None
        for fractions in np.random.default_rng(0).random((SETTINGS.probes, len(low))):
            rows = np.tile(low + fractions * width, (3, 1))
            rows[0, column], rows[2, column] = low[column], self._upper[column]
            distance = (rows[:, column] - low[column])[:, np.newaxis, np.newaxis]
            every = self._all_entries(rows)
            self._filled |= (every != 0).any(axis=0)
            values = every.reshape(3, 4, self._size, self._size).swapaxes(0, 1)
            slope = (values[:, 2:] - values[:, :1]) / width[column] if slope is None else slope
            errors = np.abs(values - values[:, :1] - distance * slope)
            if (errors > SETTINGS.rounding * np.abs(values).max(axis=1, keepdims=True)).any():
                return None
        return slope

    def _deviates(self, theta: NDArray[np.float64], entries: _Entries) -> NDArray[np.bool_]:
        """Return for which parameter vectors (n, n_params) the constant slopes do not explain the matrices, (n,)."""
        deviating = np.zeros(len(theta), dtype=np.bool_)
        linear = list(self._slopes)
        for block in self._blocks(len(theta), 2) if linear else ():
            start = theta[block].copy()
            start[:, linear] = self._lower[linear]
            if self._nonlinear:
                values, base = self._values(np.concatenate([theta[block], start]), entries).reshape(2, len(start), -1)
            else:
                values, base = self._values(theta[block], entries), self._values_at_lower_ends(entries)
            change = (theta[block] - start)[:, linear] @ entries.slopes
            limit = SETTINGS.rounding * np.maximum(np.abs(base), np.abs(values))
            deviating[block] = np.any(np.abs(values - base - change) > limit, axis=1)
        return deviating

    def _values_at_lower_ends(self, entries: _Entries) -> NDArray[np.float64]:
        """Return some entries (1, n_entries) with all parameters at their lower ends; they are cached."""
        if self._at_lower_ends is None or self._at_lower_ends[0] is not entries:
            self._at_lower_ends = entries, self._values(self._lower[np.newaxis], entries)
        return self._at_lower_ends[1]

    def _differences(
        self, theta: NDArray[np.float64], columns: Sequence[int], entries: _Entries
    ) -> dict[int, NDArray[np.float64]]:
        """Return the derivatives (n, n_entries) by some parameters, computed with differences."""
        derivatives = np.zeros((len(columns), len(theta), len(entries.numbers)))
        for block in self._blocks(len(theta), _NODES.shape[1] * len(columns)) if columns else ():
            derivatives[:, block] = differences(
                lambda vectors: self._values(vectors, entries), theta[block], columns, self._lower, self._upper
            )
        return dict(zip(columns, derivatives, strict=True))

    def _spread(
        self, derivatives: Mapping[int, NDArray[np.float64]], entries: _Entries
    ) -> dict[int, StructuralMatrices]:
        """Return matrices (n, d, d) with values (n, n_entries) at the entries and zeros elsewhere."""
        spread = {}
        for column, values in derivatives.items():
            full = np.zeros((len(values), len(self._filled)))
            full[:, entries.numbers] = values
            spread[column] = StructuralMatrices(*full.reshape(-1, 4, self._size, self._size).swapaxes(0, 1))
        return spread

    def _blocks(self, count: int, evaluations: int) -> Iterator[slice]:
        """Divide `count` parameter vectors into blocks, each vector with some evaluations of the matrices."""
        size = max(1, int(SETTINGS.block_bytes / (4 * 8 * self._size**2 * evaluations)))
        return (slice(first, first + size) for first in range(0, count, size))

    def _values(self, theta: NDArray[np.float64], entries: _Entries) -> NDArray[np.float64]:
        """Return some entries (n, n_entries) of M, K, C and D; record further entries that are not zero."""
        every = self._all_entries(theta)
        chosen: NDArray[np.float64] = every[:, entries.numbers]
        if np.count_nonzero(chosen != 0) < np.count_nonzero(every != 0):
            self._filled |= (every != 0).any(axis=0)
            self._entries = self._entries_of(self._filled)
        return chosen

    def _all_entries(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the entries (n, 4 d^2) of M, K, C and D, row by row."""
        matrices = self._matrices(theta)
        return np.concatenate([getattr(matrices, name).reshape(len(theta), -1) for name in "MKCD"], axis=1)

    def _entries_of(self, filled: NDArray[np.bool_]) -> _Entries:
        slopes = np.array([slope.reshape(-1)[filled] for slope in self._slopes.values()])
        return _Entries(np.flatnonzero(filled), slopes)
