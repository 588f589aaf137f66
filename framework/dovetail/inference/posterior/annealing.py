"""Annealing: draws of the prior that become samples of the posterior while the weight of the measurement grows to 1.

Searches near modes find what is near modes. Where a measurement leaves much open, or its model is wrong, most of a
posterior can lie elsewhere: wide regions in which each point is less likely than a mode. Annealed points come from all
of the prior. They miss the narrow valleys of a measurement that says much, of which searches find more. Both estimate
the marginal likelihood, and what misses a part of the posterior usually finds the lower one.

References
----------
P. Del Moral, A. Doucet, A. Jasra, Sequential Monte Carlo samplers, Journal of the Royal Statistical Society B 68 (2006)
411-436.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.posterior.likelihood import squared_norms
from dovetail.inference.posterior.metropolis import Chains
from dovetail.inference.posterior.tangent_steps import Density
from dovetail.inference.posterior.weights import (
    drawn_by_weight,
    effective_sample_size,
    from_logarithms,
    largest_factor,
)
from dovetail.interfaces import NO_LIMIT, TimeLimit
from dovetail.meanwhile import meanwhile, shared_numbers
from dovetail.parallel import cores


@dataclass(frozen=True)
class Settings:
    """How points are annealed."""

    least_points: int = 400
    """Smallest number of points; there are as many as samples are wanted if these are more."""
    effective: float = 0.6
    """Effective points over their number after each growth of the weight."""
    steps: int = 20
    """Difference steps after each. Of five posteriors (a measured end mill, three wrong models of one, and a random
    structure), the logarithms of the marginal likelihood by four seeds have standard deviations of 0.3 to 2.7, half a
    unit in the median; with 10 steps, 0.2 to 4.4 and 1.6."""
    most_growths: int = 60
    """Largest number of times that the weight grows: posteriors that need more are too narrow for so few points."""
    negligible: float = 3.0
    """Logarithm of the ratio of marginal likelihoods beyond which the lower one has missed nearly all."""


_SETTINGS = Settings()
_NONE = -1e100
"""Logarithm of a likelihood of 0."""


@dataclass(frozen=True, eq=False)
class AnnealedPoints:
    """Samples of a posterior, all of the same weight.

    Parameters
    ----------
    z : (n, d) array
    log_evidence : float
        Logarithm of their estimate of the marginal likelihood.
    effective : float
        Effective number of the draws of the prior from which they descend.
    """

    z: NDArray[np.float64]
    log_evidence: float
    effective: float

    @property
    def log_weight(self) -> NDArray[np.float64]:
        """(n,) logarithms of weights that add up to the marginal likelihood."""
        return np.full(len(self.z), self.log_evidence - np.log(len(self.z)))


class Annealing:
    """Annealing that can begin in another process before it is known whether it is needed.

    It is a context, at whose end that process ends too.

    Parameters
    ----------
    density, size, random, wanted, limit
        As in `anneal`.
    """

    def __init__(
        self,
        density: Density,
        size: int,
        random: np.random.Generator,
        wanted: int,
        limit: TimeLimit = NO_LIMIT,
    ) -> None:
        self._known = shared_numbers(1)
        self._known[0] = -np.inf
        self._work: Callable[[], AnnealedPoints | None]
        self._work = partial(anneal, density, size, lambda: self._known[0], random, wanted=wanted, limit=limit)
        self._limit, self._stack = limit, ExitStack()
        self._result: Callable[[], AnnealedPoints | None] = self._work

    def __enter__(self) -> Annealing:
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.close()

    def begin(self) -> None:
        """Begin now, if there is a core for it."""
        if self._result is self._work and cores() > 1:
            self._result = self._stack.enter_context(meanwhile(self._work, lambda: self._limit.was_stopped))

    def points(self, known: float) -> AnnealedPoints | None:
        """Return the points, given the logarithm of the marginal likelihood of what is known; None as `anneal`."""
        self._known[0] = known
        annealed = self._result()
        return None if annealed is None or _misses_nearly_all(annealed.log_evidence, known) else annealed


def anneal(
    density: Density,
    size: int,
    known: Callable[[], float],
    random: np.random.Generator,
    *,
    wanted: int = _SETTINGS.least_points,
    limit: TimeLimit = NO_LIMIT,
) -> AnnealedPoints | None:
    """Anneal draws of the prior.

    Parameters
    ----------
    density : Density
        Of a posterior whose prior is standard normal; the first `size` residuals are those of the prior.
    size : int
        Number d of coordinates.
    known : callable
        Returns the logarithm of the marginal likelihood of samples that are known already.
    random : numpy.random.Generator
    wanted : int
        Number of samples for which they are needed.
    limit : TimeLimit

    Returns
    -------
    AnnealedPoints or None
        None as soon as it is seen that they miss nearly all of what is known: an estimate only falls while the weight
        of the measurement grows. Also if time is over, or the posterior is too narrow.
    """
    count = max(wanted, _SETTINGS.least_points)
    z, origin = random.standard_normal((count, size)), np.arange(count)
    log_likelihood = _log_likelihood(density.log(z), z)
    weight = log_evidence = 0.0
    for _ in range(_SETTINGS.most_growths):
        growth = largest_factor(log_likelihood, _SETTINGS.effective * count, 1.0 - weight)
        weight = 1.0 if growth == 1.0 - weight else weight + growth
        log_evidence += float(np.logaddexp.reduce(growth * log_likelihood)) - np.log(count)
        if limit.is_over or _misses_nearly_all(log_evidence, known()):
            return None
        chosen = drawn_by_weight(from_logarithms(growth * log_likelihood), count, random)
        origin = origin[chosen]
        chains = Chains(_tempered(density, weight), z[chosen], random)
        chains.difference_steps(_SETTINGS.steps, some=True)
        if weight == 1.0:
            descendants = np.unique(origin, return_counts=True)[1]
            return AnnealedPoints(chains.z, log_evidence, effective_sample_size(np.log(descendants)))
        z, log_likelihood = chains.z, _log_likelihood(chains.log_posterior, chains.z) / weight
    return None


def _misses_nearly_all(log_evidence: float, known: float) -> bool:
    return log_evidence < known - _SETTINGS.negligible


def _log_likelihood(log_posterior: NDArray[np.float64], z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the logarithms (n,) of the likelihood, finite where the model has no finite FRF too."""
    return np.asarray(np.nan_to_num(log_posterior + squared_norms(z) / 2.0, nan=_NONE, neginf=_NONE))


def _tempered(density: Density, weight: float) -> Density:
    """Return the density with a weight of the measurement, less than 1."""

    def residuals(z: NDArray[np.float64]) -> NDArray[np.float64]:
        every = density.residuals(z)
        every[:, z.shape[1] :] *= np.sqrt(weight)
        return every

    return replace(density, residuals=residuals)
