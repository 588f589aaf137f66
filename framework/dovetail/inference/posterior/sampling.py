"""Samples of the posterior.

Pilot searches explore the region around the best fit, and the misfit is reduced to the few lines that this region
needs. Meanwhile, other modes are searched for; the regions around them are explored too. Randomize-then-optimize then
draws independent samples, which are weighted with all lines.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from dovetail.inference.fitting import Fit
from dovetail.inference.posterior.annealing import Annealing
from dovetail.inference.posterior.distribution import Posterior, check_options
from dovetail.inference.posterior.drawn_samples import DrawnSamples, SearchEnds, draw_about_modes, move_by_weight
from dovetail.inference.posterior.evidence import Evidence, least_log_evidence
from dovetail.inference.posterior.exploration import Exploration
from dovetail.inference.posterior.fewer_lines import log_constant_meanwhile, with_fewer_lines
from dovetail.inference.posterior.laplace import half_about_the_fit, laplace_posterior
from dovetail.inference.posterior.likelihood import (
    Likelihood,
    squared_norms,
    unit_from_normal,
)
from dovetail.inference.posterior.mode_search import (
    likelihood_at_mode,
    search_modes,
    starts_near,
)
from dovetail.inference.posterior.model_error import TYPICAL, ModelError
from dovetail.inference.posterior.randomize_then_optimize import LinearisedPoints
from dovetail.inference.posterior.tangent_mixture import TangentMixture
from dovetail.inference.posterior.tangent_steps import Density
from dovetail.inference.posterior.unknown_chain import UnknownChain
from dovetail.inference.posterior.weights import are_counted, are_even, from_logarithms
from dovetail.interfaces import Progress, logged, silent
from dovetail.meanwhile import SharedProgress, meanwhile
from dovetail.problem import Problem
from dovetail.problem.modal_observations import ModalProblem


@dataclass(frozen=True)
class Settings:
    """How many samples are drawn at a time."""

    batch: int = 400
    """Largest number of searches at a time; each batch starts from the samples of the batches before."""
    limited_batch: int = 25
    """The same with a time limit. A batch that does not end in time is lost: its first ends are no sample."""
    ample: float = 20.0
    """Time left, over that of the exploration, with which a limit is taken for none."""
    fewest: int = 50
    """Samples below which the Laplace approximation takes their place if time ends: with fewer, each end of an
    interval would rest on one or two of them."""


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
    with logged(__name__, "likelihood of the parameters"):
        likelihood, best = likelihood_at_mode(problem, fit, model_error)
        random = np.random.default_rng([seed, 3])
    shared = SharedProgress(progress)
    search = partial(search_modes, problem, likelihood, best, random, shared)
    began = time.perf_counter()
    with log_constant_meanwhile(likelihood, (problem, fit), measured, model_error) as log_constant:
        with logged(__name__, f"{samples} samples of the posterior"):
            drawn, lines, finished = _draw(problem, fit, likelihood, best, search, samples, seed, shared)
        if len(drawn.z) and finished >= min(_SETTINGS.fewest, samples):
            constant = log_constant()
        else:
            problem.limit.leave_out("samples (a Gaussian at the best fit takes their place)")
            return laplace_posterior(problem, fit, samples=samples, model_error=model_error, seed=seed)
    z, weight = drawn.z, from_logarithms(drawn.log_weight)
    if finished < samples:
        problem.limit.leave_out(f"{finished} of {samples} samples")
    log_likelihood, evidence = drawn.log_likelihood, drawn.evidence
    if model_error.quantities:
        z, weight = half_about_the_fit(problem, fit, model_error, z, weight, seed)
        log_likelihood = None
    fraction = unit_from_normal(z)
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
    best: NDArray[np.float64],
    search: Callable[[], NDArray[np.float64]],
    samples: int,
    seed: int,
    progress: SharedProgress,
) -> tuple[DrawnSamples, int, int]:
    """Return samples near the modes, the number of lines they are from, and the searches that ended in time.

    While modes are searched for, the region about the best fit is explored, and samples from there are begun with.
    """
    limit = problem.limit
    if isinstance(problem, ModalProblem):
        drawn = draw_about_modes(likelihood.posterior, search(), samples, seed)
        return drawn, len(likelihood.variance), 0 if limit.is_over else samples

    def is_given_up() -> bool:
        progress.show("modes")
        return limit.was_stopped

    with logged(__name__, "modes of the posterior"), meanwhile(search, is_given_up) as found:
        random = np.random.default_rng([seed, 2])
        region = Exploration(likelihood, starts_near(best), fit.information, random, progress)
        sampler = _Sampler(region, random, progress)
        sampler.begin(samples)
        modes = found()
    progress.show("modes")
    if limit.is_over:
        limit.leave_out("the search for other groups of likely values")
    region.include(modes)
    return sampler.draw(samples), region.reduced.lines, samples - sampler.missing


class _Sampler:
    """Draws samples z of one posterior.

    Parameters
    ----------
    region : Exploration
    random : numpy.random.Generator
    progress : Progress

    Attributes
    ----------
    missing : int
        Searches that the time limit left out.
    """

    def __init__(self, region: Exploration, random: np.random.Generator, progress: Progress) -> None:
        self._region, self._random, self._progress = region, random, progress
        self._limit, self.missing = region.likelihood.model.limit, 0
        self._begun: TangentMixture | None = None

    def begin(self, count: int) -> None:
        """Search for samples about the highest mode that is known, which need not be the only one."""
        self._begun = self._mixture()
        self._begun.search(self._begun.modes, min(count, self._batch))

    def draw(self, count: int) -> DrawnSamples:
        """Return samples with their weights and log-likelihoods by all lines.

        If the weights of the ends of searches are uneven, samples are drawn by weight and moved by Metropolis steps.
        """
        density = Density.of(self._region.posterior)
        size, random = self._region.mode.shape[1], self._random.spawn(1)[0]
        with Annealing(density, size, random, count, self._limit) as annealing:
            return self._weighted(density, self._search(count, annealing.begin), annealing, count)

    def _weighted(self, density: Density, mixture: TangentMixture, annealing: Annealing, count: int) -> DrawnSamples:
        """Return the ends of searches with their weights; if these are uneven, samples that Metropolis steps move."""
        order = self._random.permutation(np.flatnonzero(are_counted(mixture.log_weight)))
        z, log_density, log_weight = mixture.ends.z[order], mixture.log_density[order], mixture.log_weight[order]
        log_likelihood, effective = self._region.log_likelihood(z), np.inf
        on_all_lines = log_likelihood - squared_norms(z) / 2.0 - log_density
        evidence = Evidence.from_weights(on_all_lines, mixture.begun)
        least = least_log_evidence(on_all_lines, mixture.begun)
        even = mixture.is_complete and are_even(log_weight, min(mixture.begun, count))
        if not even and self._limit.is_over:
            self._limit.leave_out("steps that make the weights of samples even")
        elif not even:
            ends = SearchEnds.of(mixture)
            moved = move_by_weight(density, ends, count, self._random, self._progress, self._limit, annealing)
            evidence = moved.doubted(evidence)
            least = max(least, moved.least_log_evidence - self._region.reduced.outside / 2.0)
            z, log_density, effective = moved.z, moved.log_posterior, moved.effective
            log_likelihood = self._region.log_likelihood(z)
        weight = log_likelihood - squared_norms(z) / 2.0 - log_density
        converged = len(mixture.ends.z)
        return DrawnSamples(z, weight, log_likelihood, evidence, mixture.begun, converged, effective, least)

    def _search(self, count: int, on_uneven: Callable[[], object]) -> TangentMixture:
        """Search for samples about the separate modes.

        A curved valley has many points that seem to be modes, but searches about them end elsewhere: it counts as one.
        """
        modes = self._region.separate_modes()
        if len(modes.z) > 1:
            mixture = self._mixture(modes)
            self.missing = mixture.sample(count, self._batch, self._progress, on_uneven)
            if not mixture.is_one_valley:
                return mixture
        is_same = self._begun is not None and self._begun.posterior is self._region.posterior
        mixture = self._begun if self._begun is not None and is_same else self._mixture()
        self.missing = mixture.sample(count, self._batch, self._progress, on_uneven)
        return mixture

    def _mixture(self, modes: LinearisedPoints | None = None) -> TangentMixture:
        """Return searches about some modes, or about the highest one."""
        region, random = self._region, self._random.spawn(1)[0]
        modes = modes or LinearisedPoints.at(region.posterior, region.mode)
        return TangentMixture(region.posterior, modes, region.points, random, self._limit)

    @property
    def _batch(self) -> int:
        """Number of searches at a time."""
        ample = self._limit.remaining > _SETTINGS.ample * self._region.seconds
        return _SETTINGS.batch if ample else _SETTINGS.limited_batch
