"""Samples of the posterior.

After a search for the modes, pilot searches explore the region around them, and the misfit is reduced to the few lines
that this region needs. Randomize-then-optimize then draws independent samples, which are weighted with all lines.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.fitting import Fit
from dovetail.inference.posterior.distribution import Posterior, check_options
from dovetail.inference.posterior.drawn_samples import DrawnSamples, SearchEnds, draw_about_modes, move_by_weight
from dovetail.inference.posterior.evidence import Evidence, least_log_evidence
from dovetail.inference.posterior.fewer_lines import log_density_at_fit, with_fewer_lines
from dovetail.inference.posterior.laplace import half_about_the_fit, laplace_posterior
from dovetail.inference.posterior.likelihood import (
    PRIOR_PRECISION,
    Likelihood,
    PosteriorResiduals,
    ReducedResiduals,
    build_likelihood,
    squared_norms,
    unit_from_normal,
)
from dovetail.inference.posterior.mode_search import likelihood_at_mode, maximise_posterior, search_modes
from dovetail.inference.posterior.model_error import TYPICAL, ModelError
from dovetail.inference.posterior.randomize_then_optimize import LinearisedPoints, TangentMap, nearest_rows
from dovetail.inference.posterior.separate_modes import separate_modes
from dovetail.inference.posterior.tangent_mixture import TangentMixture
from dovetail.inference.posterior.tangent_steps import Density
from dovetail.inference.posterior.unknown_chain import UnknownChain
from dovetail.inference.posterior.weights import are_counted, are_even, from_logarithms
from dovetail.interfaces import Progress, logged, silent
from dovetail.problem import Problem
from dovetail.problem.modal_observations import ModalProblem


@dataclass(frozen=True)
class Settings:
    """How the region of the posterior is explored, and how many samples are drawn at a time."""

    pilots: int = 48
    """Number of searches in each round of exploration."""
    pilot_iterations: int = 30
    """Most steps of each."""
    scatter: float = 0.3
    """Distance of the first points from a mode, in standard deviations by the fit's information."""
    margin: float = 1e-3
    """Distance of these points from the ends of a range, as a fraction of it."""
    rounds: tuple[int, int] = (2, 14)
    """Smallest and largest number of rounds of exploration; they end when the reduced misfit is accurate."""
    reduction_error: float = 0.05
    """Largest accepted difference of chi-squared between the reduced misfit and all lines."""
    checked: int = 64
    """Samples whose likelihood is computed on all lines first: the reduced misfit has to be as accurate at these, in
    the root mean square."""
    region: float = 200.0
    """Chi-squared above the best one up to which a point is in the region of interest."""
    most_snapshots: int = 600
    """Number of FRFs, the latest ones, from which the misfit is reduced."""
    batch: int = 400
    """Largest number of searches at a time; each batch starts from the samples of the batches before."""
    limited_batch: int = 25
    """The same with a time limit. A batch that does not end in time is lost: its first ends are no sample."""
    ample: float = 20.0
    """Time left, over that of the exploration, with which a limit is taken for none."""
    fewest: int = 50
    """Samples below which the Laplace approximation takes their place if time ends: with fewer, each end of an
    interval would rest on one or two of them."""
    still: float = 0.1
    """Decrease of chi-squared that the tangent promises below which an end of a search is a mode."""


_SETTINGS = Settings()


