"""Expected posterior variance of a future measurement, with a uniform prior over the ranges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_NOISE_DRAWS = 2
"""Number of measurements that are drawn for each parameter vector."""
_STEPS, _FORGOTTEN = 800, 100
"""Steps of the random walk through each posterior, and those before them that do not count (burn-in)."""
_LEAST = 0.01
"""Smallest information in any direction; it is negligible, since the range alone has 12."""


@dataclass(frozen=True, eq=False)
class RemainingUncertainty:
    """What remains unknown after a measurement, on average, in fractions of the ranges.

    Parameters
    ----------
    variance : (..., p) array
        Mean posterior variance.
    deviation : (..., p) array
        Mean posterior standard deviation, to which an interval's width is proportional.
    """

    variance: NDArray[np.float64]
    deviation: NDArray[np.float64]


def remaining_uncertainty(
    information: NDArray[np.float64], truth: NDArray[np.float64], seed: int
) -> RemainingUncertainty:
    """Return the expected posterior variance of measurements whose Fisher information is known.

    Parameters
    ----------
    information : (..., n, p, p) array
        Fisher information at n parameter vectors, in fractions of the ranges.
    truth : (n, p) array
        The parameter vectors, in fractions of the ranges.
    seed : int

    Returns
    -------
    RemainingUncertainty
        Means over the n vectors and over the noise.

    Notes
    -----
    The measurement is linearised around the truth, so that the posterior is a normal distribution truncated at the ends
    of the ranges. Where parameters trade with each other, it is the truncation that limits them, which a normal prior
    of the same variance would not represent. All posteriors are sampled together by elliptical slice sampling
    (A. Gessner, O. Kanjilal, P. Hennig, Integrals over Gaussians under linear domain constraints, AISTATS 2020).
    """
    random = np.random.default_rng([seed, 4])
    shape, count = information.shape[:-1], truth.shape[-1]
    if not information.size:
        return RemainingUncertainty(np.empty((*shape[:-2], count)), np.empty((*shape[:-2], count)))
    values, vectors = np.linalg.eigh(information.reshape(-1, count, count))
    roots = np.repeat(vectors / np.sqrt(np.maximum(values, _LEAST))[:, np.newaxis, :], _NOISE_DRAWS, axis=0)
    start = np.repeat(np.broadcast_to(truth, shape).reshape(-1, count), _NOISE_DRAWS, axis=0)
    walk = _Walk(roots, start, random)
    for _ in range(_FORGOTTEN):
        walk.step()
    sums, squares = np.zeros_like(start), np.zeros_like(start)
    for _ in range(_STEPS):
        place = walk.step() - start
        sums += place
        squares += place**2
    variance = np.maximum(squares / _STEPS - (sums / _STEPS) ** 2, 0.0).reshape(*shape[:-1], _NOISE_DRAWS, count)
    return RemainingUncertainty(variance.mean(axis=(-3, -2)), np.sqrt(variance).mean(axis=(-3, -2)))


class _Walk:
    """Random walks through normal distributions that are truncated at the faces of the unit cube."""

    def __init__(self, roots: NDArray[np.float64], truth: NDArray[np.float64], random: np.random.Generator) -> None:
        self._roots = roots
        self._random = random
        self._centre = truth + self._drawn()
        self._place = truth.copy()

    def step(self) -> NDArray[np.float64]:
        """Take one step of each walk and return the positions (n, p)."""
        offset, other = self._place - self._centre, self._drawn()
        angle = self._allowed_angle(np.hypot(offset, other), np.arctan2(other, offset))[:, np.newaxis]
        ahead = self._centre + offset * np.cos(angle) + other * np.sin(angle)
        self._place = np.clip(ahead, 0.0, 1.0)
        return self._place

    def _drawn(self) -> NDArray[np.float64]:
        normal = self._random.standard_normal(self._roots.shape[:-1])
        return np.asarray(np.matmul(self._roots, normal[:, :, np.newaxis])[:, :, 0])

    def _allowed_angle(self, radius: NDArray[np.float64], phase: NDArray[np.float64]) -> NDArray[np.float64]:
        """Draw an angle of each ellipse, centre + radius cos(angle - phase), from where it is inside the cube."""
        radius = np.maximum(radius, np.finfo(float).tiny)
        above = np.arccos(np.clip((1.0 - self._centre) / radius, -1.0, 1.0))
        below = np.arccos(np.clip(-self._centre / radius, -1.0, 1.0))
        first = np.mod(np.concatenate([phase - above, phase + below], axis=1), 2.0 * np.pi)
        last = first + 2.0 * np.concatenate([above, np.pi - below], axis=1)  # angle 0 is inside, so none wraps around
        order = np.argsort(first, axis=1)
        first = np.take_along_axis(first, order, axis=1)
        last = np.maximum.accumulate(np.take_along_axis(last, order, axis=1), axis=1)
        rows = np.arange(len(first))
        begins = np.insert(last, 0, 0.0, axis=1)
        lengths = np.maximum(np.insert(first, first.shape[1], 2.0 * np.pi, axis=1) - begins, 0.0)
        upto = np.cumsum(lengths, axis=1)
        drawn = self._random.random(len(rows)) * upto[:, -1]
        chosen = np.argmax(upto > drawn[:, np.newaxis], axis=1)
        return np.asarray(begins[rows, chosen] + drawn - (upto[rows, chosen] - lengths[rows, chosen]))
