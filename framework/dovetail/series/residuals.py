"""The residuals of all tests as functions of the unknowns of a series."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.posterior.likelihood import squared_norms
from dovetail.problem.least_squares import Linearisation, SumOfSquares
from dovetail.series.arrow import ArrowMatrix, arrow_vector
from dovetail.series.unknowns import SeriesUnknowns

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SeriesPoints:
    """Points of the unknowns with the residuals of each test, and their derivatives.

    Parameters
    ----------
    z : (n, d) array
    residuals : list of (n, m_k) arrays
    jacobians : list of (n, g + l_k, m_k) arrays
        Derivatives by the shared unknowns and those of the test.
    """

    z: Array
    residuals: Sequence[Array]
    jacobians: Sequence[Array]

    @property
    def squares(self) -> Array:
        """(n,) sums of the squared residuals of all tests."""
        return np.asarray(sum(squared_norms(part) for part in self.residuals))

    def at_rows(self, rows: NDArray[np.intp]) -> SeriesPoints:
        """Return copies of some of the points."""
        return SeriesPoints(self.z[rows], [one[rows] for one in self.residuals], [one[rows] for one in self.jacobians])

    def overwrite(self, rows: NDArray[np.intp], others: SeriesPoints) -> None:
        """Overwrite the points in `rows` by as many others."""
        self.z[rows] = others.z
        for mine, theirs in zip(
            (*self.residuals, *self.jacobians), (*others.residuals, *others.jacobians), strict=True
        ):
            mine[rows] = theirs

    @staticmethod
    def joined(parts: Sequence[SeriesPoints]) -> SeriesPoints:
        """Return all points of several sets."""
        residuals = [np.concatenate(each) for each in zip(*(part.residuals for part in parts), strict=True)]
        jacobians = [np.concatenate(each) for each in zip(*(part.jacobians for part in parts), strict=True)]
        return SeriesPoints(np.concatenate([part.z for part in parts]), residuals, jacobians)


@dataclass(frozen=True, eq=False)
class SeriesResiduals:
    """Residuals of the tests as functions of all unknowns z, which have standard normal priors.

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

    def fractions(self, z: Array) -> list[Array]:
        """Return the parameters (n, p_k) of each test in fractions of their ranges."""
        return [one.fractions(self.unknowns.of_test(k, z)) for k, one in enumerate(self.unknowns.maps)]

    def residuals(self, z: Array) -> list[Array]:
        """Return the residuals (n, m_k) of each test."""
        pairs = zip(self.misfits, self.fractions(z), strict=True)
        return [misfit.residuals(fraction) for misfit, fraction in pairs]

    def linearise(self, z: Array) -> SeriesPoints:
        """Return residuals and derivatives at z (n, d)."""
        residuals, jacobians = [], []
        for index, (misfit, test_map) in enumerate(zip(self.misfits, self.unknowns.maps, strict=True)):
            fractions, slopes = test_map.linearise(self.unknowns.of_test(index, z))
            there = misfit.linearise(fractions)
            residuals.append(there.residuals)
            jacobians.append(np.swapaxes(slopes, 1, 2) @ there.jacobian)
        return SeriesPoints(z, residuals, jacobians)

    def normal_equations(self, points: SeriesPoints, prior: Array) -> tuple[ArrowMatrix, Array]:
        """Return the Gauss-Newton matrices and gradients (n, d) of half the sums of squares.

        Parameters
        ----------
        points : SeriesPoints
        prior : (d,) array
            Weight of each unknown's square among the squares: 1 with its prior, 0 without.
        """
        products = [one @ np.swapaxes(one, 1, 2) for one in points.jacobians]
        vectors = [
            (one @ part[:, :, np.newaxis])[:, :, 0]
            for one, part in zip(points.jacobians, points.residuals, strict=True)
        ]
        diagonal = np.broadcast_to(prior, points.z.shape)
        matrix = ArrowMatrix.added(diagonal, products, self.shared)
        return matrix, arrow_vector(vectors, self.shared) + prior * points.z


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
