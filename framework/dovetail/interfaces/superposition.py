"""A joint's matrices as constant entries times functions of the parameters, from what its model declares."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import NDArray

from dovetail.errors import Fault, PluginError
from dovetail.interfaces.matrices import ScaledMatrices, SparseMatrices, StructuralMatrices

NAMES = "MKCD"
"""The matrices, in the order of the entries."""


@dataclass(frozen=True)
class Settings:
    """How declarations are evaluated and verified.

    Attributes
    ----------
    rounding : float
        Relative error of a few operations in double precision, of an entry or of the scale that its diagonal gives it.
    untrue : float
        Deviation on that scale above which a declaration is wrong; far above rounding in sums of a thousand terms.
    """

    rounding: float = 1e-15
    untrue: float = 1e-10


SETTINGS = Settings()


@dataclass(frozen=True, eq=False)
class Declaration:
    """What a model declares about its matrices, and where to evaluate them.

    Parameters
    ----------
    where : str
        The model, for messages.
    matrices : callable
        Matrices (n, d, d) of parameter vectors (n, n_params).
    size : int
        Number d of DOFs.
    names : sequence of str
        The parameters.
    lower, upper : (n_params,) arrays
        Their ranges.
    samples : (n_samples, n_params) array
        Parameter vectors within the ranges.
    linear : sequence of str
        The parameters in which the matrices are linear, with slopes that do not depend on any parameter.
    scaled : ScaledMatrices, optional
        The rest of the matrices as a function of the other parameters.
    """

    where: str
    matrices: Callable[[NDArray[np.float64]], StructuralMatrices]
    size: int
    names: Sequence[str]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    samples: NDArray[np.float64]
    linear: Sequence[str]
    scaled: ScaledMatrices | None

    @cached_property
    def columns(self) -> NDArray[np.intp]:
        """Columns of the linear parameters.

        Raises
        ------
        PluginError
            A name is not that of a parameter.
        """
        for name in self.linear:
            if name not in self.names:
                raise PluginError(Fault(self.where, f"it has no parameter {name!r:.40}.", ", ".join(self.names)))
        return np.array([self.names.index(name) for name in self.linear], dtype=np.intp)

    @cached_property
    def others(self) -> NDArray[np.intp]:
        """Columns of all other parameters."""
        return np.setdiff1d(np.arange(len(self.names)), self.columns)

    def slopes(self) -> scipy.sparse.csc_array:
        """Return the verified derivatives (4 d^2, n_linear) of the entries by the linear parameters.

        Raises
        ------
        PluginError
            The matrices are not linear in one of them, or its slope depends on another parameter.
        """
        slopes = [self._slope(int(column)) for column in self.columns]
        return scipy.sparse.csc_array(scipy.sparse.hstack(slopes))

    def _slope(self, column: int) -> scipy.sparse.csc_array:
        """Return the verified derivative (4 d^2, 1) of the entries by one linear parameter."""
        lower, upper = self.lower[column], self.upper[column]
        ends, moved = np.tile(0.5 * (self.lower + self.upper), (2, 1)), self.samples.copy()
        ends[:, column], moved[:, column] = (lower, upper), lower
        at_low, at_high = self._entries(ends)
        noise = SETTINGS.rounding * (np.abs(at_high) + np.abs(at_low)) / (upper - lower)
        slope = _shortened((at_high - at_low) / (upper - lower), noise)
        expected = self._entries(moved) + (self.samples[:, column] - lower)[:, np.newaxis] * slope
        if self._differs(self._at_samples, expected):
            name = self.names[column]
            problem = f"its matrices are not linear in '{name}' with a slope that no parameter changes, as it declares."
            raise PluginError(Fault(self.where, problem, remedy=f"Remove '{name}' from its linear parameters."))
        return scipy.sparse.csc_array(slope[:, np.newaxis])

    @cached_property
    def _at_samples(self) -> NDArray[np.float64]:
        """The entries (n_samples, 4 d^2) at the samples."""
        return self._entries(self.samples)

    def _entries(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the entries (n, 4 d^2) of M, K, C and D, row by row."""
        matrices = self.matrices(theta)
        return np.concatenate([getattr(matrices, name).reshape(len(theta), -1) for name in NAMES], axis=1)

    def _differs(self, entries: NDArray[np.float64], expected: NDArray[np.float64]) -> bool:
        """Return whether some entries (n, 4 d^2) differ by more than rounding."""
        whole = np.maximum(np.abs(entries), np.abs(expected)).reshape(-1, self.size, self.size)
        diagonal = np.sqrt(np.diagonal(whole, axis1=1, axis2=2))
        scale = whole + diagonal[:, :, np.newaxis] * diagonal[:, np.newaxis, :]
        wrong = np.abs(entries - expected).reshape(whole.shape) > SETTINGS.untrue * scale
        return bool(wrong.any()) or not np.isfinite(entries).all()

    def verify(self) -> None:
        """Raise a `PluginError` if the matrices are not linear in the linear parameters."""
        for column in self.columns:
            self._slope(int(column))

    def superposition(self) -> Superposition | None:
        """Return the whole matrices as a superposition; None if a part of them is known by `matrices` only.

        Raises
        ------
        PluginError
            A declaration is not true.
        """
        if self.scaled is None and len(self.others):
            return None
        slopes = self.slopes() if len(self.columns) else None
        rest = self._constant(slopes) if self.scaled is None else self._flat(self.scaled.matrices)
        blocks = [rest] if slopes is None else [rest, slopes]
        entries = scipy.sparse.csr_array(scipy.sparse.hstack(blocks))
        entries.sort_indices()
        whole = Superposition(self.where, entries, self.columns, self.others, self.scaled)
        if self._differs(self._at_samples, (entries @ whole.functions(self.samples)).T):
            problem = "its scaled_matrices and linear parameters do not add up to its matrices."
            raise PluginError(Fault(self.where, problem, remedy="Correct them, or leave scaled_matrices out."))
        return whole

    def _flat(self, matrices: Sequence[StructuralMatrices | SparseMatrices]) -> scipy.sparse.csc_array:
        """Return the entries (4 d^2, m) of m sets of matrices as columns."""
        size = self.size
        columns = [scipy.sparse.csc_array((len(NAMES) * size**2, 0))]
        for each in matrices:
            if each.K.shape != (size, size):
                problem = f"scaled_matrices has matrices of shape {each.K.shape}."
                raise PluginError(Fault(self.where, problem, f"{(size, size)}"))
            stacked = [scipy.sparse.coo_array(getattr(each, name)).reshape(-1, 1) for name in NAMES]
            columns.append(scipy.sparse.vstack(stacked))
        return scipy.sparse.csc_array(scipy.sparse.hstack(columns))

    def _constant(self, slopes: scipy.sparse.csc_array | None) -> scipy.sparse.csc_array:
        """Return the entries (4 d^2, 1) that depend on no parameter, if all parameters are linear."""
        at_low = self._entries(self.lower[np.newaxis])[0]
        if slopes is not None:
            change = self.lower[self.columns]
            noise = SETTINGS.rounding * (np.abs(at_low) + abs(slopes) @ np.abs(change))
            at_low = _shortened(at_low - slopes @ change, noise)
        return scipy.sparse.csc_array(at_low[:, np.newaxis])


