"""Marginal likelihoods against closed forms, grids and nested sampling, and when they are declined."""

import json

import numpy as np
import pytest

from dovetail.inference.fitting import refine
from dovetail.inference.posterior import sample_posterior, typical_model_error
from dovetail.inference.posterior.evidence import FEWEST_EFFECTIVE, RISK, Evidence, least_log_evidence
from dovetail.inference.posterior.mode_search import likelihood_at_mode
from dovetail.problem import Problem
from support.mounts_in_series import NORMAL, mount
from support.mounts_in_series import measured as measured_mount
from support.small_joints import CASES, measured

EXACT = typical_model_error(0.0)


def sampled(assembly, frf, model_error=EXACT, samples=400):
    problem = Problem.of(assembly, frf)
    fit = refine(problem)
    likelihood, _ = likelihood_at_mode(problem, fit, model_error)
    return likelihood, sample_posterior(problem, fit, model_error=model_error, samples=samples)


@pytest.mark.parametrize("noise", [0.02, 0.1, 0.5])
@pytest.mark.parametrize("model_error", [0.0, 2e-5])
def test_the_evidence_of_a_linear_model_is_that_of_the_closed_form(noise, model_error):
    assembly = mount(NORMAL, np.arange(140.0, 181.0, 4.0))
    frf = measured_mount(assembly, {"k": 1.0002e6, "c": 20.02}, noise, 3)
    likelihood, posterior = sampled(assembly, frf, typical_model_error(model_error))
    there = likelihood.posterior.linearise(np.zeros((1, 2)))
    residuals, jacobian = there.residuals[0], there.jacobian[0]
    spread = np.eye(len(residuals) - 2) + jacobian[:, 2:].T @ jacobian[:, 2:]
    square = residuals[2:] @ np.linalg.solve(spread, residuals[2:])
    expected = likelihood.log_constant - (square + np.linalg.slogdet(spread)[1]) / 2.0
    assert posterior.evidence.log == pytest.approx(expected, abs=0.02)
    assert posterior.evidence.error < 0.02


@pytest.mark.sweep(keep=2)
@pytest.mark.parametrize("case", ["mount", "mount in noise", "two mounts"])
def test_the_evidence_of_two_parameters_is_that_of_a_grid(case):
    """One of them is a curved valley: only the sum of two stiffnesses on logarithmic scales shows."""
    assembly, frf = measured(case)
    likelihood, posterior = sampled(assembly, frf, typical_model_error(5e-4))
    fine = 1200
    axis = (np.arange(fine) + 0.5) / fine
    low, high = posterior.fraction.min(axis=0) - 0.02, posterior.fraction.max(axis=0) + 0.02
    axes = [axis[(axis > a) & (axis < b)] for a, b in zip(low, high, strict=True)]
    axes = [one if len(one) > 60 else np.linspace(a, b, 240) for one, a, b in zip(axes, low, high, strict=True)]
    steps = [one[1] - one[0] for one in axes]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    points = points[((points > 0.0) & (points < 1.0)).all(axis=1)]
    density = likelihood.log(points) + likelihood.log_constant
    expected = np.log(np.exp(density - density.max()).sum() * np.prod(steps)) + density.max()
    assert posterior.evidence.log == pytest.approx(expected, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_the_evidence_is_that_of_nested_sampling(case):
    dynesty = pytest.importorskip("dynesty")
    assembly, frf = measured(case)
    likelihood, posterior = sampled(assembly, frf, typical_model_error(5e-4))
    nested = dynesty.NestedSampler(
        lambda fraction: float(likelihood.log(fraction[np.newaxis])[0] + likelihood.log_constant),
        lambda fraction: fraction,
        len(assembly.parameters),
        nlive=1200,
        sample="unif",
        rstate=np.random.default_rng(0),
    )
    nested.run_nested(dlogz=0.05, print_progress=False)
    assert posterior.evidence.log == pytest.approx(nested.results.logz[-1], abs=0.3 + 2.0 * nested.results.logzerr[-1])


def test_weights_of_which_too_few_count_give_no_evidence():
    few = np.where(np.arange(400) < FEWEST_EFFECTIVE - 2, 0.0, -50.0)
    assert Evidence.from_weights(few, 400) is None
    assert Evidence.from_weights(np.empty(0), 400) is None
    enough = np.where(np.arange(400) < FEWEST_EFFECTIVE + 2, 0.0, -50.0)
    assert Evidence.from_weights(enough, 400).log == pytest.approx(np.log(32 / 400))


@pytest.mark.parametrize("spread", [0.5, 3.0, 8.0])
@pytest.mark.parametrize("count", [1, 5, 40])
def test_the_lower_bound_is_exceeded_even_if_single_weights_dominate(count, spread):
    random = np.random.default_rng(3)
    weights = random.normal(-(spread**2) / 2.0, spread, (2000, count))  # of which the mean is expected to be 1
    bounds = np.array([least_log_evidence(row, count) for row in weights])
    assert np.mean(bounds > 0.0) <= RISK
    assert least_log_evidence(np.empty(0), count) == -np.inf


def test_searches_that_did_not_converge_count_as_nothing():
    assert Evidence.from_weights(np.zeros(100), 200).log == pytest.approx(-np.log(2.0))
    assert Evidence.from_weights(np.zeros(100), 100).error == pytest.approx(0.0)


def test_the_standard_error_is_the_scatter_over_seeds():
    random, logs, errors = np.random.default_rng(0), [], []
    for _ in range(200):
        found = Evidence.from_weights(random.normal(0.0, 0.7, 400), 400)
        logs.append(found.log)
        errors.append(found.error)
    assert np.std(logs) == pytest.approx(np.mean(errors), rel=0.2)


def test_the_evidence_is_in_the_result_file(tmp_path):
    import dovetail

    assembly, frf = measured("mount")
    result = dovetail.identify(assembly, frf, cause_seconds=0)
    found = result.posterior.evidence
    file = tmp_path / "result.json"
    file.write_text(json.dumps(result.to_dict()), encoding="utf-8")
    assert dovetail.load_result(file).posterior.evidence == found
