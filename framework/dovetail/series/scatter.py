"""The standard deviations from test to test: an approximation of their posterior, from which they are drawn.

Deviations of well-determined values from their mean are inversely proportional to their standard deviation, so that no
tangent map follows both. Standard deviations are therefore drawn first, from a t distribution that resembles their
marginal posterior; all other unknowns follow at given standard deviations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from dovetail.inference.posterior.likelihood import Z_LIMIT, unit_from_normal
from dovetail.inference.posterior.randomize_then_optimize import LinearisedPoints
from dovetail.series.fitting import minimise, normal_equations
from dovetail.series.residuals import SeriesResiduals

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Settings:
    """How the marginal posterior is explored."""

    points: int = 48
    """Draws in each round, for each standard deviation."""
    rounds: int = 3
    """Rounds of draws, each about the mean and covariance of the one before."""
    freedom: float = 5.0
    """Degrees of freedom of the t distribution: its tails are heavier than those of a posterior."""
    spread: float = 1.0
    """First scale, in standard deviations of the prior."""
    widened: float = 1.2
    """Factor of the standard deviation of the weighted draws of a round."""
    least_spread: float = 0.05
    """Smallest scale, in standard deviations of the prior."""


_SETTINGS = Settings()


@dataclass(frozen=True, eq=False)
class ScatterProposal:
    """A t distribution of the normal quantiles of the standard deviations.

    Parameters
    ----------
    columns : list of int
        Of the standard deviations among the unknowns.
    mean : (s,) array
    root : (s, s) array
        Cholesky factor of the scale matrix.
    """

    columns: list[int]
    mean: Array
    root: Array

    def draw(self, count: int, random: np.random.Generator) -> Array:
        """Return draws (count, s)."""
        freedom = _SETTINGS.freedom
        normal = random.standard_normal((count, len(self.mean))) @ self.root.T
        drawn = self.mean + normal / np.sqrt(random.chisquare(freedom, (count, 1)) / freedom)
        return np.clip(drawn, -Z_LIMIT, Z_LIMIT)

    def log_ratio(self, z: Array) -> Array:
        """Return the logarithm (n,) of the density of draws (n, s) over that of standard normal ones."""
        if not self.columns:
            return np.zeros(len(z))
        shape = self.root @ self.root.T
        drawn = np.atleast_1d(scipy.stats.multivariate_t(self.mean, shape, _SETTINGS.freedom).logpdf(z))
        return np.asarray(drawn - np.sum(scipy.stats.norm.logpdf(z), axis=1))

    @staticmethod
    def near(
        residuals: SeriesResiduals, mode: Array, random: np.random.Generator, before: ScatterProposal | None = None
    ) -> ScatterProposal:
        """Return the distribution that resembles the marginal posterior, by Laplace approximations of the others.

        Parameters
        ----------
        residuals : SeriesResiduals
        mode : (d,) array
            Where the searches for the modes at given standard deviations begin.
        random : numpy.random.Generator
        before : ScatterProposal, optional
            That of similar residuals, from which one round leads to the new one.
        """
        columns = residuals.unknowns.scatter_columns
        size = len(columns)
        proposal = before or ScatterProposal(columns, mode[columns], _SETTINGS.spread * np.eye(size))
        if not columns:
            return proposal
        for _ in range(_SETTINGS.rounds if before is None else 1):
            drawn = proposal.draw(_SETTINGS.points * size, random)
            points = conditional_modes(residuals, mode, columns, drawn)
            matrix, _ = normal_equations(residuals, points, held=columns)
            log_weight = points.log_posterior - matrix.root().log_determinant() - proposal.log_ratio(drawn)
            log_weight += np.sum(drawn**2, axis=1) / 2.0  # the ratio is to their prior, which the posterior contains
            weight = np.exp(log_weight - log_weight.max())
            weight /= weight.sum()
            mean = weight @ drawn
            scale = (drawn - mean).T @ (weight[:, np.newaxis] * (drawn - mean)) * _SETTINGS.widened**2
            proposal = ScatterProposal(
                columns, mean, np.linalg.cholesky(scale + _SETTINGS.least_spread**2 * np.eye(size))
            )
        return proposal


def conditional_modes(residuals: SeriesResiduals, mode: Array, columns: list[int], drawn: Array) -> LinearisedPoints:
    """Return the modes at given values (n, s) of the standard deviations, near a mode (d,).

    The searches begin where the values of the tests are those of the mode: deviations go with the inverse of their
    standard deviation.
    """
    unknowns, start = residuals.unknowns, np.tile(mode, (len(drawn), 1))
    start[:, columns] = drawn
    for column in columns:
        definition, own = unknowns.shared[column].definition, unknowns.deviation_columns(column)
        size = definition.from_unit(unit_from_normal(start[:, column]))
        start[:, own] *= (definition.from_unit(unit_from_normal(mode[column])) / size)[:, np.newaxis]
    return minimise(residuals, np.clip(start, -Z_LIMIT, Z_LIMIT), held=columns)
