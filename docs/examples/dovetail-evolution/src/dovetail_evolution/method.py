"""The method 'evolution': a search all over the ranges that needs no derivatives, by scipy."""

from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.optimize import differential_evolution

from dovetail import ComponentConfig, Estimate, IdentificationMethod, silent


class Evolution(IdentificationMethod):
    """Differential evolution of the weighted sum of squares; intervals from the derivatives at the best fit."""

    name = "evolution"
    summary = "Differential evolution over the ranges (scipy)"
    references = ("Storn & Price, J. Global Optimization 11 (1997) 341",)

    class Config(ComponentConfig):
        """How it searches.

        Attributes
        ----------
        population : int
            Candidates for each parameter.
        generations : int
            Most generations.
        samples : int
            Samples of the parameters, for their intervals.
        """

        population: Annotated[int, Field(ge=4, le=1000)] = 15
        generations: Annotated[int, Field(ge=1, le=10_000)] = 200
        samples: Annotated[int, Field(ge=50, le=100_000)] = 500

    def identify(self, problem, *, seed, progress=silent):
        """Minimise the sum of |difference|^2 over the random error, over all lines of all measurements."""
        weight = 1.0 / np.sqrt(problem.variance)

        def cost(fractions):
            """Return the cost (n,) of candidates (n_params, n), as scipy's vectorised search hands them over."""
            difference = problem.difference(to_si(problem.parameters, fractions.T))
            return np.sum(np.abs(difference * weight) ** 2, axis=1)

        generation = iter(range(1, self.config.generations + 1))

        def count(*_, **__):
            progress("evolution", next(generation, self.config.generations), self.config.generations)

        found = differential_evolution(
            cost,
            [(0.0, 1.0)] * len(problem.parameters),
            popsize=self.config.population,
            maxiter=self.config.generations,
            rng=np.random.default_rng(seed),
            vectorized=True,
            updating="deferred",
            polish=False,
            tol=1e-8,
            callback=count,
        )
        samples = self.scatter(problem, found.x, np.random.default_rng([seed, 1]))
        return Estimate(to_si(problem.parameters, found.x[None])[0], to_si(problem.parameters, samples))

    def scatter(self, problem, best, random):
        """Return samples (n, n_params), in fractions of the ranges, of a Gaussian with the curvature at the best fit.

        The ranges count as priors of the same width, so that a parameter which the measurement does not determine
        keeps its range.
        """
        theta = to_si(problem.parameters, best[None])
        _, jacobian = problem.frf_jacobian(theta)
        slopes = np.array([p.slope(theta[:, column])[0] for column, p in enumerate(problem.parameters)])
        weighted = jacobian[0] * slopes * np.sqrt(2.0 / problem.variance)[:, None]
        information = np.real(weighted.conj().T @ weighted) + 12.0 * np.eye(len(best))
        drawn = random.multivariate_normal(best, np.linalg.inv(information), size=self.config.samples)
        return np.clip(drawn, 0.0, 1.0)


def to_si(parameters, fractions):
    """Return parameters (n, n_params) [SI] from fractions of their ranges."""
    columns = [p.from_unit(fractions[:, column]) for column, p in enumerate(parameters)]
    limits = [(p.lower, p.upper) for p in parameters]
    return np.stack([np.clip(values, *ends) for values, ends in zip(columns, limits, strict=True)], axis=1)