def _shortened(values: NDArray[np.float64], rounding: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values without the rounding errors of the difference they come from: zero or few digits where possible.

    Equal springs then have exactly opposite entries, and an entry that does not depend on a parameter no slope.
    """
    few = values.astype(np.float32).astype(np.float64)
    short = np.where(np.abs(values - few) <= rounding, few, values)
    return np.where(np.abs(values) <= rounding, 0.0, short)


@dataclass(frozen=True, eq=False)
class Superposition:
    """M, K, C and D as constant entries times functions of the parameters.

    Parameters
    ----------
    where : str
        The model, for messages.
    entries : (4 d^2, n_functions) csr_array
        Row by row, those of M, then those of K, C and D.
    linear, others : arrays of int
        Columns of theta. The last functions are the linear parameters.
    scaled : ScaledMatrices, optional
        Its factors, of the other parameters, are the first functions; without it there is one, which is 1.
    """

    where: str
    entries: scipy.sparse.csr_array
    linear: NDArray[np.intp]
    others: NDArray[np.intp]
    scaled: ScaledMatrices | None

    @cached_property
    def size(self) -> int:
        """Number d of DOFs."""
        return math.isqrt(self.entries.shape[0] // len(NAMES))

    @property
    def scaled_count(self) -> int:
        """Number of factors of the scaled matrices."""
        return self.entries.shape[1] - len(self.linear) if self.scaled is not None else 0

    def functions(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the functions (n_functions, n) at parameter vectors (n, n_params)."""
        values = np.ones((self.entries.shape[1], len(theta)))
        values[len(values) - len(self.linear) :] = theta.T[self.linear]
        if self.scaled is not None:
            factors = np.asarray(self.scaled.factors(theta[:, self.others]), dtype=np.float64)
            wanted = (len(theta), self.scaled_count)
            if factors.shape != wanted:
                raise PluginError(Fault(self.where, f"its factors have the shape {factors.shape}.", f"{wanted}"))
            values[: self.scaled_count] = factors.T
        self._check_finite(values)
        return values

    @cached_property
    def pairs(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Function and column of theta of each slope: `slopes`, then the linear parameters, whose slope is 1."""
        every = np.arange(self.entries.shape[1])
        scaled, linear = every[: self.scaled_count], every[len(every) - len(self.linear) :]
        functions = np.concatenate([np.repeat(scaled, len(self.others)), linear])
        return functions, np.concatenate([np.tile(self.others, self.scaled_count), self.linear])

    def slopes(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives (n_slopes, n) of the factors of the scaled matrices by the other parameters."""
        if self.scaled is None or not len(self.others):
            return np.zeros((0, len(theta)))
        slopes = np.asarray(self.scaled.slopes(theta[:, self.others]), dtype=np.float64)
        wanted = (len(theta), self.scaled_count, len(self.others))
        if slopes.shape != wanted:
            raise PluginError(
                Fault(self.where, f"the slopes of its factors have the shape {slopes.shape}.", f"{wanted}")
            )
        values = slopes.reshape(len(theta), -1).T
        self._check_finite(values, slopes=True)
        return values

    def _check_finite(self, values: NDArray[np.float64], slopes: bool = False) -> None:
        """Raise a `PluginError` that names a matrix in which a function or a slope (n_values, n) is not finite."""
        if not np.isfinite(values).all():
            number = int(np.argmin(np.isfinite(values).all(axis=1)))
            function = int(self.pairs[0][number]) if slopes else number
            matrix = NAMES[int(np.argmax(self.filled([function]).any(axis=(1, 2))))]
            raise PluginError(Fault(self.where, f"it returns a matrix {matrix} that is not finite."))

    def filled(self, functions: NDArray[Any] | Sequence[int], names: str = NAMES) -> NDArray[np.bool_]:
        """Return the entries (4, d, d) of matrices, in the order of `names`, that some functions fill."""
        chosen = np.asarray(functions)
        entries = self.entries[:, np.flatnonzero(chosen) if chosen.dtype == np.bool_ else chosen]
        filled = np.asarray(np.diff(entries.indptr) > 0).reshape(len(NAMES), self.size, self.size)
        return np.asarray(filled[[NAMES.index(name) for name in names]])

    def filled_derivatives(self, theta: NDArray[np.float64], names: str) -> NDArray[np.bool_]:
        """Return the entries (n_params, 4, d, d) of the derivatives that parameter vectors (n, n_params) fill."""
        functions, columns = self.pairs
        acts = np.concatenate([self.slopes(theta).any(axis=1), np.ones(len(self.linear), dtype=np.bool_)])
        count = len(self.linear) + len(self.others)
        return np.stack([self.filled(functions[acts & (columns == column)], names) for column in range(count)])

    def jacobian(self, theta: NDArray[np.float64]) -> list[StructuralMatrices]:
        """Return the derivatives (n, d, d) by each parameter at parameter vectors (n, n_params)."""
        slopes = np.concatenate([self.slopes(theta), np.ones((len(self.linear), len(theta)))])
        functions, columns = self.pairs
        derivatives = []
        for column in range(len(self.linear) + len(self.others)):
            chosen = columns == column
            entries = self.entries[:, functions[chosen]] @ slopes[chosen]
            shape = (len(NAMES), self.size, self.size, len(theta))
            derivatives.append(StructuralMatrices(*np.moveaxis(entries.reshape(shape), -1, 1)))
        return derivatives
