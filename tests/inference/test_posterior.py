"""Samples of the parameters given the measurement, against independent computations."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import scipy
from typer.testing import CliRunner

import dovetail
from dovetail.cli.app import app
from dovetail.errors import ParameterError
from dovetail.identification.result_file import load_result
from dovetail.inference.fitting import refine
from dovetail.inference.posterior import (
    ModelError,
    Posterior,
    error_shapes,
    quantiles,
    sample_posterior,
    typical_model_error,
)
from dovetail.inference.posterior.likelihood import (
    Likelihood,
    MarginalisedResiduals,
    PosteriorResiduals,
    ReducedResiduals,
    build_likelihood,
    marginalised_squares,
    normal_from_unit,
    unit_from_normal,
)
from dovetail.inference.posterior.mode_search import _promising, search_modes
from dovetail.inference.posterior.randomize_then_optimize import LinearisedPoints, TangentMap
from dovetail.inference.posterior.tangent_mixture import TangentMixture
from dovetail.inference.posterior.tangent_steps import Density, tangent_steps
from dovetail.problem import Problem
from dovetail.problem.observations import Observations
from dovetail.problem.residuals import FrfResiduals, ModelFrfs, Weighted
from support.bent_valley import Bow
from support.noisy_measurements import noisy

ASSEMBLIES = Path(__file__).resolve().parents[2] / "assemblies"


EXACT = ModelError(0.0)


def exact_likelihood(assembly, frf):
    """The likelihood of a measurement with known noise and of a model without errors."""
    target, every = Observations.of(assembly.description, frf), np.ones(len(frf.frequency), dtype=bool)
    residual, none = target.weighted(frf.variance, every), np.zeros((0, target.residual_count(every)))
    return Likelihood(target, frf.variance, ModelFrfs.of(assembly), residual, residual, none)


def on_a_grid(assembly, frf, model_error=EXACT, widening=1.0, points=120):
    """Mean and standard deviation of two parameters, in fractions of their ranges, by brute force."""
    fit = refine(Problem.of(assembly, frf))
    likelihood = build_likelihood(Problem.of(assembly, frf), fit, model_error)
    misfit, errors = likelihood.misfit, likelihood.errors
    centre, reach = assembly.to_unit(fit.theta), widening * 6 / np.sqrt(np.diag(fit.information))
    low, high = np.clip(centre - reach, 0, 1), np.clip(centre + reach, 0, 1)
    axes = [np.linspace(a, b, points) for a, b in zip(low, high, strict=True)]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    squares = np.concatenate(
        [marginalised_squares(misfit.residuals(part), errors) for part in np.array_split(places, 60)]
    )
    weight = np.exp(-(squares - squares.min()) / 2)
    weight /= weight.sum()
    mean = weight @ places
    return mean, np.sqrt(weight @ (places - mean) ** 2)


@pytest.mark.usefixtures("few_mode_searches")
@pytest.mark.parametrize("has_phase", [True, False])
def test_the_samples_are_those_of_the_posterior_on_a_grid(sdof, has_phase):
    frf = noisy(sdof, sdof.frf(sdof.from_unit(np.array([0.4, 0.5]))), 0.2, 1, has_phase=has_phase)
    mean, deviation = on_a_grid(sdof, frf)
    found = sample_posterior(Problem.of(sdof, frf), refine(Problem.of(sdof, frf)), samples=2000, model_error=EXACT)
    ours = found.weight @ found.fraction
    assert found.converged_fraction > 0.99
    np.testing.assert_allclose(ours, mean, atol=0.12 * deviation.max())
    np.testing.assert_allclose(np.sqrt(found.weight @ (found.fraction - ours) ** 2), deviation, rtol=0.1)


def test_where_no_search_arrives_moves_from_the_peak_find_the_same_posterior(sdof, monkeypatch):
    frf = noisy(sdof, sdof.frf(sdof.from_unit(np.array([0.4, 0.5]))), 0.2, 1)
    mean, deviation = on_a_grid(sdof, frf)
    monkeypatch.setattr(TangentMixture, "_add", lambda *_: None)
    found = sample_posterior(Problem.of(sdof, frf), refine(Problem.of(sdof, frf)), samples=1000, model_error=EXACT)
    ours = found.weight @ found.fraction
    assert found.converged_fraction < 0.01
    np.testing.assert_allclose(ours, mean, atol=0.12 * deviation.max())
    np.testing.assert_allclose(np.sqrt(found.weight @ (found.fraction - ours) ** 2), deviation, rtol=0.1)


@pytest.mark.usefixtures("few_mode_searches")
@pytest.mark.parametrize(("level", "wider"), [(5e-4, 2), (2e-3, 3)])
def test_errors_of_the_model_widen_it_as_they_do_on_a_grid(sdof, level, wider):
    frf = noisy(sdof, sdof.frf(sdof.from_unit(np.array([0.4, 0.5]))), 0.05, 1)
    fit = refine(Problem.of(sdof, frf))
    _, deviation = on_a_grid(sdof, frf, typical_model_error(level), widening=30.0)
    without = sample_posterior(Problem.of(sdof, frf), fit, samples=2000, model_error=EXACT)
    found = sample_posterior(Problem.of(sdof, frf), fit, samples=2000, model_error=typical_model_error(level))
    spread = [np.sqrt(p.weight @ (p.fraction - p.weight @ p.fraction) ** 2) for p in (without, found)]
    assert spread[1][0] > wider * spread[0][0]  # the stiffness, which the natural frequency shows
    np.testing.assert_allclose(spread[1], deviation, rtol=0.05)


@pytest.mark.slow  # by default test_calibration.py counts the same of as many cases
@pytest.mark.usefixtures("few_mode_searches")
def test_intervals_hold_the_truth_as_often_as_they_say(sdof):
    rng = np.random.default_rng(5)
    inside = []
    for seed in range(60):
        fraction = rng.random(2)
        frf = noisy(sdof, sdof.frf(sdof.from_unit(fraction)), 0.1, seed)
        found = sample_posterior(
            Problem.of(sdof, frf), refine(Problem.of(sdof, frf)), samples=200, model_error=EXACT, seed=seed
        )
        low, high = quantiles(found.fraction, found.weight, [0.05, 0.95])
        inside.append((low < fraction) & (fraction < high))
    assert 0.82 <= np.mean(inside) <= 0.97  # 120 draws at 0.9: three standard deviations


def test_the_likelihood_of_a_few_lines_is_that_of_all(collet, torque_100):
    frf = noisy(collet, collet.frf(torque_100), 0.01, 2)
    likelihood = exact_likelihood(collet, frf)
    exact = likelihood.misfit
    centre = collet.to_unit(torque_100)
    near = np.clip(centre + 0.01 * np.random.default_rng(1).standard_normal((300, 12)), 0.01, 0.99)
    vectors = exact.residuals(near)
    frfs = likelihood.frf(near[:250])
    reduced = ReducedResiduals(likelihood, frfs, frfs[0])
    assert reduced.lines < 150
    inside = reduced.residuals(near[250:])
    whole = np.einsum("nm,nm->n", vectors[250:], vectors[250:])
    np.testing.assert_allclose(np.einsum("nk,nk->n", inside, inside) + reduced.outside, whole, rtol=1e-5)
    linear = reduced.linearise(near[250:252])
    step = 1e-5 * np.eye(12)[4]
    difference = (reduced.residuals(near[250:252] + step) - reduced.residuals(near[250:252] - step)) / 2e-5
    np.testing.assert_allclose(linear.jacobian[:, 4], difference, atol=1e-4 * np.abs(difference).max())


@pytest.mark.parametrize("count", [1, 2, 5, 37, 150])
def test_residuals_on_few_lines_do_not_depend_on_the_batch(collet, torque_100, count):
    """Not even in the last digit: processes share the rows of a batch, so that results would depend on their number."""
    frf = noisy(collet, collet.frf(torque_100), 0.01, 2)
    likelihood = exact_likelihood(collet, frf)
    near = collet.to_unit(torque_100) + 0.01 * np.random.default_rng(1).standard_normal((300, 12))
    fractions = np.clip(near, 0.01, 0.99)
    frfs = likelihood.frf(fractions)
    reduced = ReducedResiduals(likelihood, frfs, frfs[0])
    some = slice(100, 100 + count)
    whole, part = reduced.linearise(fractions), reduced.linearise(fractions[some])
    np.testing.assert_array_equal(part.residuals, whole.residuals[some])
    np.testing.assert_array_equal(part.jacobian, whole.jacobian[some])
    np.testing.assert_array_equal(reduced.residuals(fractions[some]), reduced.residuals(fractions)[some])


@pytest.mark.parametrize("level", [2e-3, 1e-2])
def test_a_few_lines_stand_for_averages_over_all(collet, torque_100, level):
    frf = noisy(collet, collet.frf(torque_100), 0.01, 2)
    likelihood = build_likelihood(
        Problem.of(collet, frf), refine(Problem.of(collet, frf), [torque_100]), typical_model_error(level)
    )
    assert likelihood.by_line is None
    near = collet.to_unit(torque_100) + 0.01 * np.random.default_rng(1).standard_normal((300, 12))
    fractions = np.clip(near, 0.01, 0.99)
    frfs = likelihood.frf(fractions[:250])
    reduced = ReducedResiduals(likelihood, frfs, frfs[0])
    assert reduced.lines < 60 < sum(likelihood.model.counts)
    inside = reduced.residuals(fractions[250:])
    squares = np.einsum("nk,nk->n", inside, inside) + reduced.outside
    np.testing.assert_allclose(squares, -2.0 * likelihood.log(fractions[250:]), atol=0.1)
    linear = reduced.linearise(fractions[250:252])
    step = 1e-5 * np.eye(12)[4]
    ahead, behind = (reduced.residuals(fractions[250:252] + sign * step) for sign in (1.0, -1.0))
    np.testing.assert_allclose(
        linear.jacobian[:, 4], (ahead - behind) / 2e-5, atol=1e-4 * np.abs(linear.jacobian).max()
    )


def test_each_search_reaches_the_components_that_were_drawn(sdof):
    frf = noisy(sdof, sdof.frf(sdof.from_unit(np.array([0.4, 0.5]))), 0.1, 3)
    residual = Weighted.against(frf, frf.variance, np.ones(len(frf.frequency), dtype=bool))
    problem = PosteriorResiduals(FrfResiduals(sdof, residual))
    anchor = LinearisedPoints.at(problem, normal_from_unit(np.array([[0.4, 0.5]])))
    tangent_map = TangentMap(problem, anchor)
    target = tangent_map.components(anchor.residuals) + np.random.default_rng(0).standard_normal((20, 2))
    ends, converged = tangent_map.solve(target, LinearisedPoints.at(problem, np.broadcast_to(anchor.z, (20, 2))), 100)
    assert converged.all()
    np.testing.assert_allclose(tangent_map.components(ends.residuals), target, atol=0.02)


def test_metropolis_steps_from_one_end_of_a_bent_valley_sample_its_distribution():
    problem, random = Bow(), np.random.default_rng(0)
    places = LinearisedPoints.at(problem, np.tile([[1.6, 1.56]], (1500, 1)))
    places, taken, _ = tangent_steps(Density.of(problem), places, random, 40)
    assert taken > 0.3
    along = np.linspace(-4, 4, 4001)
    density = np.exp(-(along**2 + (along**2 - 1.0) ** 2) / 2)  # the narrow direction is integrated out
    for end in (0.3, 0.7, 1.2):
        wanted = density[np.abs(along) > end].sum() / density.sum()
        assert np.mean(np.abs(places.z[:, 0]) > end) == pytest.approx(wanted, abs=0.035)  # three standard errors
    assert abs(places.z[:, 0].mean()) < 0.12
    np.testing.assert_allclose(places.z[:, 1], places.z[:, 0] ** 2 - 1.0, atol=0.05)


def test_the_highest_peak_is_found_where_the_best_fit_is_another(collet):
    random = np.random.default_rng([0, 11])
    fraction = random.random(12)
    values = collet.frf(collet.from_unit(fraction))
    deviation = 0.01 * values.std()
    real, imaginary = random.standard_normal((2, len(values)))
    variance = np.full(len(values), deviation**2)
    shown = values + deviation * (real + 1j * imaginary) / np.sqrt(2)
    frf = dovetail.Frf(collet.frequency, shown, "accelerance", variance=variance)
    fit = refine(Problem.of(collet, frf), seed=11)
    best, likelihood = collet.to_unit(fit.theta), exact_likelihood(collet, frf)
    others = search_modes(Problem.of(collet, frf), likelihood, best, np.random.default_rng(0))
    best = unit_from_normal(others[-1])  # the lowest peak in place of the best fit
    modes = search_modes(Problem.of(collet, frf), likelihood, best, np.random.default_rng(0))
    problem = PosteriorResiduals(likelihood.misfit)
    places = np.concatenate([modes, normal_from_unit(np.stack([np.clip(best, 0.02, 0.98), fraction]))])
    squares = np.sum(problem.residuals(places) ** 2, axis=1)
    assert squares[0] == squares.min()
    assert squares[-2] > squares[-1]  # the best fit is on another peak than the truth


def test_errors_of_the_model_scale_residuals_to_their_sum_of_squares(sdof):
    frf = noisy(sdof, sdof.frf(), 0.05, 1)
    residual = Weighted.against(frf, frf.variance, np.ones(len(frf.frequency), dtype=bool))
    misfit, values = FrfResiduals(sdof, residual), sdof.frf()
    shapes = np.concatenate(list(error_shapes([frf], [values], typical_model_error(2e-3)).values()))
    errors = residual.jacobian(values[None], shapes[None])[0]
    places = np.random.default_rng(0).random((5, 2))
    scaled = MarginalisedResiduals(misfit, errors).linearise(places)
    squares = marginalised_squares(misfit.residuals(places), errors)
    np.testing.assert_allclose(scaled.cost, squares, rtol=1e-9)
    weighted = MarginalisedResiduals(misfit, errors).weighted(3.0)
    np.testing.assert_allclose(weighted.squares(misfit.residuals(places)), weighted.linearise(places).cost, rtol=1e-9)
    rough = MarginalisedResiduals(misfit, errors).weighted(0.1, least_error=1e-2)
    exact, costs = marginalised_squares(0.1 * misfit.residuals(places), 0.1 * errors), rough.linearise(places).cost
    assert (costs > 1.0000001 * exact).all()  # errors are left out
    assert (costs <= 1.01 * exact).all()
    step = np.array([1e-6, 0.0])
    ahead, behind = (MarginalisedResiduals(misfit, errors).residuals(places + sign * step) for sign in (1, -1))
    np.testing.assert_allclose(
        scaled.jacobian[:, 0], (ahead - behind) / 2e-6, atol=1e-4 * np.abs(scaled.jacobian).max()
    )


def test_the_posterior_of_the_shipped_measurement_reports_what_it_determines(collet, assemblies):
    frf = dovetail.read_frf(assemblies / "measurements" / "h0_j_t0_60Nm.uff")
    result = dovetail.identify(collet, frf, "posterior", samples=400, seed=2)
    words = {name: verdict.word for name, verdict in result.posterior.verdicts.items()}
    assert {words["kr_tc"], words["cr_tc"]} == {"identified"}
    assert {words["dc"], words["ct_tc"], words["ct_hc"]} == {"not identifiable"}
    assert "hardly depends on it" in result.posterior.verdicts["dc"].reason
    low, high = result.interval["kr_tc"]
    assert low < 19023.588 < high  # the truth next to the measurement
    assert high - low < 0.1 * (6e4 - 2e3)  # identified: a tenth of the range, where the prior has nine tenths
    plain = result.to_dict()
    assert plain["posterior"]["parameters"]["kr_tc"]["interval"] == [low, high]


def test_a_parameter_at_the_end_of_its_range_is_reported():
    random = np.random.default_rng(4)
    half = np.abs(random.standard_normal(4000))
    normal = random.standard_normal(4000)
    fraction = {
        "lower": 0.02 * half,
        "upper": 1.0 - 0.3 * half / half.max(),
        "near": 0.03 + 0.005 * normal,
        "even": random.random(4000),
        "inside": 0.5 + 0.01 * normal,
    }
    columns = np.stack(list(fraction.values()), axis=1)
    posterior = Posterior(
        names=tuple(fraction),
        theta=1.0 + columns,  # of a range from 1 to 2
        fraction=columns,
        weight=np.full(4000, 1 / 4000),
        estimate=1.0 + columns.mean(axis=0),
        model_error=EXACT,
        searches=4000,
        lines=10,
        seconds=0.0,
    )
    assert "lower end of its range" in posterior.verdicts["lower"].reason
    assert "upper end of its range" in posterior.verdicts["upper"].reason
    assert posterior.verdicts["near"].reason == "The measurement fixes it."  # near the end, but not for its sake
    assert posterior.verdicts["even"].reason == "The measurement hardly depends on it."
    assert posterior.verdicts["inside"].reason == "The measurement fixes it."
    assert posterior.effective_sample_size == pytest.approx(4000)


@pytest.mark.slow
def test_the_intervals_hold_what_a_finer_mesh_hides(collet, assemblies):
    """Of 36 intervals, at 0.9."""
    folder = assemblies / "campaign" / "measurements"
    truth = json.loads((folder / "truth.json").read_text())["tests"]
    held = 0
    for torque in (20, 60, 100):
        frf = dovetail.read_frf(folder / f"h0_j{torque}_t0.uff", accelerometer_mass=1.2e-3)
        interval = dovetail.identify(collet, frf, "posterior", samples=200).interval
        held += sum(
            low <= truth[f"h0_j{torque}_t0"]["parameters"][name] <= high for name, (low, high) in interval.items()
        )
    assert held >= 30


def test_weighted_quantiles_are_those_of_repeated_values():
    rng = np.random.default_rng(0)
    values, weight = rng.random((400, 1)), rng.random(400)
    repeated = np.repeat(values, np.round(1000 * weight).astype(int), axis=0)
    for level in (0.05, 0.5, 0.95):
        (ours,) = quantiles(values, weight / weight.sum(), [level])
        assert ours[0] == pytest.approx(np.quantile(repeated, level), abs=0.005)


def test_a_band_allows_the_error_that_nothing_explains(sdof):
    """The middle 90 % of amplitudes that err by half of the FRF, as complex normal numbers do."""
    result = dovetail.identify(sdof, noisy(sdof, sdof.frf(), 0.001, 1), "posterior", form="laplace")
    errors = ModelError(0.0, other=0.5)
    band = dovetail.predict_band(sdof, replace(result, posterior=replace(result.posterior, model_error=errors)))
    normal = np.random.default_rng(0).standard_normal((100_000, 2)) @ [1.0, 1.0j] / np.sqrt(2.0)
    lower, upper = np.quantile(np.abs(1.0 + 0.5 * normal), [0.05, 0.95])
    amplitude = np.abs(dovetail.predict(sdof, result).values)
    assert np.median(band.lower / amplitude) == pytest.approx(lower, rel=0.05)
    assert np.median(band.upper / amplitude) == pytest.approx(upper, rel=0.05)


def test_no_band_without_a_posterior_and_no_samples_at_all(sdof):
    frf = noisy(sdof, sdof.frf(), 0.1, 1)
    refined = dovetail.identify(sdof, frf, "refined")
    assert refined.interval is None
    with pytest.raises(ParameterError, match="does not say how sure it is"):
        dovetail.predict_band(sdof, refined)
    for options, message in (
        ({"samples": 0}, "0 must be at least 20"),
        ({"model_error": -1.0}, "not a relative error"),
    ):
        with pytest.raises(ParameterError, match=message):
            dovetail.identify(sdof, frf, "posterior", **options)


def test_a_stored_result_gives_the_same_band(sdof, tmp_path):
    result = dovetail.identify(sdof, noisy(sdof, sdof.frf(), 0.1, 1), "posterior", samples=100)
    (tmp_path / "result.json").write_text(json.dumps(result.to_dict()))
    again = load_result(tmp_path)
    for name, ends in result.interval.items():
        assert again.interval[name] == pytest.approx(ends)
        assert again.posterior.verdicts[name].word == result.posterior.verdicts[name].word
    ours, theirs = dovetail.predict_band(sdof, again), dovetail.predict_band(sdof, result)
    np.testing.assert_allclose(ours.upper, theirs.upper, rtol=1e-12)
    done = CliRunner().invoke(
        app, ["predict", str(ASSEMBLIES / "sdof.yaml"), str(tmp_path), "--band", str(tmp_path / "band.csv")]
    )
    assert done.exit_code == 0, done.output
    band = np.loadtxt(tmp_path / "band.csv", delimiter=",", skiprows=2)
    np.testing.assert_allclose(band[:, 3], ours.upper)
    spoilt = result.to_dict()
    spoilt["posterior"]["samples"]["weight"] = [1.0]
    (tmp_path / "result.json").write_text(json.dumps(spoilt))
    with pytest.raises(dovetail.DovetailError, match="do not fit its parameters"):
        load_result(tmp_path)


def test_a_few_lines_stand_for_averages_of_responses_whose_units_differ():
    """A receptance is a millionth of an accelerance, and shows as much."""
    mounts = {
        f"mount{number}": {
            "model": "spring_damper",
            "direction": "x",
            "connect": {"a": {"to": part, "at": 0}, "b": {"to": below, "at": 0}},
            "parameters": {"k": {"range": [1e5, 1e7]}, "c": {"range": [1, 100]}},
        }
        for number, (part, below) in enumerate([("lower", "base"), ("upper", "lower")])
    }
    assembly = dovetail.load(
        {
            "dovetail": 1,
            "name": "two quantities",
            "frequency": {"start": "20 Hz", "stop": "500 Hz", "lines": 400},
            "substructures": {
                "lower": {"model": "lumped", "masses": [{"mass": "1 kg"}]},
                "upper": {"model": "lumped", "masses": [{"mass": "2 kg"}]},
                "base": {"model": "ground"},
            },
            "joints": mounts,
            "responses": [
                {"at": "upper", "position": 0, "quantity": "accelerance"},
                {"at": "lower", "position": 0, "quantity": "receptance"},
            ],
            "identification": {"samples": 100},
        }
    )
    truth = assembly.from_unit(np.full(4, 0.5))
    frfs = [noisy(each, each.frf(truth), 0.01, seed) for seed, each in enumerate(assembly.each_response)]
    likelihood = build_likelihood(
        Problem.of(assembly, frfs), refine(Problem.of(assembly, frfs), [truth]), typical_model_error(2e-3)
    )
    near = 0.5 + 1e-3 * np.random.default_rng(1).standard_normal((300, 4))
    snapshots = likelihood.frf(near[:250])
    reduced = ReducedResiduals(likelihood, snapshots, snapshots[0])
    inside = reduced.residuals(near[250:])
    squares = np.einsum("nk,nk->n", inside, inside) + reduced.outside
    np.testing.assert_allclose(squares, -2.0 * likelihood.log(near[250:]), atol=0.1)


@pytest.mark.parametrize(("chi_squared", "every", "kept"), [(1350, 1, True), (1500, 1, False), (1500, 50, True)])
def test_points_that_few_lines_show_to_be_hopeless_are_left_out(chi_squared, every, kept):
    """By every fiftieth line chi-squared is uncertain: by 5 standard errors of about 310 here."""
    of_lines = np.random.default_rng(0).standard_normal(1000 // every) * np.sqrt(every)
    best = of_lines * np.sqrt(1000.0 / np.sum(of_lines**2))
    posterior = SimpleNamespace(residuals=lambda z: np.stack([best, best * np.sqrt(chi_squared / 1000.0)]))
    assert len(_promising(posterior, np.zeros((2, 0)), every)) == 1 + kept


@pytest.mark.sweep(keep=3)
@pytest.mark.parametrize("count", [20, 50, 400])
@pytest.mark.parametrize("uneven", [False, True])
def test_intervals_of_few_samples_hold_nine_tenths_of_further_draws(count, uneven):
    """Weights of 1 and 2 in turn count as nine tenths of the samples."""
    random = np.random.default_rng(0)
    weight = np.tile([1.0, 2.0], count // 2) if uneven else np.ones(count)
    samples = random.standard_normal((count, 20_000))
    low, high = quantiles(samples, weight / weight.sum(), [0.05, 0.95])
    held = scipy.stats.norm.cdf(high) - scipy.stats.norm.cdf(low)
    assert held.mean() == pytest.approx(0.9, abs=0.006)
