"""Prediction between and beyond the tests, and each test from the others."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import dovetail
from dovetail import ParameterError
from dovetail.cli.app import app
from dovetail.registry import installed_components
from dovetail.series.description import Role
from dovetail.series.fitting import fit_series
from dovetail.series.prediction import most_central
from dovetail.series.result import SeriesIdentification
from dovetail.series.sampling import sample_series
from dovetail.series.unknowns import SeriesUnknowns
from support.mounts_in_series import mount, series

RANGES = {
    "k": {"range": ["5e5 N/m", "2e6 N/m"], "scale": "log"},
    "c": {"range": ["5 N s/m", "100 N s/m"], "scale": "log"},
}
LINES = np.arange(100.0, 240.0, 4.0)
LEVELS = [1.0, 2.0, 3.0, 5.0]
LAW = Role("law", installed_components().create("law", "linear"), "level")


def stiffness(level):
    """The true law: linear on the logarithmic scale."""
    return 8e5 * (1.4e6 / 8e5) ** ((level - 1.0) / 4.0)


def identified(roles, truths, levels=LEVELS, noise=0.05):
    described, fitted = series(mount(RANGES, LINES), truths, roles, noise, levels)
    unknowns = SeriesUnknowns(described)
    fit = fit_series(unknowns, fitted)
    return SeriesIdentification(described, fitted, unknowns, fit, sample_series(unknowns, fitted, fit, samples=200))


@pytest.fixture(scope="module")
def result():
    truths = [{"k": stiffness(level), "c": 25.0} for level in LEVELS]
    return identified({"k": LAW, "c": Role("shared")}, truths)


@pytest.mark.parametrize("level", [1.5, 4.0, 5.5])
def test_the_frf_at_another_level_lies_within_its_band(result, level):
    predicted = dovetail.predict_test(result, {"level": level})
    truth = mount(RANGES, LINES).frf({"k": stiffness(level), "c": 25.0})
    inside = (predicted.band.lower <= np.abs(truth)) & (np.abs(truth) <= predicted.band.upper)
    assert inside.mean() > 0.6
    middle, low, high = predicted.intervals["k"]
    assert low < middle < high
    assert 0.98 * low < stiffness(level) < 1.02 * high
    assert bool(predicted.warnings) == (level > 5.0)


def test_the_frf_of_a_prediction_has_the_parameters_of_one_sample():
    """Samples along a ridge keep their natural frequency, which medians of each parameter need not have."""
    frequency = np.linspace(100.0, 200.0, 200)
    poles = np.array([150.0, 149.0, 151.0, 150.2, 149.7])
    frfs = 1.0 / (1.0 - (frequency / poles[:, np.newaxis]) ** 2 + 0.01j)
    assert most_central(frfs) == 0
    assert most_central(frfs[[1, 2, 4]]) == 2


def test_extrapolation_is_reported_in_the_frf_and_its_band(result):
    predicted = dovetail.predict_test(result, {"level": "6"})
    (warning,) = predicted.warnings
    assert "level = 6 is outside the tests (1 to 5): its laws are extrapolated" in warning
    assert predicted.frf.note == predicted.band.warning == warning


def test_free_values_of_another_test_are_anywhere_in_their_range():
    result = identified({"k": LAW}, [{"k": stiffness(level), "c": 25.0} for level in LEVELS])
    predicted = dovetail.predict_test(result, {"level": 2.5})
    assert "says nothing about c of another test" in predicted.warnings[0]
    _, low, high = predicted.intervals["c"]
    assert high / low > 8.0


def test_values_that_vary_scatter_anew_in_a_prediction():
    random = np.random.default_rng(3)
    truths = [{"k": 1e6 * np.exp(0.05 * random.standard_normal()), "c": 25.0} for _ in range(6)]
    result = identified({"k": Role("varying"), "c": Role("shared")}, truths, [float(n) for n in range(6)])
    _, low, high = dovetail.predict_test(result, {}).intervals["k"]
    of_mean = result.posterior.shared.interval()["k"]
    assert high / low > of_mean[1] / of_mean[0]
    assert high / low > np.exp(2.0 * 0.05)


WRONG = [
    ({"level": "2 kg"}, "at.level"),
    ({"levle": 2.0}, "Did you mean 'level'"),
    ({}, "a law runs over 'level', which is not given"),
]


@pytest.mark.parametrize(("at", "expected"), WRONG)
def test_covariates_that_do_not_fit_are_refused(result, at, expected):
    with pytest.raises(ParameterError) as error:
        dovetail.predict_test(result, at)
    assert expected in str(error.value)


def test_each_test_is_predicted_from_the_others(result):
    left_out = dovetail.leave_one_out(result, samples=200)
    assert [one.test for one in left_out] == ["T0", "T1", "T2", "T3"]
    assert [one.extrapolated for one in left_out] == [True, False, False, True]
    assert np.mean([one.coverage for one in left_out]) == pytest.approx(0.9, abs=0.08)
    assert max(one.frequency_error for one in left_out) < 0.01


def test_the_log_predictive_density_of_a_test_is_that_of_samples_of_its_parameters(result):
    """All of its parameters are known from the others, so that plain averages over samples converge."""
    from dovetail.series.prediction import drawn_fractions

    left_out = dovetail.leave_one_out(result, samples=400)[1]
    fitted = result.tests[1]
    described = result.series.without("T1")
    others = tuple(one for one in result.tests if one is not fitted)
    unknowns = SeriesUnknowns(described)
    fit = fit_series(unknowns, others)
    without = SeriesIdentification(described, others, unknowns, fit, sample_series(unknowns, others, fit, samples=400))
    fractions = drawn_fractions(without, fitted.test, 20_000, np.random.default_rng(0))
    likelihood = fitted.likelihood()
    log_density = likelihood.log(fractions) + likelihood.log_constant
    expected = np.log(np.exp(log_density - log_density.max()).mean()) + log_density.max()
    assert left_out.evidence.log == pytest.approx(expected, abs=0.2)


def test_the_curve_of_a_law_passes_through_the_values_of_the_tests(result):
    covariate, low, middle, high = result.law_curve("k", 5)
    np.testing.assert_allclose(covariate, [1.0, 2.0, 3.0, 4.0, 5.0])
    np.testing.assert_allclose(middle, [stiffness(level) for level in covariate], rtol=0.02)
    assert (low < high).all()


def test_the_command_writes_frf_and_band_and_prints_each_test_left_out(tmp_path):
    assembly, lines = mount(RANGES, LINES), ["dovetail_series: 1", "covariates: {level: 1}", "tests:"]
    described = tmp_path / "mount.yaml"
    from support.mounts_in_series import ASSEMBLY

    described.write_text(
        f"extends: {ASSEMBLY}\n"
        "joints: {mount: {parameters: {k: {range: [5e5 N/m, 2e6 N/m], scale: log}, "
        "c: {range: [5 N s/m, 100 N s/m]}}}}\n"
    )
    for number, level in enumerate(LEVELS):
        frf = dovetail.Frf(assembly.frequency, assembly.frf({"k": stiffness(level), "c": 25.0}), "accelerance")
        dovetail.write_frf(dovetail.noisy_frf(frf, 0.02, number), tmp_path / f"{number}.csv")
        lines.append(f"  T{number}: {{measured: {number}.csv, at: {{level: {level}}}}}")
    lines += ["assembly: mount.yaml", "parameters: {k: {law: linear, over: level}, c: shared}"]
    (tmp_path / "series.yaml").write_text("\n".join(lines) + "\n")
    file, band = tmp_path / "predicted.csv", tmp_path / "band.csv"
    arguments = ["predict-series", str(tmp_path / "series.yaml"), "--samples", "50"]
    done = CliRunner().invoke(app, [*arguments, "--at", "level=7", "-o", str(file), "--band", str(band)])
    assert done.exit_code == 0, done.output
    assert "its laws are extrapolated" in " ".join(done.output.split())
    assert "extrapolated" in band.read_text()
    assert dovetail.read_frf(file).frequency[0] == 1.0
    done = CliRunner().invoke(app, [*arguments, "--leave-one-out", "--json"])
    assert done.exit_code == 0, done.output
    assert [*json.loads(done.output)["left_out"]] == ["T0", "T1", "T2", "T3"]
    done = CliRunner().invoke(app, [*arguments, "--leave-one-out", "--at", "level=7"])
    assert done.exit_code == 1
