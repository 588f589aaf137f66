"""The residuals of all tests as functions of the unknowns of a series."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.posterior.randomize_then_optimize import LinearisedPoints
from dovetail.problem.least_squares import Linearisation, SumOfSquares
from dovetail.series.arrow import ArrowMatrix, arrow_vector
from dovetail.series.unknowns import SeriesUnknowns

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SeriesResiduals:
    """Residuals of the tests as functions of all unknowns z, which have standard normal priors.

    The residuals of a point are ``[z, r]``, with those of all tests one after another in r. Their derivatives are kept
    in a compact form, (n, w, m): a row for each shared unknown, then one for each unknown of the test to which a
    residual belongs, filled up with zeros where a test has fewer.

    Parameters
    ----------
    unknowns : SeriesUnknowns
    misfits : sequence of SumOfSquares
        Of each test, as functions of fractions of its ranges.
    """

    unknowns: SeriesUnknowns
    misfits: Sequence[SumOfSquares]

    @property
    def shared(self) -> int:
        """Number of unknowns that the tests have in common."""
        return len(self.unknowns.shared)

    @cached_property
    def _columns(self) -> list[slice]:
        """The residuals of each test among those of all."""
        middles = self.fractions(np.zeros((1, self.unknowns.count)))
        pairs = zip(self.misfits, middles, strict=True)
        ends = np.cumsum([0, *(misfit.residuals(middle).shape[1] for misfit, middle in pairs)])
        return [slice(first, last) for first, last in pairwise(ends.tolist())]

    def fractions(self, z: Array) -> list[Array]:
        """Return the parameters (n, p_k) of each test in fractions of their ranges."""
        return [one.fractions(self.unknowns.for_test(k, z)) for k, one in enumerate(self.unknowns.maps)]

    def split_by_test(self, residuals: Array) -> list[Array]:
        """Return the residuals (n, m_k) of each test, of all residuals ``[z, r]`` (n, d + m)."""
        measured = residuals[:, self.unknowns.count :]
        return [measured[:, columns] for columns in self._columns]

    def jacobians(self, jacobian: Array) -> list[Array]:
        """Return the derivatives (n, g + l_k, m_k) of each test's residuals, of the compact ones of all (n, w, m)."""
        pairs = zip(self.unknowns.maps, self._columns, strict=True)
        return [jacobian[:, : one.shared + one.own, columns] for one, columns in pairs]

    def residuals(self, z: Array) -> Array:
        """Return the residuals ``[z, r]`` (n, d + m) at z (n, d)."""
        pairs = zip(self.misfits, self.fractions(z), strict=True)
        return np.concatenate([z, *(misfit.residuals(fraction) for misfit, fraction in pairs)], axis=1)

    def linearise(self, z: Array) -> LinearisedPoints:
        """Return residuals and derivatives at z (n, d)."""
        size, columns = max(one.shared + one.own for one in self.unknowns.maps), self._columns
        residuals = np.empty((len(z), z.shape[1] + columns[-1].stop))
        jacobian = np.zeros((len(z), size, columns[-1].stop))
        residuals[:, : z.shape[1]] = z
        parts = zip(self.split_by_test(residuals), self.jacobians(jacobian), strict=True)
        for index, (test_residuals, test_slopes) in enumerate(parts):
            fractions, slopes = self.unknowns.maps[index].linearise(self.unknowns.for_test(index, z))
            linear = self.misfits[index].linearise(fractions)
            test_residuals[:] = linear.residuals
            np.matmul(np.swapaxes(slopes, 1, 2), linear.jacobian, out=test_slopes)
        return LinearisedPoints(z, residuals, jacobian)

    def products(self, left: Array, right: Array, diagonal: Array) -> ArrowMatrix:
        """Return the products of compact derivatives (n, w, m) and transposed ones, plus a diagonal (n, d)."""
        pairs = zip(self.jacobians(left), self.jacobians(right), strict=True)
        return ArrowMatrix.added(diagonal, [one @ np.swapaxes(other, 1, 2) for one, other in pairs], self.shared)

    def gradient(self, jacobian: Array, residuals: Array, prior: Array | float = 1.0) -> Array:
        """Return J^T r (n, d), with the derivatives of the tests' residuals and a weight of the prior."""
        pairs = zip(self.jacobians(jacobian), self.split_by_test(residuals), strict=True)
        parts = [(one @ part[:, :, np.newaxis])[:, :, 0] for one, part in pairs]
        return arrow_vector(parts, self.shared) + prior * residuals[:, : self.unknowns.count]

    def without_rows(self, jacobian: Array, held: Sequence[int]) -> Array:
        """Return compact derivatives (n, w, m) with those by some shared unknowns replaced by 0."""
        if not len(held):
            return jacobian
        others = jacobian.copy()
        others[:, list(held)] = 0.0
        return others


@dataclass(frozen=True, eq=False)
class QuadraticMisfit(SumOfSquares):
    """The residuals of a test near its own fit: linear in the fractions.

    Parameters
    ----------
    centre : (p,) array
        Fractions of the ranges at the fit.
    root : (p, p) array
        A matrix with root^T root the information.
    """

    centre: Array
    root: Array

    @staticmethod
    def of(centre: Array, information: Array) -> QuadraticMisfit:
        """Return the misfit with this centre and this Fisher information."""
        values, vectors = np.linalg.eigh(information)
        return QuadraticMisfit(centre, np.sqrt(np.maximum(values, 0.0))[:, np.newaxis] * vectors.T)

    def residuals(self, position: Array) -> Array:
        """Return residuals (n, p)."""
        return np.asarray((position - self.centre) @ self.root.T)

    def linearise(self, position: Array) -> Linearisation:
        """Return residuals and derivatives."""
        jacobian = np.broadcast_to(self.root.T, (len(position), *self.root.T.shape))
        return Linearisation(self.residuals(position), jacobian)
