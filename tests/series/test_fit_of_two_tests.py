"""A mass on a mount, measured once or twice: the fitted values, and the warning when tests contradict their roles."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import dovetail
from dovetail.cli.app import app
from dovetail.registry import installed_components
from dovetail.series.description import Covariate, Role, SeriesDescription, SeriesTest
from dovetail.series.fitted_tests import fit_test
from dovetail.series.fitting import SeriesFit, fit_series
from dovetail.series.unknowns import SeriesUnknowns

ASSEMBLY = Path(__file__).parents[2] / "assemblies" / "sdof.yaml"


def series_of(folder: Path, stiffnesses: dict[str, float], **parameters: str) -> Path:
    """Write measurements with these stiffnesses, N/m, and 20 N s/m, and a description of the series."""
    assembly = dovetail.load(ASSEMBLY)
    lines = ["dovetail_series: 1", f"assembly: {ASSEMBLY}", "tests:"]
    for number, (name, k) in enumerate(stiffnesses.items()):
        frf = dovetail.Frf(assembly.frequency, assembly.frf({"k": k, "c": 20.0}), "accelerance")
        dovetail.write_frf(dovetail.noisy_frf(frf, 0.01, number), folder / f"{name}.csv")
        lines.append(f"  {name}: {{measured: {name}.csv}}")
    lines += ["parameters:", *(f"  {name}: {role}" for name, role in parameters.items())]
    file = folder / "series.yaml"
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file


def loaded_series_of(folder: Path, stiffnesses: dict[str, float], **parameters: str) -> Path:
    """Write the same with a load for each test: 1 N for the first, 2 N for the second, and so on."""
    series = series_of(folder, stiffnesses, **parameters)
    text = series.read_text(encoding="utf-8")
    for number, name in enumerate(stiffnesses):
        text = text.replace(f"{name}.csv}}", f"{name}.csv, at: {{load: {number + 1.0}}}}}")
    series.write_text(text.replace("tests:", "covariates: {load: N}\ntests:"), encoding="utf-8")
    return series


def test_a_shared_damping_and_two_stiffnesses_are_identified(tmp_path):
    truth = {"loose": 1e6, "tight": 3e6}
    result = dovetail.identify_series(series_of(tmp_path, truth, k="free", c="shared"), "refined")
    assert result.is_trustworthy, result.warning
    (damping,) = result.rows
    assert abs(damping.fit - 20.0) < 4.0 * damping.deviation
    for index, name in enumerate(truth):
        stiffness, same_damping = result.rows_of(index)
        assert abs(stiffness.fit - truth[name]) < 4.0 * stiffness.deviation
        assert same_damping.fit == pytest.approx(damping.fit)


def test_a_series_of_one_test_gives_the_parameters_of_a_single_identification(tmp_path):
    series = series_of(tmp_path, {"only": 2e6}, k="shared", c="free")
    joint = dovetail.identify_series(series, "refined")
    single = dovetail.identify(ASSEMBLY, tmp_path / "only.csv", "refined")
    np.testing.assert_allclose(joint.theta(0), single.theta, rtol=1e-5)


def test_tests_that_contradict_a_shared_stiffness_make_the_exit_code_3(tmp_path):
    series = series_of(tmp_path, {"loose": 1e6, "tight": 1.2e6}, k="shared", c="shared")
    done = CliRunner().invoke(app, ["identify-series", str(series), "--method", "refined"])
    assert done.exit_code == 3, done.output
    assert "The tests contradict the relations between them" in " ".join(done.output.split())


def test_a_collet_at_five_torques_is_fitted_as_well_as_each_test_alone():
    """The starts near the fits to each test alone all end in local minima, 60 times the sum of squares."""
    model = dovetail.load(ASSEMBLY.parent / "campaign" / "h0_t0.yaml").on(np.linspace(100.0, 9000.0, 600))
    law = Role("law", installed_components().create("law", "linear"), "torque")
    torques = (20.0, 40.0, 60.0, 80.0, 100.0)
    tests = tuple(SeriesTest(f"T{torque:.0f}", model, (), {"torque": torque}) for torque in torques)
    stiffnesses = dict.fromkeys(("kt_tc", "kr_tc", "kt_hc", "kr_hc"), law)
    covariates = {"torque": Covariate("torque", "N m")}
    unknowns = SeriesUnknowns(SeriesDescription("collet", tests, covariates, stiffnesses, Role("shared")))
    random, fitted = np.random.default_rng([1, 0, 55]), []
    z = random.uniform(-1.0, 1.0, (1, unknowns.count))
    for index, test in enumerate(tests):
        theta = model.from_unit(unknowns.maps[index].fractions(unknowns.for_test(index, z)))[0]
        fitted.append(fit_test(test, [dovetail.noisy_frf(model.simulate(theta), 0.01, random)], 0, 0.0))
    fit = fit_series(unknowns, fitted)
    assert fit.contradiction > 1e-3
    assert fit.squares.sum() < 1.1 * fit.squares_alone.sum()


@pytest.mark.parametrize("role", ["varying", "{role: varying, law: linear, over: load}"])
def test_a_stiffness_that_varies_widely_from_test_to_test_is_found_in_each(tmp_path, role):
    """The first standard deviation is too small for it, and one near zero would hold the values together."""
    truth = {"loose": 3e5, "usual": 1e6, "tight": 6e6}
    result = dovetail.identify_series(loaded_series_of(tmp_path, truth, k=role, c="shared"), "refined")
    assert result.is_trustworthy, result.warning
    for index, value in enumerate(truth.values()):
        stiffness = result.rows_of(index)[0]
        assert abs(stiffness.fit - value) < 5.0 * stiffness.deviation


@pytest.mark.parametrize(
    ("role", "degree"), [("varying", 0), ("{role: varying, law: linear, over: load}", 1)], ids=["mean", "law"]
)
def test_mean_law_and_scatter_of_well_known_values_are_those_of_a_regression(tmp_path, role, degree):
    """Means and deviations can only change together there, in a valley that a search follows slowly."""
    truth = {"A": 2e6, "B": 2.3e6, "C": 2.2e6, "D": 3.1e6, "E": 2.9e6, "F": 3.4e6}
    result = dovetail.identify_series(loaded_series_of(tmp_path, truth, k=role, c="shared"), "refined")
    found = {row.name: row.fit for row in result.rows if row.name.startswith("k")}
    values, loads = np.array(list(truth.values())), np.arange(1.0, 7.0)
    line = np.polynomial.Polynomial.fit(loads, values, degree)
    scatter = found.pop("k.scatter")
    np.testing.assert_allclose([*found.values()], line(loads[[0, -1]])[: degree + 1], rtol=1e-3)
    freedom = len(values) - degree - 1
    expected = np.sqrt(np.sum((values - line(loads)) ** 2) / freedom) / (1e7 - 1e5)
    assert scatter == pytest.approx(expected, rel=5e-3)


def test_a_normal_prior_pulls_the_mean_of_well_known_values(tmp_path):
    values = {"A": 2e6, "B": 2.3e6, "C": 2.2e6, "D": 3.1e6, "E": 2.9e6, "F": 3.4e6}
    series = series_of(tmp_path, values, k="varying", c="shared")
    prior = {"k": {"about": "2e6 N/m", "sd": "20 %"}}
    described = {"extends": str(ASSEMBLY), "joints": {"mount": {"parameters": prior}}}
    (tmp_path / "prior.yaml").write_text(json.dumps(described), encoding="utf-8")
    text = series.read_text(encoding="utf-8").replace(f"assembly: {ASSEMBLY}", "assembly: prior.yaml")
    series.write_text(text, encoding="utf-8")
    result = dovetail.identify_series(series, "refined")
    found = {row.name: row.fit for row in result.rows}
    parameter = result.tests[0].test.assembly.parameters[0]
    scatter = found["k.scatter"] * (parameter.upper - parameter.lower)
    of_tests, of_prior = len(values) / scatter**2, 1.0 / 4e5**2
    expected = (np.mean(list(values.values())) * of_tests + 2e6 * of_prior) / (of_tests + of_prior)
    assert found["k"] == pytest.approx(expected, rel=1e-2)  # the ends of the range cut the scatter off


def test_a_poor_fit_of_all_tests_warns_without_relations_too():
    """A law with as many numbers as tests, and deviations from it, can follow any values."""
    fit = SeriesFit(np.zeros(1), None, np.array([1e6, 1e6]), np.array([10.0, 10.0]), constraints=-1, deviations=2)
    assert fit.contradiction < 1e-9
    assert replace(fit, squares=fit.squares_alone + 0.5).contradiction > 0.1