def sample_posterior(
    problem: Problem,
    fit: Fit,
    *,
    samples: int = 400,
    model_error: ModelError = TYPICAL,
    seed: int = 0,
    progress: Progress = silent,
) -> Posterior:
    """Draw samples of the parameters' posterior, given a measured FRF or one for each response.

    Parameters
    ----------
    problem : Problem
        The distributions of its parameters over their ranges, uniform or normal on their scales, are the prior.
    fit : Fit
        Of the same measurement. Its random error and the lines that it left out are used.
    samples : int
        Number of searches, each for one sample.
    model_error : ModelError
        Errors that the model is allowed; 0 for an exact model. The measurement cannot show small ones, since the
        parameters compensate for them.
    seed : int
    progress : Progress

    Returns
    -------
    Posterior

    Raises
    ------
    ParameterError
        An option is out of its range, or the fit is of another problem.

    Notes
    -----
    The posterior is a narrow, curved valley, along which the walkers of a Markov chain hardly move. Here, each sample
    is the end of a separate search, weighted by the ratio of posterior to sampling density. If the weights are uneven,
    since the tangent map folds over, samples are drawn by weight and moved by Metropolis steps until they are
    independent of their starts.
    """
    check_options(samples)
    fit.check_belongs_to(problem)
    chain = UnknownChain.of(problem, fit, model_error) if model_error.background else None
    if chain is not None:
        posterior = sample_posterior(
            chain.problem,
            chain.fit,
            samples=samples,
            model_error=chain.model_error,
            seed=seed,
            progress=progress,
        )
        return chain.without(posterior)
    measured, (problem, fit) = (problem, fit), with_fewer_lines(problem, fit, model_error)
    progress("modes", 0, 1)
    with logged(__name__, "modes of the posterior"):
        likelihood, best = likelihood_at_mode(problem, fit, model_error)
        random = np.random.default_rng([seed, 3])
        modes = search_modes(problem, likelihood, best, random, progress)
    began = time.perf_counter()
    with logged(__name__, f"{samples} samples of the posterior"):
        drawn, lines, finished = _draw(problem, fit, likelihood, modes, samples, seed, progress)
    z, weight = drawn.z, from_logarithms(drawn.log_weight)
    if finished < samples:
        if not len(z) or finished < min(_SETTINGS.fewest, samples):
            problem.limit.leave_out("samples (a Gaussian at the best fit takes their place)")
            return laplace_posterior(problem, fit, samples=samples, model_error=model_error, seed=seed)
        problem.limit.leave_out(f"{finished} of {samples} samples")
    log_likelihood, evidence = drawn.log_likelihood, drawn.evidence
    if model_error.quantities:
        z, weight = half_about_the_fit(problem, fit, model_error, z, weight, seed)
        log_likelihood = None
    fraction, constant = unit_from_normal(z), _log_constant(likelihood, (problem, fit), measured, model_error)
    return Posterior.from_fractions(
        problem.parameters,
        fraction,
        weight / weight.sum(),
        model_error=model_error,
        searches=round(len(weight) * (drawn.searches or finished) / max(drawn.converged, 1)),
        lines=lines,
        seconds=time.perf_counter() - began,
        log_likelihood=likelihood.log(fraction) if log_likelihood is None else log_likelihood,
        evidence=None if evidence is None else evidence.plus(constant),
        least_log_evidence=drawn.least_log_evidence + constant,
        effective=drawn.effective,
    )


def _draw(
    problem: Problem,
    fit: Fit,
    likelihood: Likelihood,
    modes: NDArray[np.float64],
    samples: int,
    seed: int,
    progress: Progress,
) -> tuple[DrawnSamples, int, int]:
    """Return samples near the modes, the number of lines they are from, and the searches that ended in time."""
    if isinstance(problem, ModalProblem):
        drawn = draw_about_modes(likelihood.posterior, modes, samples, seed)
        return drawn, len(likelihood.variance), 0 if problem.limit.is_over else samples
    sampler = _Sampler(likelihood, modes, fit.information, np.random.default_rng([seed, 2]), progress)
    return sampler.draw(samples), sampler.lines, samples - sampler.missing


def _log_constant(
    likelihood: Likelihood, used: tuple[Problem, Fit], measured: tuple[Problem, Fit], model_error: ModelError
) -> float:
    """Return the constant of a likelihood, as a density of the measured lines if means of these were used."""
    if used == measured:
        return likelihood.log_constant
    on_lines = log_density_at_fit(build_likelihood(*measured, model_error), *measured)
    return likelihood.log_constant + on_lines - log_density_at_fit(likelihood, *used)


