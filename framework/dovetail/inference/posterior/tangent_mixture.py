"""Samples of a posterior from tangent maps that are anchored at many of its points.

The ends of searches by one tangent map have the density of that map. In a curved valley it falls far below the
posterior's away from the anchor, and there single samples outweigh all others. Searches by the maps of many anchors,
spread over the valley, have the density of a mixture of the maps, which is never far below. The first anchors are the
modes. If the weights of their samples are uneven, the next anchors are drawn from all samples, by weight.

References
----------
O. Cappe, A. Guillin, J. M. Marin, C. P. Robert, Population Monte Carlo, J. Comput. Graph. Stat. 13 (2004) 907-929.
A. Owen, Y. Zhou, Safe and effective importance sampling, J. Am. Stat. Assoc. 95 (2000) 135-143.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.posterior.likelihood import PosteriorResiduals, squared_norms
from dovetail.inference.posterior.randomize_then_optimize import LinearisedPoints, TangentMap, nearest_rows
from dovetail.inference.posterior.separate_modes import nearest_modes
from dovetail.inference.posterior.weights import (
    are_complete,
    are_even,
    clipped,
    drawn_by_weight,
    effective_sample_size,
    from_logarithms,
    tempered,
)
from dovetail.interfaces import NO_LIMIT, Progress, TimeLimit, silent


@dataclass(frozen=True)
class Settings:
    """How many anchors and searches there are."""

    anchors: int = 30
    """Points drawn as anchors of each batch of searches; some are drawn more than once."""
    iterations: int = 100
    """Largest number of iterations of a search. In 20 cases of the collet (seed 3 of a calibration), whose valleys are
    narrow, half of the searches need 20 and 1 % more than 50; of random structures, 8 and 30. Where most searches have
    too few, a part of the posterior is missing."""
    least_ended: float = 0.9
    """Searches that must end somewhere, or else further anchors are drawn."""
    wanted: float = 0.5
    """Effective samples over their number at which searches end."""
    most_searches: int = 3
    """Largest number of searches over that of samples."""
    hopeless: float = 0.2
    """Effective samples over the number of searches below which further searches will hardly make the weights even. Of
    14 random structures and 4 shipped measurements, three posteriors fall below it after the first 400 searches, and
    only these stay uneven; of two models of a measured end mill, which both do, one falls below it then."""
    negligible: float = 12.0
    """Difference of log densities, without determinants, below that of the best map from which a map does not count."""


_SETTINGS = Settings()


class _Maps(NamedTuple):
    """Tangent maps of some anchors, with the mode, the sign of the determinant and the number of searches of each."""

    maps: TangentMap
    modes: NDArray[np.intp]
    orientation: NDArray[np.float64]
    searches: NDArray[np.intp]

    def log_density(self, points: LinearisedPoints, modes: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return the log density (n,) of the ends of all searches, times their number, at points near some modes.

        A map has no density about other modes than its own, nor where its determinant has the other sign: it has
        folded over in between.
        """
        components = self.maps.all_components(points.residuals)
        log_density = np.log(self.searches) - np.einsum("nkd,nkd->nk", components, components) / 2.0
        log_density[modes[:, np.newaxis] != self.modes] = -np.inf
        near = log_density > log_density.max(axis=1, keepdims=True) - _SETTINGS.negligible
        for number, rows in enumerate(near.T):
            some = points.at_rows(np.flatnonzero(rows))
            sign, log_determinant = self.maps.at_rows(np.array([number])).signed_log_determinant(some)
            log_density[rows, number] += np.where(sign == self.orientation[number], log_determinant, -np.inf)
        return np.asarray(np.logaddexp.reduce(np.where(near, log_density, -np.inf), axis=1))


