"""The marginal likelihood of a model, from the weights of samples whose density is known."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

FEWEST_EFFECTIVE = 30.0
"""Effective sample size of the weights below which the marginal likelihood is not given: single weights dominate it,
and its standard error, sqrt(1/30) = 0.18 for weights without long tails, means little."""

RISK = 0.01
"""Probability that the marginal likelihood is below `least_log_evidence`."""


@dataclass(frozen=True)
class Evidence:
    """The marginal likelihood of a model: the density of the measured values, averaged over the prior.

    Parameters
    ----------
    log : float
        Its logarithm.
    error : float
        Standard error of the logarithm.
    """

    log: float
    error: float

    @staticmethod
    def from_weights(log_weight: NDArray[np.float64], searches: int) -> Evidence | None:
        """Return the evidence from the weights of independent samples; None if too few of them count.

        Parameters
        ----------
        log_weight : (n,) array
            Logarithm of prior times likelihood over the density of the samples, of the searches that converged.
        searches : int
            Number of all searches; those that did not converge count 0.
        """
        if not len(log_weight):
            return None
        weight = np.exp(log_weight - log_weight.max())
        effective = float(weight.sum() ** 2 / np.sum(weight**2))
        if effective < FEWEST_EFFECTIVE:
            return None
        mean = float(np.log(weight.sum() / searches) + log_weight.max())
        return Evidence(mean, float(np.sqrt(max(1.0 / effective - 1.0 / searches, 0.0))))

    def plus(self, constant: float) -> Evidence:
        """Return the evidence with a constant of the likelihood added to its logarithm."""
        return replace(self, log=self.log + constant)


def least_log_evidence(log_weight: NDArray[np.float64], searches: int) -> float:
    """Return a lower bound of the logarithm of the marginal likelihood, however few weights count.

    The weights' mean is positive, and its expectation is the marginal likelihood. By Markov's inequality it exceeds
    this by a factor of ``1 / RISK`` with a probability of at most `RISK`. The bound is -inf if no search converged.
    """
    if not len(log_weight):
        return -np.inf
    return float(np.logaddexp.reduce(log_weight) - np.log(searches) + np.log(RISK))
