"""Compares models of the same measurements: joints of an assembly, roles of the parameters of a series."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dovetail.assembly import Assembly, load
from dovetail.comparison.compared_models import ComparedModel, ModelComparison
from dovetail.comparison.replaced_joints import with_joint
from dovetail.comparison.series_models import compared_series
from dovetail.errors import Fault, ParameterError
from dovetail.identification.one_measurement import Measurement, as_frfs, lines_to_fit
from dovetail.inference.adequacy.judgement import JudgedFit, JudgementOptions, judge
from dovetail.inference.fitting import Fit, fit_at, refine
from dovetail.inference.posterior import ModelError, sample_posterior
from dovetail.inference.posterior.distribution import check_options
from dovetail.inference.posterior.evidence import Evidence
from dovetail.inference.posterior.leave_one_out import line_scores
from dovetail.inference.posterior.likelihood import Likelihood
from dovetail.inference.posterior.mode_search import likelihood_at_mode
from dovetail.inference.posterior.unknown_chain import UnknownChain
from dovetail.interfaces import Progress, logged, progress_reporter, silent
from dovetail.parallel import one_blas_thread
from dovetail.problem import Problem
from dovetail.problem.least_squares import minimise
from dovetail.registry import PluginPaths
from dovetail.series import SeriesDescription, read_series
from dovetail.series.series_file import is_series

Source: TypeAlias = str | os.PathLike[str]


def compare_models(
    description: Source | SeriesDescription,
    measured: Measurement | None = None,
    *,
    joints: Sequence[str] = (),
    joint: str | None = None,
    roles: Mapping[str, Sequence[str]] | None = None,
    against: Iterable[Source] = (),
    model_error: float | None = None,
    samples: int = 400,
    seed: int = 0,
    plugins: PluginPaths = (),
    progress: Progress | bool | None = None,
) -> ModelComparison:
    """Compare models of the same measurements by their marginal likelihoods and leave-one-out scores.

    Parameters
    ----------
    description : path or SeriesDescription
        An assembly, or a series of tests.
    measured : Frf, path, or several
        Of an assembly, as in `identify`; a series names its own.
    joints : sequence of str
        Models of a joint of the assembly, each in the place of the described one.
    joint : str, optional
        Which joint; needed if there are several.
    roles : mapping of str to sequence of str
        Of a series: by parameter, the roles to compare: shared, free, varying, or the name of a law over the covariate.
        With several parameters, all combinations.
    against : iterable of paths
        Further descriptions: assemblies with the same responses, or series of the same tests.
    model_error : float, optional
        Relative error of natural frequencies that all models are allowed; by default the one that the best of them
        shows.
    samples : int
        Number of searches for samples, for each model.
    seed : int
    plugins : path or iterable of paths
        As in `dovetail.load`.
    progress : bool or callable, optional
        As in `identify`.

    Returns
    -------
    ModelComparison

    Raises
    ------
    DescriptionError
        A description is wrong.
    ParameterError
        There are fewer than two models, or one of them cannot be made.
    MeasurementError
        A measurement cannot be read, or does not fit.
    """
    check_options(samples)
    is_for_series = isinstance(description, SeriesDescription) or is_series(description)
    _check_arguments(is_for_series, measured, joints, roles)
    with one_blas_thread(), progress_reporter(progress) as report:
        if isinstance(description, SeriesDescription) or is_for_series:
            known = isinstance(description, SeriesDescription)
            series = description if known else read_series(description, plugins=plugins)  # type: ignore[arg-type]
            assert isinstance(series, SeriesDescription)
            others = [read_series(path, plugins=plugins) for path in against]
            return compared_series(
                series, others, roles or {}, model_error=model_error, samples=samples, seed=seed, progress=report
            )
        assert measured is not None
        models, frfs = _assemblies(description, joints, joint, against, plugins), as_frfs(measured)
        problems = {
            name: lines_to_fit(assembly, frfs, None, silent, phase=True).every_nth.problem
            for name, assembly in models.items()
        }
        compared = _compared(problems, model_error, samples, seed, report)
        return ModelComparison(next(iter(models.values())).name, compared)


def _check_arguments(
    is_for_series: bool,
    measured: Measurement | None,
    joints: Sequence[str],
    roles: Mapping[str, Sequence[str]] | None,
) -> None:
    if is_for_series and (measured is not None or joints):
        problem = "a series names its measurements itself, and its joints are not replaced."
        raise ParameterError(Fault("compare_models", problem, remedy="Compare roles, or with another series."))
    if not is_for_series and (measured is None or roles):
        problem = "an assembly has no roles." if roles else "no measurement was given."
        raise ParameterError(Fault("compare_models", problem, "an assembly and its measured FRFs, or a series"))


def _assemblies(
    path: Source, joints: Sequence[str], joint: str | None, against: Iterable[Source], plugins: PluginPaths
) -> dict[str, Assembly]:
    """Return the assemblies to compare, by the name of the joint's model or of the file."""
    models = {model: with_joint(path, model, joint, plugins) for model in joints}
    if not models:
        models[Path(path).stem] = load(path, plugins=plugins)
    for other in against:
        name = Path(other).stem if Path(other).stem not in models else str(other)
        models[name] = load(other, plugins=plugins)
    if len(models) < 2:
        accepted = "two or more joints, or a further description"
        raise ParameterError(Fault("joints", f"there is only one model, {next(iter(models))}.", accepted))
    first = next(iter(models))
    for name, assembly in models.items():
        if assembly.description.responses != models[first].description.responses:
            problem = f"'{name}' has other responses than '{first}'."
            raise ParameterError(Fault("models", problem, "the same responses, since the measurements are the same"))
    first_of: dict[str, str] = {}
    for name, assembly in models.items():
        if (other := first_of.setdefault(assembly.description.fingerprint, name)) != name:
            raise ParameterError(Fault("models", f"'{other}' and '{name}' are the same model.", "models that differ"))
    return models


