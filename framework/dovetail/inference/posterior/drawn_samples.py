"""Samples of a posterior with their weights, and those of a posterior of few residuals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.posterior.evidence import Evidence, least_log_evidence
from dovetail.inference.posterior.likelihood import PosteriorResiduals
from dovetail.inference.posterior.metropolis import decorrelate
from dovetail.inference.posterior.randomize_then_optimize import LinearisedPoints
from dovetail.inference.posterior.separate_modes import separate_modes
from dovetail.inference.posterior.tangent_mixture import TangentMixture
from dovetail.inference.posterior.tangent_steps import Density
from dovetail.inference.posterior.weights import (
    are_even,
    clipped,
    drawn_by_weight,
    effective_after_moves,
    enough_correlation,
    from_logarithms,
)


@dataclass(frozen=True, eq=False)
class DrawnSamples:
    """Samples z (n, p) with their weights.

    Parameters
    ----------
    z : (n, p) array
    log_weight : (n,) array
    log_likelihood : (n,) array or None
        By all lines, if it was computed.
    evidence : Evidence or None
        Up to a constant of the likelihood; of the searches for samples.
    searches, converged : int
        Number of searches for samples that came to an end, and of those that reached it.
    effective : float
        Number of independent samples that they are worth, but for their weights.
    least_log_evidence : float
        Lower bound of the logarithm of the marginal likelihood, up to the same constant.
    """

    z: NDArray[np.float64]
    log_weight: NDArray[np.float64]
    log_likelihood: NDArray[np.float64] | None
    evidence: Evidence | None
    searches: int
    converged: int
    effective: float
    least_log_evidence: float


def draw_about_modes(posterior: PosteriorResiduals, modes: NDArray[np.float64], count: int, seed: int) -> DrawnSamples:
    """Return samples of a posterior with few residuals.

    Parameters
    ----------
    posterior : PosteriorResiduals
    modes : (n_modes, p) array
        Starts of the searches, the highest mode first.
    count, seed
        As in `sample_posterior`.
    """
    random, separate = np.random.default_rng([seed, 8]), separate_modes(LinearisedPoints.at(posterior, modes))
    mixture = TangentMixture(posterior, separate, separate.z, random)
    mixture.sample(count, count)
    points, log_weight = mixture.ends, mixture.log_weight
    evidence = Evidence.from_weights(log_weight, mixture.begun)
    least, converged = least_log_evidence(log_weight, mixture.begun), len(log_weight)
    if not converged:
        points, log_weight = separate, separate.log_posterior
    order = random.permutation(len(log_weight))
    points, log_weight = points.at_rows(order), log_weight[order]
    if mixture.is_complete and are_even(log_weight, count):
        return DrawnSamples(points.z, log_weight, None, evidence, mixture.begun, converged, np.inf, least)
    chosen = drawn_by_weight(from_logarithms(clipped(log_weight)), count, random)
    enough = enough_correlation(log_weight, count, complete=mixture.is_complete)
    moved = decorrelate(Density.of(posterior), points.at_rows(chosen), random, correlation=enough)
    effective = effective_after_moves(clipped(log_weight), count, moved.correlation)
    return DrawnSamples(moved.z, np.zeros(count), None, evidence, mixture.begun, converged, effective, least)
