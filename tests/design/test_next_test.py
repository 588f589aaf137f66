"""The next test of a series: which candidate is proposed, and what the plan predicts of it."""

import json

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

import dovetail
from dovetail import ParameterError
from dovetail.cli.app import app
from dovetail.design.next_test import plan_next_test
from dovetail.series.description import Role
from dovetail.series.fitting import fit_series
from dovetail.series.result import SeriesIdentification
from dovetail.series.sampling import sample_series
from dovetail.series.unknowns import SeriesUnknowns
from support.mounts_in_series import NORMAL, mount, series

LINES = np.arange(140.0, 181.0, 4.0)


def identified(truths, roles, samples=200):
    described, fitted = series(mount(NORMAL, LINES), truths, roles, 0.02)
    unknowns = SeriesUnknowns(described)
    fit = fit_series(unknowns, fitted)
    posterior = sample_series(unknowns, fitted, fit, samples=samples) if samples else None
    return SeriesIdentification(described, fitted, unknowns, fit, posterior)


SHARED = {"k": Role("shared"), "c": Role("shared")}


@pytest.mark.parametrize("tests", [1, 4])
def test_the_same_test_again_narrows_intervals_by_the_number_of_tests(tests):
    result = identified([{"k": 1e6, "c": 20.0}] * tests, SHARED)
    planned = plan_next_test(result, samples=200)
    assert len(planned.tests) == tests
    deviation = np.sqrt(np.diag(result.fit.matrix.shared_covariance()[0]))
    test_information = 1.0 / deviation**2 - 1.0  # the information of all tests, without that of the prior
    expected = np.sqrt((1.0 + test_information) / (1.0 + test_information * (tests + 1) / tests))
    for name, value in zip(("k", "c"), expected, strict=True):
        assert planned.tests[0].narrowing[name] == pytest.approx(value, rel=0.06)


def test_a_larger_noise_makes_the_next_test_reveal_less():
    result = identified([{"k": 1e6, "c": 20.0}], SHARED)
    fine, coarse = (plan_next_test(result, noise=noise).tests[0].mean_narrowing for noise in (0.001, 0.3))
    assert fine < 0.5 < 0.9 < coarse <= 1.0


def test_a_value_that_scatters_is_revealed_less_than_a_shared_one():
    truths = [{"k": 1e6, "c": 20.0}] * 3
    roles = SHARED, {"k": Role("varying"), "c": Role("shared")}
    shared, varying = (plan_next_test(identified(truths, each, 400), samples=400).tests[0] for each in roles)
    assert {*varying.narrowing} == {"k", "k.scatter", "c"}
    assert varying.remaining["k"] > 1.1 * shared.remaining["k"]
    assert varying.narrowing["c"] == pytest.approx(shared.narrowing["c"], abs=0.05)


@pytest.mark.parametrize(
    ("roles", "samples", "options", "message"),
    [
        (SHARED, 0, {}, "no posterior"),
        ({}, 60, {}, "every parameter is 'free'"),
        (SHARED, 60, {"noise": 0.0}, "not positive"),
        (SHARED, 60, {"noise": float("nan")}, "not positive"),
        (SHARED, 60, {"samples": 0}, "too few"),
    ],
)
def test_what_cannot_be_planned_is_explained(roles, samples, options, message):
    result = identified([{"k": 1e6, "c": 20.0}], roles, samples)
    with pytest.raises(ParameterError, match=message):
        plan_next_test(result, **options)


@pytest.fixture
def place(tmp_path, assemblies):
    """A series of one test, with candidates: the same again, and a heavier mass."""
    assembly = dovetail.load(assemblies / "sdof.yaml")
    frf = dovetail.Frf(assembly.frequency, assembly.frf({"k": 3e6, "c": 40.0}), "accelerance")
    dovetail.write_frf(dovetail.noisy_frf(frf, 0.01, 0), tmp_path / "first.csv")
    heavier = {"substructures": {"mass": {"masses": [{"mass": "2 kg"}]}}}
    described = {
        "dovetail_series": 1,
        "assembly": str(assemblies / "sdof.yaml"),
        "covariates": {"torque": "N m"},
        "tests": {"first": {"measured": "first.csv", "at": {"torque": 20}}},
        "candidates": {"again": {}, "heavier": {"change": heavier, "at": {"torque": "40 N m"}}},
        "other_parameters": "shared",
    }
    return tmp_path / "series.yaml", described


def test_the_command_lists_every_candidate(place):
    file, described = place
    file.write_text(yaml.safe_dump(described))
    done = CliRunner().invoke(app, ["plan", str(file), "--json"])
    assert done.exit_code == 0, done.output
    planned = json.loads(done.stdout)
    assert {one["name"] for one in planned["tests"]} == {"again", "heavier"}
    assert all(0.0 < one["narrowing"]["k"] < 1.0 for one in planned["tests"])
    printed = CliRunner().invoke(app, ["plan", str(file)])
    assert f"The next test that reveals most is '{planned['tests'][0]['name']}'" in " ".join(printed.stdout.split())


@pytest.mark.parametrize("option", [["--at", "mass"], ["--with-described"]])
def test_options_of_points_are_refused_for_a_series(place, option):
    file, described = place
    file.write_text(yaml.safe_dump(described))
    done = CliRunner().invoke(app, ["plan", str(file), *option])
    assert done.exit_code == 1
    assert "next test is planned" in " ".join(done.stderr.split())


@pytest.mark.parametrize(
    ("candidate", "message"),
    [
        ({"measured": "first.csv"}, "measured"),
        ({"at": {"torqe": 3}}, "'torqe' is not a covariate"),
        ({"at": {"torque": "3 N"}}, "N m"),
        ({"assembly": "none.yaml"}, "none.yaml"),
        ({"change": {"joints": {"mount": {"parameters": {"k": {"range": ["1 N/m", "2 N/m"]}}}}}}, "its range in 'odd'"),
        (3, "not a section"),
    ],
)
def test_faults_of_candidates_have_their_place(place, candidate, message):
    file, described = place
    described["candidates"]["odd"] = candidate
    file.write_text(yaml.safe_dump(described))
    with pytest.raises(dovetail.DescriptionError) as caught:
        dovetail.read_series(file)
    assert message in str(caught.value)
    assert "odd" in str(caught.value)