def _compared(
    problems: Mapping[str, Problem], model_error: float | None, samples: int, seed: int, progress: Progress
) -> tuple[ComparedModel, ...]:
    """Fit all models, and compare them with the random error and the model error of the one that fits best."""
    options, judged = JudgementOptions(model_error=model_error, cause_seconds=0.0), {}
    for number, (name, problem) in enumerate(problems.items()):
        progress("fits", number, len(problems))
        judged[name] = _judged(problem, options, seed)
    progress("fits", len(problems), len(problems))
    best = min(
        judged.values(), key=lambda one: (one.adequacy.error_in_intervals.natural_frequency, one.fit.chi_squared)
    )
    error = best.adequacy.error_in_intervals
    random = best.fit.allowing_for_unknown_noise(problems[next(iter(problems))].observations)
    compared = []
    for name, problem in problems.items():
        fit = replace(judged[name].fit, variance=random.variance, used=random.used)
        with logged(__name__, f"marginal likelihood of {name}"):
            word = judged[name].adequacy.word
            compared.append(_one_compared(name, problem, fit, error, word, samples, seed, progress))
    return tuple(compared)


def _judged(problem: Problem, options: JudgementOptions, seed: int) -> JudgedFit:
    """Return the fit of a model and its judgement; of a model without unknowns, that of its only FRF."""
    if problem.parameters:
        return judge(problem, refine(problem, seed=seed), options, seed=seed)
    fit = fit_at(problem, np.empty(0))
    return judge(problem, fit, options, seed=seed)


def _one_compared(
    name: str,
    problem: Problem,
    fit: Fit,
    error: ModelError,
    word: str,
    samples: int,
    seed: int,
    progress: Progress,
) -> ComparedModel:
    chain = UnknownChain.of(problem, fit, error) if error.background else None
    if chain is not None:
        problem, fit, error = chain.problem, chain.fit, chain.model_error
    likelihood, fraction = likelihood_at_mode(problem, fit, error)
    count = len(problem.parameters)
    if count:
        posterior = sample_posterior(problem, fit, samples=samples, model_error=error, seed=seed, progress=progress)
        points, weight, evidence = posterior.fraction, posterior.weight, posterior.evidence
        least = posterior.least_log_evidence
    else:
        points, weight = fraction[np.newaxis], np.ones(1)
        evidence = Evidence(float(likelihood.log(points)[0] + likelihood.log_constant), 0.0)
        least = evidence.log
    highest = largest_log_likelihood(likelihood, points)
    return ComparedModel(name, count, evidence, (least, highest), line_scores(likelihood, points, weight), word)


def largest_log_likelihood(likelihood: Likelihood, fraction: NDArray[np.float64]) -> float:
    """Return the largest log-likelihood near samples (n, p), with all constants."""
    at_samples = likelihood.log(fraction)
    best = fraction[[int(np.argmax(at_samples))]]
    if best.shape[1]:
        found = minimise(likelihood.marginalised, best, tolerance=0.01, most_steps=100)
        return float(max(at_samples.max(), -found.cost.min() / 2.0) + likelihood.log_constant)
    return float(at_samples.max() + likelihood.log_constant)
