"""Separate modes of a posterior, by the Gaussian about each, and the searches for samples about them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.posterior.likelihood import PosteriorResiduals
from dovetail.inference.posterior.randomize_then_optimize import LinearisedPoints, TangentMap
from dovetail.interfaces import NO_LIMIT, TimeLimit

_LEAST_MASS = 1e-3
"""Probability about a mode, over the largest about any, below which it is left out."""
_APART = 3.0
"""Standard deviations from which two modes are separate."""
_ITERATIONS = 60
"""Largest number of iterations of the search for one sample. Of 100 searches of the collet 4 to 13 are still on their
way after 40, and 3 to 9 after 200. Of some random structures most searches need more than 30."""


def separate_modes(modes: LinearisedPoints) -> LinearisedPoints:
    """Return the modes that are not within one another's Gaussians, except those of hardly any probability."""
    precision = modes.jacobian @ modes.jacobian.transpose(0, 2, 1)
    log_mass = modes.log_posterior - np.linalg.slogdet(precision)[1] / 2.0
    likely = log_mass > log_mass.max(initial=-np.inf) + np.log(_LEAST_MASS)
    order = [number for number in np.argsort(-log_mass).tolist() if likely[number]]
    return modes.at_rows(np.array(distinct(modes.z, precision, order, _APART), dtype=np.intp))


def distinct(
    position: NDArray[np.float64], curvature: NDArray[np.float64], order: Sequence[int], deviations: float
) -> list[int]:
    """Choose points in a given order, without those near a point that was chosen before.

    Parameters
    ----------
    position : (n, p) array
    curvature : (n, p, p) array
        Inverse covariance of the Gaussian about each point.
    order : sequence of int
    deviations : float
        Smallest distance from a chosen point, in standard deviations of its Gaussian.
    """
    chosen: list[int] = []
    for number in order:
        steps = position[chosen] - position[number]
        squares = np.einsum("kp,kpq,kq->k", steps, curvature[chosen], steps)
        if (squares > deviations**2).all():
            chosen.append(number)
    return chosen


def _distances(modes: LinearisedPoints, z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the squared distances (n, n_modes) of points from modes, in standard deviations of each."""
    moved = np.einsum("pkd,kdm->pkm", z[:, np.newaxis] - modes.z, modes.jacobian)
    return np.asarray(np.einsum("pkm,pkm->pk", moved, moved))


def nearest_modes(modes: LinearisedPoints, z: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the numbers (n,) of the modes to which points are nearest."""
    return np.asarray(np.argmin(_distances(modes, z), axis=1))


def shares(posterior: PosteriorResiduals, modes: LinearisedPoints, count: int) -> Iterator[tuple[int, int, TangentMap]]:
    """Yield the number of each mode, how many of the searches begin about it, and the tangent map there."""
    for number, share in enumerate(np.bincount(np.arange(count) % len(modes.z)).tolist()):
        yield number, share, TangentMap(posterior, modes.at_rows(np.array([number])))


def ends_about(
    modes: LinearisedPoints,
    number: int,
    tangent_map: TangentMap,
    target: NDArray[np.float64],
    starts: LinearisedPoints,
    limit: TimeLimit = NO_LIMIT,
) -> tuple[LinearisedPoints, NDArray[np.float64]]:
    """Return the ends of searches from one of several modes, those nearest to it, and their log densities."""
    ends, converged = tangent_map.solve(target, starts, _ITERATIONS, limit)
    ends = ends.at_rows(np.flatnonzero(converged & (nearest_modes(modes, ends.z) == number)))
    return ends, tangent_map.log_density(ends)


def mixed(count: int, modes: LinearisedPoints, random: np.random.Generator) -> NDArray[np.intp]:
    """Return an order of samples in which each half has those of all modes."""
    return random.permutation(count) if len(modes.z) > 1 else np.arange(count)
