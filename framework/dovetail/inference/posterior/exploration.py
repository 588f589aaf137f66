"""Exploration of the region of a posterior, with the misfit reduced to the few lines that this region needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.posterior.likelihood import (
    PRIOR_PRECISION,
    Likelihood,
    PosteriorResiduals,
    ReducedResiduals,
    squared_norms,
    unit_from_normal,
)
from dovetail.inference.posterior.mode_search import maximise_posterior
from dovetail.inference.posterior.randomize_then_optimize import LinearisedPoints, TangentMap, nearest_rows
from dovetail.inference.posterior.separate_modes import separate_modes
from dovetail.interfaces import Progress


@dataclass(frozen=True)
class Settings:
    """How the region is explored."""

    pilots: int = 48
    """Number of searches in each round of exploration."""
    pilot_iterations: int = 30
    """Most steps of each."""
    scatter: float = 1.0
    """Distance of the first points from a mode, in standard deviations by the fit's information. Of 14 random
    structures (seed 515151 of the benchmark of genuine measurements), 1 takes an eighth less exploration than 0.3."""
    mode_tolerance: float = 0.1
    """Decrease of the sum of squares in one step at which the search for the mode of a reduced misfit ends."""
    margin: float = 1e-3
    """Distance of these points from the ends of a range, as a fraction of it."""
    rounds: tuple[int, int] = (2, 14)
    """Smallest and largest number of rounds of exploration; they end when the reduced misfit is accurate."""
    reduction_error: float = 0.05
    """Largest accepted difference of chi-squared between the reduced misfit and all lines."""
    checked: int = 64
    """Samples whose likelihood is computed on all lines first: the reduced misfit has to be as accurate at these, in
    the root mean square."""
    near: float = 3.0
    """Decrease of the sum of squares in one step at which the searches end for modes about which to explore."""
    region: float = 200.0
    """Chi-squared above the best one up to which a point is in the region of interest."""
    most_snapshots: int = 600
    """Number of FRFs, the latest ones, from which the misfit is reduced."""
    still: float = 0.1
    """Decrease of chi-squared that the tangent promises below which an end of a search is a mode."""


_SETTINGS = Settings()


class Exploration:
    """The region of one posterior, explored from points near a mode.

    Parameters
    ----------
    likelihood : Likelihood
    starts : (n, p) array
        These points, as normal quantiles of the fractions of the ranges.
    information : (p, p) array
        Fisher information of the fractions at the best fit.
    random : numpy.random.Generator
    progress : Progress

    Attributes
    ----------
    reduced : ReducedResiduals
    posterior : PosteriorResiduals
        Of these.
    mode : (1, p) array
        The highest mode of that posterior that is known.
    points : (n, p) array
        All over the region.
    seconds : float
        Time that the exploration took.
    """

    reduced: ReducedResiduals
    posterior: PosteriorResiduals
    mode: NDArray[np.float64]

    def __init__(
        self,
        likelihood: Likelihood,
        starts: NDArray[np.float64],
        information: NDArray[np.float64],
        random: np.random.Generator,
        progress: Progress,
    ) -> None:
        self.likelihood, self._information = likelihood, information
        self._random, self._progress, self._limit = random, progress, likelihood.model.limit
        self.points = self._modes = starts
        self._origin = likelihood.frf(unit_from_normal(starts[:1]))[0]
        self._snapshots, self.seconds = self._origin[np.newaxis], 0.0
        self._explore(starts)

    def include(self, modes: NDArray[np.float64]) -> None:
        """Explore the region about further modes (n, p) as well, where the reduced misfit is not accurate."""
        points = np.concatenate([modes, self.mode])
        right = self.likelihood.log(unit_from_normal(points))
        on_few, log_prior = self._on_few_lines(points), squared_norms(points) / -2.0
        kept = right + log_prior >= np.max(right + log_prior) - _SETTINGS.region / 2.0
        inaccurate = kept & (2.0 * np.abs(on_few - right) > _SETTINGS.reduction_error)
        self._modes = points[kept]
        self.points = np.concatenate([self.points, self._modes])
        if inaccurate.any():
            self._explore(maximise_posterior(self.likelihood.posterior, points[inaccurate], tolerance=_SETTINGS.near))
        elif np.max((on_few + log_prior)[kept]) > (on_few + log_prior)[-1] + _SETTINGS.still:
            self._adopt(self.reduced)

    def separate_modes(self) -> LinearisedPoints:
        """Return the separate modes of the reduced posterior."""
        others = maximise_posterior(self.posterior, self._modes, tolerance=1e-3)
        ends = LinearisedPoints.at(self.posterior, np.concatenate([self.mode, others]))
        steps = squared_norms(TangentMap(self.posterior, ends).components(ends.residuals))
        return separate_modes(ends.at_rows(np.flatnonzero(steps < _SETTINGS.still)))

    def log_likelihood(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the log-likelihood (n,) at z (n, p), from the few lines if a part of the points shows them to do."""
        exact = self.likelihood.log
        if len(z) <= 2 * _SETTINGS.checked:
            return exact(unit_from_normal(z))
        on_few = self._on_few_lines(z)
        checked = np.linspace(0, len(z) - 1, _SETTINGS.checked).astype(np.intp)
        right = exact(unit_from_normal(z[checked]))
        error = np.sqrt(np.mean((right - on_few[checked]) ** 2))
        if error > _SETTINGS.reduction_error / 2.0:
            return exact(unit_from_normal(z))
        on_few[checked] = right
        return on_few

    def _explore(self, starts: NDArray[np.float64]) -> None:
        """Reduce the misfit to the lines that the region about some points (n, p), and all earlier ones, needs."""
        began, likelihood = self._limit.elapsed, self.likelihood
        frfs, near = self._first_snapshots(unit_from_normal(starts)), slice(None)
        for number in range(1, _SETTINGS.rounds[1] + 1):
            self._progress("exploration", number - 1, _SETTINGS.rounds[1])
            self._snapshots = np.concatenate([self._snapshots, frfs[near]])[-_SETTINGS.most_snapshots :]
            reduced = ReducedResiduals(likelihood, self._snapshots, self._origin)
            self._adopt(reduced)
            target, first = self._starts()
            pilots, _ = self._tangent_map.solve(target, first, _SETTINGS.pilot_iterations, self._limit)
            fraction = unit_from_normal(pilots.z)
            frfs, on_few = likelihood.frf(fraction), reduced.residuals(fraction)
            squares = likelihood.marginalised.squares(likelihood.residual.of(frfs))
            error = np.abs(squared_norms(on_few) + reduced.outside - squares)
            near = squares <= squares.min() + _SETTINGS.region
            self.points = np.concatenate([self.points, pilots.z[near]])
            if number >= _SETTINGS.rounds[0] and error[near].max(initial=0.0) < _SETTINGS.reduction_error:
                break
            if self._limit.is_over:
                break
        self.seconds += self._limit.elapsed - began

    def _first_snapshots(self, modes: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the FRFs at the modes, given as fractions of the ranges, and at points scattered around them."""
        values, vectors = np.linalg.eigh(self._information + PRIOR_PRECISION * np.eye(modes.shape[1]))
        steps = self._random.standard_normal((_SETTINGS.pilots, len(values))) / np.sqrt(
            np.maximum(values, PRIOR_PRECISION)
        )
        scattered = modes[np.arange(len(steps)) % len(modes)] + _SETTINGS.scatter * (steps @ vectors.T)
        points = np.concatenate([modes, scattered])
        return self.likelihood.frf(np.clip(points, _SETTINGS.margin, 1.0 - _SETTINGS.margin))

    def _adopt(self, reduced: ReducedResiduals) -> None:
        """Replace the residuals by these reduced ones, with their mode and the tangent map there."""
        self.reduced, self.posterior = reduced, PosteriorResiduals(reduced)
        residuals = self.posterior.residuals(self.points)
        best = self.points[[np.argmin(squared_norms(residuals))]]
        self.mode = maximise_posterior(self.posterior, best, tolerance=_SETTINGS.mode_tolerance)
        self._tangent_map = TangentMap(self.posterior, LinearisedPoints.at(self.posterior, self.mode))
        self.points = np.concatenate([self.points, self.mode])

    def _starts(self) -> tuple[NDArray[np.float64], LinearisedPoints]:
        """Return randomly drawn components (n, p), and for each the point whose components are the nearest."""
        target = self._random.standard_normal((_SETTINGS.pilots, self.mode.shape[1]))
        components = self._tangent_map.components(self.posterior.residuals(self.points))
        return target, LinearisedPoints.at(self.posterior, self.points[nearest_rows(components, target)])

    def _on_few_lines(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the log-likelihood (n,) at z (n, p) by the reduced misfit."""
        return -(squared_norms(self.posterior.residuals(z)[:, z.shape[1] :]) + self.reduced.outside) / 2.0
