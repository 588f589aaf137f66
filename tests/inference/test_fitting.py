"""Parameters fitted to the measured FRF itself."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.optimize import least_squares

import dovetail
from dovetail.errors import MeasurementError, ParameterError
from dovetail.inference.fitting import multistart, refine, searches
from dovetail.inference.fitting.profiles import profiles
from dovetail.inference.fitting.searches import Profiles
from dovetail.interfaces import TimeLimit
from dovetail.measurement import complex_noise
from dovetail.problem import Problem
from dovetail.problem.least_squares import Linearisation, SumOfSquares, minimise
from dovetail.problem.observations import Observations
from dovetail.problem.random_error import estimated_variance, isolated_lines
from dovetail.problem.residuals import FrfResiduals, LogAmplitude, Weighted
from support.noisy_measurements import noisy


def measured_of(assembly, theta, noise=0.0, seed=0, **of_frf):
    values = complex_noise(assembly.frf(theta), noise, seed)
    return dovetail.Frf(assembly.frequency, values, "accelerance", **of_frf)


def random_vectors(assembly, count, seed=0):
    return assembly.from_unit(np.random.default_rng(seed).random((count, len(assembly.parameters))))


class Rosenbrock(SumOfSquares):
    """The valley that every optimiser knows, in the unit cube, its minimum at (3/4, 3/4) or beyond a wall."""

    def __init__(self, wall=1.0):
        self._wall = wall

    def residuals(self, position):
        x, y = (4 * position * self._wall - 2).T
        return np.stack([10 * (y - x**2), 1 - x], axis=1)

    def linearise(self, position):
        x = 4 * position[:, 0] * self._wall - 2
        jacobian = np.zeros((len(x), 2, 2))
        jacobian[:, 0, 0], jacobian[:, 0, 1], jacobian[:, 1, 0] = -20 * x, -1, 10
        jacobian *= 4 * self._wall
        residuals = self.residuals(position)
        return Linearisation(residuals, jacobian)


def test_searches_follow_the_valley_to_the_minimum():
    starts = np.random.default_rng(0).random((20, 2))
    found = minimise(Rosenbrock(), starts, tolerance=1e-12, most_steps=200)
    np.testing.assert_allclose(found.position, 0.75, atol=1e-6)
    assert found.steps.max() < 60


def test_a_minimum_at_a_wall_is_that_of_another_optimiser():
    problem, start = Rosenbrock(0.6), np.array([[0.1, 0.9], [0.5, 0.5]])
    found = minimise(problem, start, tolerance=1e-12, most_steps=200)
    other = least_squares(lambda u: problem.residuals(u[None])[0], [0.5, 0.5], bounds=(0, 1), xtol=1e-12)
    assert other.x[0] == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_allclose(found.position, np.broadcast_to(other.x, (2, 2)), atol=1e-4)


def rosenbrock_with_one_axis_fixed(problem, axis, value, other):
    """Return residuals where one coordinate has a value and the other one is free."""
    return problem.residuals(np.insert(other, axis, value)[np.newaxis])[0]


def test_a_profile_is_the_least_sum_of_squares_over_the_other_coordinate():
    """On both sides of a start in a wrong place, and on the bounds, as another optimiser has it."""
    problem, values = Rosenbrock(0.6), (np.arange(24) + 0.5) / 24
    followed = profiles(problem, np.array([0.3, 0.4]), values, steps=30)
    for axis in (0, 1):
        for value, cost in zip(values.tolist(), followed.cost[axis], strict=True):
            alone = partial(rosenbrock_with_one_axis_fixed, problem, axis, value)
            ends = [2 * least_squares(alone, [start], bounds=(0, 1)).cost for start in (0.1, 0.4, 0.7, 1.0)]
            assert np.isclose(cost, ends, rtol=1e-3, atol=1e-3).any()
    assert (followed.position[0, :, 0] == values).all()
    squares = np.array([np.sum(problem.residuals(row) ** 2, axis=1) for row in followed.position])
    np.testing.assert_allclose(squares, followed.cost)


def test_profiles_report_each_value_and_end_with_the_time():
    problem, values, reported = Rosenbrock(0.6), (np.arange(24) + 0.5) / 24, []
    whole = profiles(problem, np.array([0.5, 0.5]), values, 30, lambda: reported.append(1))
    assert len(reported) == 12  # of either side
    assert 48 <= whole.steps <= 48 * 30
    problem.limit = TimeLimit()
    reported.clear()
    cut = profiles(problem, np.array([0.5, 0.5]), values, 30, lambda: reported.append(problem.limit.stop()))
    assert len(reported) == 1
    assert np.isfinite(cut.cost[:, 11:13]).all()
    assert np.count_nonzero(np.isfinite(cut.cost)) == 4


def test_low_points_of_profiles_are_minima_between_rises_away_from_the_start():
    cost = np.array([[9.0, 5.0, 9.0, 0.0, 9.0, 5.5, 5.0, 5.4, 9.0, 3.0], np.linspace(0.0, 9.0, 10)])
    position = np.random.default_rng(0).random((2, 10, 2))
    along = Profiles((np.arange(10) + 0.5) / 10, cost, position)
    low = along.low_points(np.array([0.35, 0.5]), most=4)
    wanted = [position[1, 0], position[0, 9], position[0, 1], position[0, 6]]
    np.testing.assert_array_equal(low, wanted)
    assert along.low_points(np.array([0.35, 0.5]), most=0).shape == (0, 2)


def test_searches_in_a_batch_equal_separate_searches(sdof):
    target = measured_of(sdof, sdof.from_unit(np.array([0.3, 0.6])), 0.01)
    problem = FrfResiduals(sdof, LogAmplitude(target, np.full(len(target.frequency), 1e-6)))
    starts = np.random.default_rng(1).random((5, 2))
    together = minimise(problem, starts, tolerance=1e-6, most_steps=50)
    alone = [minimise(problem, start[None], tolerance=1e-6, most_steps=50) for start in starts]
    np.testing.assert_array_equal(together.position, np.concatenate([one.position for one in alone]))
    np.testing.assert_array_equal(together.steps, np.concatenate([one.steps for one in alone]))


@pytest.mark.parametrize("kind", ["complex", "amplitude", "logarithm"])
def test_the_derivatives_are_those_of_the_residuals(collet, torque_20, kind):
    target = noisy(collet, collet.frf(torque_20), 0.01, 1, has_phase=kind != "amplitude")
    residual = (
        LogAmplitude(target, target.variance)
        if kind == "logarithm"
        else Weighted.against(target, target.variance, np.arange(len(target.frequency)) % 7 > 0)
    )
    problem, at = FrfResiduals(collet, residual), np.linspace(0.3, 0.7, 12)
    linear = problem.linearise(at[None])
    np.testing.assert_array_equal(linear.residuals, problem.residuals(at[None]))
    for column in range(12):
        step = 5e-5 * np.eye(12)[column]
        above, below = problem.residuals(np.stack([at + step, at - step]))
        exact = linear.jacobian[0, column]
        assert np.abs((above - below) / 1e-4 - exact).max() <= 1e-4 * np.abs(exact).max()


@pytest.mark.parametrize("has_phase", [True, False])
def test_noise_leaves_a_chi_squared_of_one(collet, has_phase):
    for seed, theta in enumerate(random_vectors(collet, 2)):  # more in tests/benchmarks/noise_floor.py
        fit = refine(Problem.of(collet, noisy(collet, collet.frf(theta), 0.01, seed, has_phase=has_phase)))
        deviation = np.sqrt(2 / fit.degrees_of_freedom)
        assert abs(fit.chi_squared - 1) < 5 * deviation
        assert fit.degrees_of_freedom == (2 if has_phase else 1) * 4451 - 12
        assert fit.variance_known
        assert fit.discrepancy == 0


@pytest.mark.parametrize("has_phase", [True, False])
@pytest.mark.parametrize("proportional", [True, False])
def test_random_error_is_estimated_from_the_scatter(collet, torque_100, has_phase, proportional):
    values = collet.frf(torque_100)
    deviation = 0.02 * (np.abs(values) if proportional else values.std() * np.ones(len(values)))
    normal = np.random.default_rng(3).standard_normal((2, len(values)))
    noisy = values + deviation * (normal[0] + 1j * normal[1]) / np.sqrt(2)
    shown = dovetail.Frf(collet.frequency, noisy if has_phase else np.abs(noisy), "accelerance", has_phase=has_phase)
    shown_values = estimated_variance(shown, values if has_phase else np.abs(values))
    clear = np.abs(values) > 3 * deviation  # an amplitude's noise is not Gaussian below
    ratio = (shown_values / deviation**2)[clear]
    assert np.median(ratio) == pytest.approx(1.0, abs=0.15)
    assert np.all(np.abs(np.log(np.quantile(ratio, [0.02, 0.98]))) < np.log(1.6))


def test_a_fit_with_unknown_noise_is_as_good_as_with_known_noise(collet, torque_100):
    frf = noisy(collet, collet.frf(torque_100), 0.01, 5)
    shown_values, unreported = refine(Problem.of(collet, frf)), refine(Problem.of(collet, replace(frf, variance=None)))
    assert not unreported.variance_known
    assert unreported.chi_squared == pytest.approx(1.0, abs=0.15)
    problem = FrfResiduals(collet, Weighted.against(frf, frf.variance, np.ones(len(frf.frequency), dtype=bool)))
    costs = problem.linearise(collet.to_unit(np.stack([shown_values.theta, unreported.theta]))).cost
    assert costs[1] - costs[0] < 5  # of 8890: a twentieth of its own scatter


def test_a_few_bad_lines_do_no_harm(collet, torque_100):
    clean = noisy(collet, collet.frf(torque_100), 0.01, 6)
    bad = [24, 300, 301, 1500, 2200, 3000, 4100]
    values = clean.values.copy()
    values[bad] += np.array([300, 900j, 900, -400, 2000, 5000j, 300])
    fit, undisturbed = refine(Problem.of(collet, replace(clean, values=values))), refine(Problem.of(collet, clean))
    assert set(collet.frequency[bad]) == set(fit.ignored)
    assert undisturbed.ignored.size == 0
    assert fit.chi_squared == pytest.approx(undisturbed.chi_squared, abs=0.01)
    difference = np.abs(collet.frf(fit.theta) - collet.frf(undisturbed.theta))
    assert np.median(difference) < 0.1 * np.sqrt(clean.variance[0])


def test_lines_of_a_misplaced_resonance_are_not_dropped_as_bad_lines():
    around = np.arange(-50, 51)
    misplaced = np.abs(1 / (around + 2 - 1j) - 1 / (around - 1j)) * 40
    assert misplaced.max() > 20
    assert not isolated_lines(misplaced).any()
    spoilt = np.ones(101)
    spoilt[[30, 31, 70]] = 20
    np.testing.assert_array_equal(np.flatnonzero(isolated_lines(spoilt)), [30, 31, 70])


def test_the_part_that_the_model_cannot_explain_is_reported(sdof):
    """A second, weak resonance that the model does not have."""
    theta = sdof.from_unit(np.array([0.5, 0.5]))
    clean = noisy(sdof, sdof.frf(theta), 1e-4, 2)
    f, at = sdof.frequency, sdof.frequency[len(sdof.frequency) // 3]
    extra = 0.02 * np.abs(clean.values).max() * (f / at) ** 2 / (1 - (f / at) ** 2 + 0.02j)
    fit, alone = refine(Problem.of(sdof, replace(clean, values=clean.values + extra))), refine(Problem.of(sdof, clean))
    assert alone.discrepancy == 0
    assert fit.chi_squared > 10
    assert fit.discrepancy > 0.001
    result = dovetail.identify(sdof, replace(clean, values=clean.values + extra), "refined", cause_seconds=0.0)
    assert result.adequacy.word in ("good", "rough", "does not fit")
    assert any(low < at < high for low, high in result.adequacy.bands)
    assert dovetail.identify(sdof, clean, "refined").adequacy.word == "to the noise"


def test_known_parameters_come_back_without_a_network(collet, torque_20):
    result = dovetail.identify(collet, measured_of(collet, torque_20), "refined")
    np.testing.assert_allclose(result.theta, torque_20, rtol=1e-4)
    assert result.method == "refined"
    assert result.mean_coherence == pytest.approx(1.0, abs=1e-9)
    assert result.to_dict()["fit"]["steps"] == result.fit.steps > 0


def test_the_ranges_hold(sdof):
    beyond = dovetail.Frf(sdof.frequency, sdof.frf({"k": 3e7, "c": 40.0}), "accelerance")
    fit = refine(Problem.of(sdof, beyond), [np.array([-1.0, 1e9])])
    assert all(p.lower <= value <= p.upper for p, value in zip(sdof.parameters, fit.theta, strict=True))
    assert fit.at_bounds["k"] == "upper"
    result = dovetail.identify(sdof, beyond, "refined", cause_seconds=0.0)
    assert "In the best fit k is at the upper end of its range." in result.warnings


def test_no_further_searches_begin_once_a_start_reaches_the_noise(collet, torque_100, monkeypatch):
    few_steps, options = searches.Settings(most_steps=3), dovetail.FitOptions(steps=3, batches=1)
    monkeypatch.setattr(searches, "_SETTINGS", few_steps)
    frf = measured_of(collet, torque_100, 0.01)
    right, wrong = torque_100, collet.from_unit(1.0 - collet.to_unit(torque_100))
    assert refine(Problem.of(collet, frf), [right], options).starts == 1
    assert refine(Problem.of(collet, frf), [wrong], options).starts > 1


@pytest.mark.parametrize("objective", ["frf", "weighted"])
def test_multistart_finds_the_same_parameters(collet, torque_100, objective):
    frf = noisy(collet, collet.frf(torque_100), 0.01, 3)
    result = dovetail.identify(collet, frf, "multistart", starts=8, objective=objective)
    assert result.fit.starts == 8
    assert result.fit.chi_squared < 1.1
    assert result.provenance["method_options"]["objective"] == objective


def test_the_time_of_many_searches_is_bounded(collet, torque_100):
    began = time.process_time()
    fit = multistart(Problem.of(collet, measured_of(collet, torque_100)), starts=2000, seconds=0.5)
    assert time.process_time() - began < 5
    assert fit.starts < 2000


def test_the_same_seed_gives_the_same_fit(sdof):
    frf = measured_of(sdof, None, 0.01)
    np.testing.assert_array_equal(
        refine(Problem.of(sdof, frf), seed=4).theta, refine(Problem.of(sdof, frf), seed=4).theta
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "refined", "starts": 3}, "no option 'starts'"),
        ({"method": "multistart", "starts": 0}, "0 must be at least 1"),
        ({"method": "multistart", "seconds": -1.0}, "must be greater than 0"),
        ({"method": "multistart", "objective": "sum"}, "not one of the choices"),
        ({"method": "network"}, "needs a trained model"),
        ({"model_error": "1 %"}, "'1 %' is not a relative error"),
        ({"cause_seconds": "20 s"}, "'20 s' s is not a time"),
        ({"good": 0.01}, "good\\n  0.01 is not a size of errors"),
        ({"rough": dovetail.ModelError(float("nan"))}, "is not a size of errors"),
        ({"good": dovetail.ModelError(0.1)}, "allows larger errors than 'rough'"),
        ({"samples": "many"}, "'many' is not accepted"),
        ({"samples": 1}, "1 must be at least 20"),
        ({"tolerance": 0.0}, "must be greater than 0"),
        ({"method": "refined", "batches": -1}, "-1 must be at least 0"),
    ],
)
def test_options_that_make_no_sense_are_refused_before_any_work(sdof, options, message):
    begun = []
    with pytest.raises(ParameterError, match=message):
        dovetail.identify(sdof, measured_of(sdof, None), progress=lambda stage, *_: begun.append(stage), **options)
    assert not begun


def test_a_fit_without_parameters_or_with_too_few_lines_is_refused(sdof, assemblies):
    tool = dovetail.load(assemblies / "campaign" / "t0.yaml")
    frf = dovetail.Frf(tool.frequency, tool.frf(), "accelerance")
    with pytest.raises(ParameterError, match="nothing to identify"):
        dovetail.identify(tool, frf, "refined")
    beyond = dovetail.Frf(sdof.frequency + 600.0, sdof.frf(), "accelerance")
    with pytest.raises(MeasurementError, match=r"no line of the measurement is within 1 to 600 Hz: .* 601 to 1200 Hz"):
        dovetail.identify(sdof, beyond, "refined")


@pytest.mark.sweep(keep=1)
@pytest.mark.parametrize("gain", [1.0, {"range": [1e-4, 1e3], "scale": "log"}])
def test_errors_of_a_model_with_an_unknown_gain_are_relative_to_the_measurement_too(sdof, monkeypatch, gain):
    """Relative to the model's own amplitude, which a gain may take away, they would explain any measurement."""
    description = json.loads(sdof.description.text)
    description["response"]["calibration"] = {"gain": gain}
    assembly = dovetail.load(description)
    foreign = np.abs(sdof.frf(sdof.from_unit(np.array([0.9, 0.5])))) + np.linspace(0.0, 10.0, 600)
    seen = []

    def discrepancy(target, model, magnitude, variance, used):
        seen.append((np.abs(model), magnitude, target.amplitude))
        return estimate(target, model, magnitude, variance, used)

    estimate = Observations.discrepancy
    monkeypatch.setattr(Observations, "discrepancy", discrepancy)
    refine(Problem.of(assembly, dovetail.Frf(sdof.frequency, foreign, "accelerance", has_phase=False)))
    for model, magnitude, measured in seen:
        np.testing.assert_array_equal(magnitude, model if gain == 1.0 else np.maximum(model, measured))
    assert seen