class _Sampler:
    """Explores the region of one posterior and draws samples z of it.

    Parameters
    ----------
    likelihood : Likelihood
    modes : (n, p) array
        Modes of the posterior as normal quantiles of the fractions of the ranges, the highest first.
    information : (p, p) array
        Fisher information of the fractions at the best fit.
    random : numpy.random.Generator
    progress : Progress

    Attributes
    ----------
    lines : int
        Number of lines from which the reduced misfit is computed.
    missing : int
        Searches that the time limit left out.
    """

    def __init__(
        self,
        likelihood: Likelihood,
        modes: NDArray[np.float64],
        information: NDArray[np.float64],
        random: np.random.Generator,
        progress: Progress,
    ) -> None:
        self._likelihood = likelihood
        self._random, self._progress, self._limit = random, progress, likelihood.model.limit
        began = self._limit.elapsed
        log_posterior = self._log_posterior(modes)
        self._modes = self._points = modes[log_posterior >= log_posterior.max() - _SETTINGS.region / 2.0]
        origin = likelihood.frf(unit_from_normal(self._points[:1]))[0]
        snapshots = self._first_snapshots(unit_from_normal(self._points), information)
        for number in range(1, _SETTINGS.rounds[1] + 1):
            progress("exploration", number - 1, _SETTINGS.rounds[1])
            reduced = ReducedResiduals(likelihood, snapshots, origin)
            self._adopt(reduced)
            target, starts = self._starts(_SETTINGS.pilots, self._tangent_map, self._points)
            pilots, _ = self._tangent_map.solve(target, starts, _SETTINGS.pilot_iterations, self._limit)
            fraction = unit_from_normal(pilots.z)
            frfs, on_few = likelihood.frf(fraction), reduced.residuals(fraction)
            squares = likelihood.marginalised.squares(likelihood.residual.of(frfs))
            error = np.abs(squared_norms(on_few) + reduced.outside - squares)
            near = squares <= squares.min() + _SETTINGS.region
            self._points = np.concatenate([self._points, pilots.z[near]])
            if number >= _SETTINGS.rounds[0] and error[near].max(initial=0.0) < _SETTINGS.reduction_error:
                break
            if self._limit.is_over:
                break
            snapshots = np.concatenate([snapshots, frfs[near]])[-_SETTINGS.most_snapshots :]
        self.lines, self.missing = reduced.lines, 0
        ample = self._limit.remaining > _SETTINGS.ample * (self._limit.elapsed - began)
        self._batch = _SETTINGS.batch if ample else _SETTINGS.limited_batch

    def _first_snapshots(self, modes: NDArray[np.float64], information: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the FRFs at the modes, given as fractions of the ranges, and at points scattered around them."""
        values, vectors = np.linalg.eigh(information + PRIOR_PRECISION * np.eye(modes.shape[1]))
        steps = self._random.standard_normal((_SETTINGS.pilots, len(values))) / np.sqrt(
            np.maximum(values, PRIOR_PRECISION)
        )
        scattered = modes[np.arange(len(steps)) % len(modes)] + _SETTINGS.scatter * (steps @ vectors.T)
        points = np.concatenate([modes, scattered])
        return self._likelihood.frf(np.clip(points, _SETTINGS.margin, 1.0 - _SETTINGS.margin))

    def _adopt(self, reduced: ReducedResiduals) -> None:
        """Replace the residuals by these reduced ones, with their mode and the tangent map there."""
        self._posterior, self._outside = PosteriorResiduals(reduced), reduced.outside
        residuals = self._posterior.residuals(self._points)
        best = self._points[[np.argmin(squared_norms(residuals))]]
        self._mode = maximise_posterior(self._posterior, best, tolerance=1e-3)
        self._tangent_map = TangentMap(self._posterior, LinearisedPoints.at(self._posterior, self._mode))
        self._points = np.concatenate([self._points, self._mode])

    def _starts(
        self, count: int, tangent_map: TangentMap, points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], LinearisedPoints]:
        """Return randomly drawn components (n, p), and for each the point whose components are the nearest."""
        target = self._random.standard_normal((count, self._mode.shape[1]))
        components = tangent_map.components(self._posterior.residuals(points))
        return target, LinearisedPoints.at(self._posterior, points[nearest_rows(components, target)])

    def draw(self, count: int) -> DrawnSamples:
        """Return samples with their weights and log-likelihoods by all lines.

        If the weights of the ends of searches are uneven, samples are drawn by weight and moved by Metropolis steps.
        """
        mixture = self._search(count)
        order = self._random.permutation(np.flatnonzero(are_counted(mixture.log_weight)))
        z, log_density, log_weight = mixture.ends.z[order], mixture.log_density[order], mixture.log_weight[order]
        log_likelihood, effective = self._log_likelihood(z), np.inf
        on_all_lines = log_likelihood - squared_norms(z) / 2.0 - log_density
        evidence = Evidence.from_weights(on_all_lines, mixture.begun)
        least = least_log_evidence(on_all_lines, mixture.begun)
        even = mixture.is_complete and are_even(log_weight, min(mixture.begun, count))
        if not even and self._limit.is_over:
            self._limit.leave_out("steps that make the weights of samples even")
        elif not even:
            density, ends = Density.of(self._posterior), SearchEnds.of(mixture)
            moved = move_by_weight(density, ends, count, self._random, self._progress, self._limit)
            evidence, least = moved.doubted(evidence), max(least, moved.least_log_evidence - self._outside / 2.0)
            z, log_density, effective = moved.z, moved.log_posterior, moved.effective
            log_likelihood = self._log_likelihood(z)
        weight = log_likelihood - squared_norms(z) / 2.0 - log_density
        converged = len(mixture.ends.z)
        return DrawnSamples(z, weight, log_likelihood, evidence, mixture.begun, converged, effective, least)

    def _search(self, count: int) -> TangentMixture:
        """Search for samples about the separate modes.

        A curved valley has many points that seem to be modes, but searches about them end elsewhere: it counts as one.
        """
        highest = LinearisedPoints.at(self._posterior, self._mode)
        for modes in (self._separate(), highest):
            mixture = TangentMixture(self._posterior, modes, self._points, self._random, self._limit)
            self.missing = mixture.sample(count, self._batch, self._progress)
            if not mixture.is_one_valley:
                break
        return mixture

    def _separate(self) -> LinearisedPoints:
        """Return the separate modes of the reduced posterior; the highest alone if there are no others."""
        others = maximise_posterior(self._posterior, self._modes, tolerance=1e-3)
        ends = LinearisedPoints.at(self._posterior, np.concatenate([self._mode, others]))
        steps = squared_norms(TangentMap(self._posterior, ends).components(ends.residuals))
        modes = separate_modes(ends.at_rows(np.flatnonzero(steps < _SETTINGS.still)))
        return modes if len(modes.z) > 1 else LinearisedPoints.at(self._posterior, self._mode)

    def _log_likelihood(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the log-likelihood (n,) at z (n, p), from the few lines if a part of the points shows them to do."""
        exact = self._likelihood.log
        if len(z) <= 2 * _SETTINGS.checked:
            return exact(unit_from_normal(z))
        on_few = -(squared_norms(self._posterior.residuals(z)[:, z.shape[1] :]) + self._outside) / 2.0
        checked = np.linspace(0, len(z) - 1, _SETTINGS.checked).astype(np.intp)
        right = exact(unit_from_normal(z[checked]))
        error = np.sqrt(np.mean((right - on_few[checked]) ** 2))
        if error > _SETTINGS.reduction_error / 2.0:
            return exact(unit_from_normal(z))
        on_few[checked] = right
        return on_few

    def _log_posterior(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the log density (n,), up to a constant, of z (n, p), from all lines."""
        return np.asarray(self._likelihood.log(unit_from_normal(z)) - squared_norms(z) / 2.0)