class TangentMixture:
    """Searches for samples of one posterior.

    Parameters
    ----------
    posterior : PosteriorResiduals
    modes : LinearisedPoints
        Its separate modes, the first anchors.
    known : (n, d) array
        Other points from which searches can begin.
    random : numpy.random.Generator
    limit : TimeLimit
        A batch that it ends is no part of the samples.

    Attributes
    ----------
    posterior : PosteriorResiduals
    modes : LinearisedPoints
    ends : LinearisedPoints
        Of the searches that converged.
    log_density : (n,) array
        Of these ends as samples of the mixture of all maps.
    begun : int
        Number of searches, those that did not converge included.
    """

    def __init__(
        self,
        posterior: PosteriorResiduals,
        modes: LinearisedPoints,
        known: NDArray[np.float64],
        random: np.random.Generator,
        limit: TimeLimit = NO_LIMIT,
    ) -> None:
        self.posterior, self.modes, self._random, self._limit = posterior, modes, random, limit
        self._anchors, self._maps = modes, list[_Maps]()
        self._known = known, posterior.residuals(known)
        self.ends, self._log_sum, self.begun = modes.at_rows(np.arange(0)), np.empty(0), 0

    @property
    def log_density(self) -> NDArray[np.float64]:
        """(n,) logarithms of the density of the ends: those of all searches with the mixture of all maps."""
        return np.asarray(self._log_sum - np.log(max(self.begun, 1)))

    @property
    def log_weight(self) -> NDArray[np.float64]:
        """(n,) logarithms of the weights of the ends as samples of the posterior."""
        return np.asarray(self.ends.log_posterior - self.log_density)

    def log_weight_at(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the logarithms of the weights (n,) that ends of searches at points z (n, d) would have."""
        points = LinearisedPoints.at(self.posterior, z)
        modes = nearest_modes(self.modes, z)
        log_density = np.logaddexp.reduce([each.log_density(points, modes) for each in self._maps])
        return np.asarray(points.log_posterior - log_density + np.log(max(self.begun, 1)))

    def sample(
        self, count: int, batch: int, progress: Progress = silent, on_uneven: Callable[[], object] = lambda: None
    ) -> int:
        """Search by maps anchored at the modes, then by others while the weights are uneven.

        It goes on from what `search` has found.

        Parameters
        ----------
        count : int
            Number of searches, more if the weights are uneven but a few more would do.
        batch : int
            Number of searches at a time.
        progress : Progress
        on_uneven : callable
            Called before further searches where these will hardly make the weights even.

        Returns
        -------
        int
            Number of searches that the time limit left out.
        """
        while not (self._is_enough(count) or self.is_one_valley):
            progress("samples", min(self.begun, count), count)
            wanted = count - self.begun if self.begun < count else count
            anchors = self._anchors
            if self._is_uneven:
                if effective_sample_size(self.log_weight) < _SETTINGS.hopeless * self.begun:
                    on_uneven()
                anchors = self.next_anchors()
            if not self.search(anchors, min(batch, wanted)):
                return max(count - self.begun, 0)
        progress("samples", count, count)
        return 0

    def _is_enough(self, count: int) -> bool:
        """Return whether the samples count for enough, or the largest number of searches would not make them do so.

        Single large weights are no sign of that, since the next anchors are drawn where they are, nor are those of the
        modes' maps alone.
        """
        most, wanted, weights = _SETTINGS.most_searches * count, _SETTINGS.wanted * count, self.log_weight
        if self.begun < count:
            return False
        hopeless = len(self._maps) > 1 and effective_sample_size(clipped(weights)) * most < wanted * self.begun
        return hopeless or self.begun >= most or effective_sample_size(weights) >= wanted

    def search(self, anchors: LinearisedPoints, number: int) -> bool:
        """Begin a number of searches by the maps of some anchors; return False if the time limit ended them."""
        self._anchors, searches = anchors, np.bincount(np.arange(number) % len(anchors.z))
        anchors = anchors.at_rows(np.arange(len(searches)))
        maps, anchored = self._maps_at(anchors, searches), np.repeat(np.arange(len(searches)), searches)
        self._learn(anchors)
        target = self._random.standard_normal((number, anchors.z.shape[1]))
        nearest = LinearisedPoints.at(self.posterior, self._nearest(maps, anchored, target))

        def are_samples(
            rows: NDArray[np.intp], converged: NDArray[np.bool_], ends: LinearisedPoints
        ) -> NDArray[np.bool_]:
            """Return which ends are where their map has not folded over, and about the mode of its anchor."""
            sign, _ = maps.maps.at_rows(anchored[rows]).signed_log_determinant(ends)
            about_mode = nearest_modes(self.modes, ends.z) == maps.modes[anchored[rows]]
            return np.asarray(converged & (sign == maps.orientation[anchored[rows]]) & about_mode)

        ends, accepted = maps.maps.at_rows(anchored).solve(
            target,
            nearest,
            _SETTINGS.iterations,
            self._limit,
            accepts=are_samples,
            again=lambda rows: anchors.at_rows(anchored[rows]),  # the path from the anchor may lead there
        )
        if self._limit.is_over:
            return False
        self._add(maps, ends.at_rows(np.flatnonzero(accepted)))
        self.begun += number
        return True

    def _maps_at(self, anchors: LinearisedPoints, searches: NDArray[np.intp]) -> _Maps:
        maps = TangentMap(self.posterior, anchors)
        return _Maps(maps, nearest_modes(self.modes, anchors.z), maps.signed_log_determinant(anchors)[0], searches)

    @property
    def _is_uneven(self) -> bool:
        """Whether the weights of the ends so far are uneven, or the ends lack a part of the posterior."""
        return self.begun > 0 and (self.misses_a_part or not are_even(self.log_weight, self.begun))

    @property
    def is_one_valley(self) -> bool:
        """Whether searches about several modes mostly end about others, since the modes lie along one valley."""
        return len(self.modes.z) > 1 and not self.is_complete

    @property
    def misses_a_part(self) -> bool:
        """Whether many searches find no end: beyond the places where maps fold over, there may be more."""
        return len(self.ends.z) < _SETTINGS.least_ended * self.begun

    @property
    def is_complete(self) -> bool:
        """Whether so many searches end that the samples hardly lack a part of the posterior."""
        return are_complete(len(self.ends.z), self.begun)

    def next_anchors(self) -> LinearisedPoints:
        """Draw anchors by weight: ends of searches or, while there are few, other points that are known."""
        points, log_weight = self.ends, self.log_weight
        if len(points.z) < _SETTINGS.anchors:
            z, residuals = self._known
            points, log_weight = LinearisedPoints.at(self.posterior, z), -squared_norms(residuals) / 2.0
        chosen = drawn_by_weight(from_logarithms(tempered(log_weight)), _SETTINGS.anchors, self._random)
        return points.at_rows(np.unique(chosen))

    def _add(self, maps: _Maps, ends: LinearisedPoints) -> None:
        """Add the ends of searches by new maps, with the density of all maps at all ends."""
        self._maps.append(maps)
        before, modes = nearest_modes(self.modes, self.ends.z), nearest_modes(self.modes, ends.z)
        at_ends = np.logaddexp.reduce([each.log_density(ends, modes) for each in self._maps])
        self._log_sum = np.concatenate([np.logaddexp(self._log_sum, maps.log_density(self.ends, before)), at_ends])
        self.ends = LinearisedPoints.joined([self.ends, ends])
        self._learn(ends)

    def _learn(self, points: LinearisedPoints) -> None:
        """Add points from which searches can begin."""
        z, residuals = self._known
        self._known = np.concatenate([z, points.z]), np.concatenate([residuals, points.residuals])

    def _nearest(self, maps: _Maps, anchored: NDArray[np.intp], target: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return for each target (n, d) the known point about the anchor's mode whose components are nearest."""
        z, residuals = self._known
        components, modes = maps.maps.all_components(residuals), nearest_modes(self.modes, z)
        starts = np.empty_like(target)
        for number, mode in enumerate(maps.modes):
            known, searches = np.flatnonzero(modes == mode), anchored == number
            starts[searches] = z[known[nearest_rows(components[known, number], target[searches])]]
        return starts
