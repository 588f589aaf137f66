"""Compares models of a series: the roles of its parameters, and the laws that they follow."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from dovetail.comparison.compared_models import ComparedModel, ModelComparison
from dovetail.documents.fault_list import FaultList
from dovetail.errors import Fault, ParameterError, argument, did_you_mean, listing
from dovetail.inference.posterior.leave_one_out import line_scores
from dovetail.inference.posterior.likelihood import squared_norms
from dovetail.interfaces import Law, Progress, logged
from dovetail.registry import installed_components
from dovetail.series import SeriesDescription
from dovetail.series.description import FREE, Role
from dovetail.series.fitted_tests import FittedTest, fit_tests
from dovetail.series.fitting import CONTRADICTION, fit_series, minimise
from dovetail.series.residuals import SeriesResiduals
from dovetail.series.role_checks import check_roles
from dovetail.series.sampling import sample_series
from dovetail.series.unknowns import SeriesUnknowns

_WORDS = ("to the noise", "good", "not judged", "rough", "does not fit")
"""How well a model fits, the best first."""


def compared_series(
    series: SeriesDescription,
    others: Sequence[SeriesDescription],
    roles: Mapping[str, Sequence[str]],
    *,
    model_error: float | None,
    samples: int,
    seed: int,
    progress: Progress,
) -> ModelComparison:
    """Compare series with different roles of their parameters.

    Random errors and errors of the models are those of the fits to each test alone: the same for all roles.
    """
    models = _variants(series, roles) if roles else {series.name: series}
    for other in others:
        if [test.measured for test in other.tests] != [test.measured for test in series.tests]:
            problem = f"'{other.name}' has other measurements than '{series.name}'."
            raise ParameterError(Fault("against", problem, "a series of the same measured files, in the same order"))
        models[other.name if other.name not in models else f"{other.name} ({len(models)})"] = other
    if len(models) < 2:
        roles_given, file_given = argument("roles", {"k": "shared,free"}), argument("against", "FILE")
        remedy = f"Give roles, as in {roles_given}, or a further series: {file_given}."
        raise ParameterError(Fault("roles", "there is only one model.", "two or more", remedy))
    fitted: dict[tuple[int, ...], tuple[FittedTest, ...]] = {}
    compared = []
    for name, model in models.items():
        same = tuple(id(test.assembly) for test in model.tests)
        if same not in fitted:
            fitted[same] = fit_tests(model, model_error=model_error, seed=seed, progress=progress)
        with logged(__name__, f"marginal likelihood of {name}"):
            compared.append(compared_model(name, model, fitted[same], samples, seed, progress))
    return ModelComparison(series.name, tuple(compared))


def compared_model(
    name: str, series: SeriesDescription, tests: Sequence[FittedTest], samples: int, seed: int, progress: Progress
) -> ComparedModel:
    """Return the marginal likelihood and the scores of a series whose tests have been fitted alone."""
    unknowns = SeriesUnknowns(series)
    fit = fit_series(unknowns, tests, progress=progress)
    posterior = sample_series(unknowns, tests, fit, samples=samples, seed=seed, progress=progress)
    likelihoods = [test.likelihood() for test in tests]
    pairs = zip(likelihoods, posterior.tests, strict=True)
    scores = [line_scores(likelihood, test_samples.fraction, posterior.weight) for likelihood, test_samples in pairs]
    residuals = SeriesResiduals(unknowns, [likelihood.marginalised for likelihood in likelihoods])
    starts = np.stack([fit.z, posterior.weight @ posterior.z])
    squares = squared_norms(minimise(residuals, starts, prior=0.0).residuals[:, unknowns.count :])
    highest = sum(likelihood.log_constant for likelihood in likelihoods) - float(squares.min()) / 2.0
    word = max((test.judged.adequacy.word for test in tests), key=_WORDS.index)
    if fit.contradiction < CONTRADICTION:
        word = "does not fit"
    bounds = posterior.least_log_evidence, highest
    return ComparedModel(name, unknowns.count, posterior.evidence, bounds, np.concatenate(scores), word)


def _variants(series: SeriesDescription, roles: Mapping[str, Sequence[str]]) -> dict[str, SeriesDescription]:
    """Return the series with all combinations of the roles, by names such as "k linear, c shared"."""
    names = {p.name for test in series.tests for p in test.assembly.parameters}
    for name in roles:
        if name not in names:
            problem = f"no test has a parameter '{name}' to identify."
            raise ParameterError(Fault("roles", problem, listing(sorted(names), 30), did_you_mean(name, names)))
    models = {}
    for words in itertools.product(*roles.values()):
        chosen = {name: _role(series, name, word) for name, word in zip(roles, words, strict=True)}
        label = ", ".join(f"{name} {word}" for name, word in zip(roles, words, strict=True))
        faults = FaultList()
        check_roles(series.tests, {**series.roles, **chosen}, series.other_parameters, faults)
        faults.raise_if_any()
        models[label] = series.with_roles(chosen)
    return models


def _role(series: SeriesDescription, name: str, word: str) -> Role:
    """Return the role of a parameter from a word: shared, free, varying, or a law."""
    described = series.role_of(name)
    if word == "free":
        return FREE
    if word == "shared":
        return Role("shared")
    if word == "varying":
        return Role("varying", scatter=described.scatter)
    known = ("shared", "free", "varying", *installed_components().names("law"))
    if word not in known and ":" not in word:
        raise ParameterError(
            Fault(f"roles.{name}", f"'{word}' is not a role.", listing(known), did_you_mean(word, known))
        )
    over = described.over or (next(iter(series.covariates)) if len(series.covariates) == 1 else "")
    if not over:
        problem = f"it is not clear over which covariate '{word}' runs."
        raise ParameterError(
            Fault(f"roles.{name}", problem, listing(series.covariates), "Describe a law of it in the series.")
        )
    law = described.law if described.law is not None and described.law.name == word else None
    made = law or installed_components().create("law", word)
    assert isinstance(made, Law)
    return Role("law", made, over, described.scatter)
