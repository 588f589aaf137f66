"""Right and wrong models: joints of an assembly, roles of a series, and what the sentence says."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

import dovetail
from dovetail import ParameterError
from dovetail.cli.app import app
from dovetail.comparison import ComparedModel, ModelComparison
from dovetail.comparison.replaced_joints import with_joint
from dovetail.comparison.series_models import compared_series
from dovetail.inference.posterior.evidence import Evidence
from dovetail.inference.posterior.leave_one_out import line_scores
from dovetail.interfaces import silent
from support.mounts_in_series import mount, series
from support.small_joints import measured

ASSEMBLIES = Path(__file__).parents[2] / "assemblies"
ROD = ASSEMBLIES / "series" / "clamped_rod.yaml"


def model(name, log, error=0.1, **changed):
    evidence = None if log is None else Evidence(log, error)
    known = {"bounds": (-np.inf, 0.0), "line_scores": np.zeros(4), "fits": "to the noise", **changed}
    return ComparedModel(name, 3, evidence, known["bounds"], known["line_scores"], known["fits"])


def test_a_model_is_preferred_where_log_z_differs_by_more_than_three_and_two_standard_errors():
    assert ModelComparison("x", (model("b", -10.0), model("a", -5.0))).preferred.name == "a"
    assert ModelComparison("x", (model("b", -10.0), model("a", -7.1))).preferred is None
    assert ModelComparison("x", (model("b", -10.0, 1.0), model("a", -5.0, 1.0))).preferred is None
    sentence = ModelComparison("x", (model("b", -10.0), model("a", -7.1))).sentence
    assert sentence == (
        "The measurements cannot tell a from b: log Z differs by 2.9 (± 0.1), and less than 3 is not decisive."
    )


def test_a_model_whose_evidence_is_unknown_is_worse_where_even_its_largest_likelihood_is_too_small():
    worse = ModelComparison("x", (model("a", -5.0), model("b", None, bounds=(-np.inf, -50.0))))
    assert worse.preferred.name == "a"
    assert "at least exp(45) times that of b" in worse.sentence
    unclear = ModelComparison("x", (model("a", -5.0), model("b", None, bounds=(-np.inf, 0.0))))
    assert unclear.preferred is None
    assert "at most exp(5) times as large" in unclear.sentence
    assert "Ask for more samples" in ModelComparison("x", (model("a", None), model("b", None))).sentence


def test_a_model_of_which_few_samples_count_is_preferred_where_even_its_least_evidence_is_larger():
    """Only this one fits: how much better it is need not be known."""
    few = model("fits", None, bounds=(-80.0, -20.0))
    comparison = ModelComparison("x", (model("does not", -500.0, fits="does not fit"), few))
    assert comparison.preferred.name == "fits"
    assert comparison.difference(comparison.ranking[1]) == (420.0, 0.1)
    assert "at least exp(420) times that of does not" in comparison.sentence
    assert "does not fit" not in comparison.sentence
    both = ModelComparison("x", (model("b", None, bounds=(-900.0, -500.0)), few))
    assert both.preferred.name == "fits"
    close = ModelComparison("x", (model("does not", -82.0), few))
    assert close.preferred is None
    assert "too few samples count for the marginal likelihood of fits" in close.sentence
    assert json.dumps(close.to_dict(), allow_nan=False)


def test_a_preferred_model_that_does_not_fit_is_named():
    comparison = ModelComparison("x", (model("a", -5.0, fits="does not fit"), model("b", -50.0)))
    assert "even a does not fit" in comparison.sentence


@pytest.fixture(scope="module")
def rod(tmp_path_factory):
    """A measured FRF of the rod on its clamp."""
    assembly = dovetail.load(ROD)
    frf = dovetail.Frf(assembly.frequency, assembly.frf({"k": 3e7, "kr": 3e4, "c": 60.0, "cr": 0.6}), "accelerance")
    file = tmp_path_factory.mktemp("rod") / "rod.csv"
    dovetail.write_frf(dovetail.noisy_frf(frf, 0.01, 0), file)
    return file


def test_the_joint_that_made_the_measurement_is_preferred_to_a_rigid_one(rod):
    comparison = dovetail.compare_models(ROD, rod, joints=["rigid", "spring_damper"], samples=100)
    assert comparison.preferred.name == "spring_damper"
    rigid = next(one for one in comparison.models if one.name == "rigid")
    assert rigid.unknowns == 0
    assert comparison.difference(rigid)[0] > 1e3
    assert comparison.score_difference(rigid)[0] > 1e3


def test_few_samples_suffice_where_the_other_joint_does_not_fit_at_all(rod):
    comparison = dovetail.compare_models(ROD, rod, joints=["rigid", "spring_damper"], samples=20)
    assert comparison.preferred.name == "spring_damper"
    assert comparison.preferred.evidence is None
    assert comparison.sentence.startswith("The measurements prefer spring_damper: its marginal likelihood is at least")


def test_of_a_joint_without_the_parameter_that_matters_less_is_known(rod, tmp_path):
    """A clamp without rotation cannot explain the rod; against a file of its own."""
    other = tmp_path / "no_rotation.yaml"
    fixed = {"kr": "3e3 N m/rad", "cr": "0.05 N m s/rad"}
    content = {"extends": str(ROD), "joints": {"clamp": {"parameters": fixed}}}
    other.write_text(yaml.safe_dump(content), encoding="utf-8")
    done = CliRunner().invoke(app, ["compare-models", str(ROD), str(rod), "--against", str(other), "--json"])
    assert done.exit_code == 0, done.output
    found = json.loads(done.output)
    assert found["preferred"] == "clamped_rod"
    assert [*found["models"]] == ["clamped_rod", "no_rotation"]


SHARED = {
    "k": {"range": ["5e5 N/m", "2e6 N/m"], "scale": "log"},
    "c": {"range": ["5 N s/m", "100 N s/m"], "scale": "log"},
}


def ranked(monkeypatch, truths, roles, covariates=()):
    assembly = mount(SHARED, np.arange(100.0, 240.0, 10.0))
    described, fitted = series(assembly, truths, {}, 0.05, covariates)
    monkeypatch.setattr("dovetail.comparison.series_models.fit_tests", lambda *_, **__: fitted)
    return compared_series(described, [], roles, model_error=0.0, samples=200, seed=0, progress=silent)


def test_a_shared_value_is_preferred_where_the_tests_share_it_and_free_ones_where_they_do_not(monkeypatch):
    roles = {"k": ["shared", "free"]}
    same = ranked(monkeypatch, [{"k": 1e6, "c": c} for c in (20.0, 25.0, 30.0)], roles)
    assert same.ranking[0].name == "k shared"
    different = ranked(monkeypatch, [{"k": k, "c": 25.0} for k in (0.9e6, 1e6, 1.1e6)], roles)
    assert different.preferred.name == "k free"
    shared = different.ranking[1]
    assert different.score_difference(shared)[0] > 1.5 * different.score_difference(shared)[1]


def test_the_law_of_the_truth_is_preferred(monkeypatch):
    levels = [1.0, 2.0, 3.0, 4.0, 5.0]
    share = [(1.0 - np.exp(-(x - 1.0) / 1.0)) / (1.0 - np.exp(-4.0)) for x in levels]
    truths = [{"k": 8e5 * (1.5e6 / 8e5) ** s, "c": 25.0} for s in share]
    comparison = ranked(monkeypatch, truths, {"k": ["linear", "exponential_approach", "free"]}, levels)
    assert comparison.preferred.name == "k exponential_approach"
    assert comparison.ranking[-1].name == "k linear"
    assert comparison.ranking[-1].fits == "does not fit"


def test_line_scores_are_those_of_leaving_each_line_out():
    """The posterior of few parameters is integrated on a grid without each measured value in turn."""
    from dovetail.inference.fitting import refine
    from dovetail.inference.posterior import sample_posterior, typical_model_error
    from dovetail.inference.posterior.mode_search import likelihood_at_mode
    from dovetail.problem import Problem

    assembly, frf = measured("mount")
    problem = Problem.of(assembly, frf)
    fit, exact = refine(problem), typical_model_error(0.0)
    likelihood, _ = likelihood_at_mode(problem, fit, exact)
    posterior = sample_posterior(problem, fit, model_error=exact, samples=1000)
    found = line_scores(likelihood, posterior.fraction, posterior.weight)
    low, high = posterior.fraction.min(axis=0), posterior.fraction.max(axis=0)
    axes = [np.linspace(*ends, 60) for ends in zip(low - (high - low) / 4, high + (high - low) / 4, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    log_density = -(likelihood.misfit.residuals(points) ** 2 + np.log(2.0 * np.pi)) / 2.0
    without = log_density.sum(axis=1, keepdims=True) - log_density
    share = np.exp(without - without.max(axis=0))
    expected = np.log(np.sum(share * np.exp(log_density), axis=0) / share.sum(axis=0))
    assert np.quantile(np.abs(found - expected), 0.95) < 0.1
    assert found.sum() == pytest.approx(expected.sum(), abs=4.0)  # one value at the peak has a large influence


def test_a_joint_that_needs_options_or_other_nodes_is_refused_with_a_way_out():
    with pytest.raises(ParameterError, match="against="):
        with_joint(ROD, "collet")
    with pytest.raises(ParameterError, match="Did you mean 'rigid'"):
        with_joint(ROD, "rigit")
    with pytest.raises(ParameterError, match="there is no joint 'clam'"):
        with_joint(ROD, "rigid", "clam")


def test_a_joint_keeps_the_nodes_and_the_ranges_of_parameters_of_the_same_name(tmp_path):
    bearing = with_joint(ROD, "bearing")
    assert bearing.description.joints["clamp"].connection.model.name == "bearing"
    described = {p.name: (p.lower, p.upper) for p in dovetail.load(ROD).parameters}
    same = {p.name: (p.lower, p.upper) for p in bearing.parameters if p.name in described}
    assert same
    assert all(described[name] == ends for name, ends in same.items())


WRONG = {
    "no measurement": ([str(ROD), "--joints", "rigid,spring_damper"], "no measurement was given"),
    "one joint": ([str(ROD), "FRF", "--joints", "rigid"], "there is only one model"),
    "roles of an assembly": ([str(ROD), "FRF", "--roles", "k=free,shared"], "an assembly has no roles"),
    "joints of a series": ([str(ROD.parent / "torques.yaml"), "--joints", "rigid"], "a series names its measurements"),
    "no roles": ([str(ROD.parent / "torques.yaml"), "--roles", "k"], "gives no roles"),
    "an unknown role": ([str(ROD.parent / "torques.yaml"), "--roles", "k=liner,free"], "Did you mean 'linear'"),
    "an unknown parameter": (
        [str(ROD.parent / "torques.yaml"), "--roles", "kx=linear,free"],
        "no test has a parameter",
    ),
    "one role": ([str(ROD.parent / "torques.yaml"), "--roles", "k=linear"], "there is only one model"),
}


@pytest.mark.parametrize("case", WRONG)
def test_models_that_cannot_be_compared_are_refused(case, rod):
    arguments, expected = WRONG[case]
    done = CliRunner().invoke(app, ["compare-models", *(str(rod) if one == "FRF" else one for one in arguments)])
    assert done.exit_code == 1, done.output
    assert expected in " ".join(done.output.split())
