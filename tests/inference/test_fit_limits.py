"""Limits of "fits to the noise", of isolated lines and of agreement between searches, each tested from both sides."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import rice

import dovetail
from dovetail.inference.fitting import refine
from dovetail.inference.fitting.fit import count_agreeing
from dovetail.inference.fitting.refinement import _Refinement
from dovetail.interfaces import FitOptions, silent
from dovetail.problem import Problem
from dovetail.problem.definition import bounds_reached
from dovetail.problem.least_squares import Linearisation, Minima, SumOfSquares, minimise
from dovetail.problem.observations import Observations
from dovetail.problem.random_error import estimated_variance, isolated_lines, known_variance
from dovetail.problem.residuals import LogAmplitude, Weighted
from support.noisy_measurements import noisy


@pytest.mark.parametrize(("deviations", "explained"), [(4.5, True), (5.5, False)])
def test_a_fit_is_noise_within_five_standard_deviations_of_chi_squared(sdof, deviations, explained):
    """The given variance is brought to where chi-squared is 1 + 4.5 or 5.5 sqrt(2 / degrees of freedom)."""
    frf = noisy(sdof, sdof.frf(), 0.01, 1)
    fit = refine(Problem.of(sdof, frf))
    assert fit.discrepancy == 0.0
    excess = deviations * np.sqrt(2.0 / fit.degrees_of_freedom)
    other = refine(Problem.of(sdof, replace(frf, variance=frf.variance * fit.chi_squared / (1.0 + excess))))
    assert other.chi_squared == pytest.approx(1.0 + excess, abs=0.01)
    assert (other.discrepancy == 0.0) is explained


@pytest.mark.parametrize(("scatter", "explained"), [(1.5, True), (1.6, False)])
def test_a_variance_from_the_scatter_may_be_wrong_by_its_own_error(sdof, monkeypatch, scatter, explained):
    """0.15 and 5 / sqrt(600) = 0.2 are allowed where the variance is estimated, next to 5 sqrt(2 / 1198) = 0.2: 1.56.

    The residuals, which are white, then give a better estimate, with which chi-squared is 1.
    """
    frf = noisy(sdof, sdof.frf(), 0.01, 1)
    chi_squared = refine(Problem.of(sdof, frf)).chi_squared
    variance = frf.variance * chi_squared / scatter
    monkeypatch.setattr("dovetail.problem.observations.estimated_variance", lambda *_: variance)
    fit = refine(Problem.of(sdof, replace(frf, variance=None)))
    assert not fit.variance_known
    assert fit.chi_squared == pytest.approx(1.0 if explained else scatter, abs=0.01)
    assert (fit.discrepancy == 0.0) is explained


def mount(lower, upper):
    ranges = {"k": {"range": [1e4, 1e6], "scale": "log"}, "c": {"range": [0.5, 50], "scale": "log"}}
    connect = {"a": {"to": lower, "at": 0}, "b": {"to": upper, "at": 0}}
    return {"model": "spring_damper", "direction": "x", "connect": connect, "parameters": ranges}


@pytest.mark.sweep(keep=1)
@pytest.mark.parametrize("seed", [3, 5, 28])
def test_the_misfit_of_a_sharp_peak_is_not_taken_for_noise(seed):
    """The lower mass is hardly seen; with another spring under it the peak is a little off, on five lines."""
    lumped = {name: {"model": "lumped", "masses": [{"mass": mass}]} for name, mass in (("lower", 2), ("upper", 1))}
    assembly = dovetail.load(
        {
            "dovetail": 1,
            "name": "two masses",
            "frequency": {"start": 5, "stop": 149.5, "step": 0.5},
            "substructures": {"base": {"model": "ground"}, **lumped},
            "joints": {"s1": mount("base", "lower"), "s2": mount("lower", "upper")},
            "response": {"at": "upper", "position": 0},
        }
    )
    theta = np.array([9.99e5, 11.0, 3.84e4, 0.501])
    frf = dovetail.noisy_frf(assembly.simulate(theta), 0.05, np.random.default_rng(seed))
    problem = Problem.of(assembly, replace(frf, variance=None))
    fit = refine(problem)
    weighted = problem.weighted(fit.variance, fit.used)
    found, true = np.sum(weighted.residuals(problem.to_unit(np.stack([fit.theta, theta]))) ** 2, axis=1)
    assert found < true + 3.0  # of 560; 20 to 60 more where the peak is wrong, while other springs fit as well


def test_the_discrepancy_is_what_makes_chi_squared_one(sdof):
    """A ripple of 1 % of each magnitude, 30 times the noise: half of it, since it is a sine, is the mean square."""
    ripple = 0.01 * np.sin(sdof.frequency / 3.0)
    clean = noisy(sdof, sdof.frf(), 1e-4)
    fit = refine(Problem.of(sdof, replace(clean, values=clean.values * (1.0 + ripple))))
    assert fit.discrepancy == pytest.approx(0.01 / np.sqrt(2.0), rel=0.1)


def test_a_constant_error_is_distinguished_from_one_proportional_to_the_frf(sdof):
    """A ripple of a tenth of the median amplitude leaves the peak, 20 times as high, where it is."""
    truth = sdof.from_unit(np.full(len(sdof.parameters), 0.4))
    clean = noisy(sdof, sdof.frf(truth), 1e-4)
    ripple = 0.1 * np.median(clean.amplitude) * np.exp(1j * clean.frequency / 3.0)
    fit = refine(Problem.of(sdof, replace(clean, values=clean.values + ripple)))
    assert fit.background == pytest.approx(0.1, rel=0.1)
    assert fit.discrepancy < 0.01
    np.testing.assert_allclose(fit.theta, truth, rtol=5e-3)


def test_a_fit_has_every_measure_of_its_quality(sdof):
    frf = noisy(sdof, sdof.frf(), 0.01, 1)
    off = 30.0 * np.sqrt(frf.variance) * (np.arange(len(frf.values)) == 100)
    fit = refine(Problem.of(sdof, replace(frf, values=frf.values + off)))
    reported = json.loads(json.dumps(fit.to_dict()))
    assert reported.pop("ignored_lines_Hz") == [sdof.frequency[100]]
    assert reported.keys() == {"chi_squared", "degrees_of_freedom", "variance_known", "variance_assumed", "discrepancy",
                           "background", "at_bounds", "starts", "agreeing", "steps", "seconds"}  # fmt: skip
    assert reported == {name: getattr(fit, name) for name in reported}


def test_searches_agree_within_a_thousandth_or_one_of_the_sum_of_squares():
    def agreeing(*costs, searches=(1, 1, 1)):
        unused = np.zeros(3)
        return count_agreeing(Minima(unused, np.array(costs), unused, unused, np.array(searches)))

    assert agreeing(5000.0, 5005.5, 5006.5) == 2
    assert agreeing(1.0, 1.9, 2.1) == 2
    assert agreeing(1.0, 1.9, 2.1, searches=(3, 2, 5)) == 5  # each stands for several


class Slope(SumOfSquares):
    """A residual that falls towards one end of the range and is 1 there; or a minimum a little inside."""

    def __init__(self, minimum):
        self._minimum = minimum

    def residuals(self, position):
        return np.stack([position[:, 0] - self._minimum, np.ones(len(position))], axis=1)

    def linearise(self, position):
        jacobian = np.zeros((len(position), 1, 2))
        jacobian[:, 0, 0] = 1.0
        return Linearisation(self.residuals(position), jacobian)


@pytest.mark.parametrize(("minimum", "end"), [(-0.5, 0.0), (1.5, 1.0), (3e-4, None), (1.0 - 3e-4, None)])
def test_a_search_that_is_driven_beyond_its_range_ends_on_the_bound_and_no_other(sdof, minimum, end):
    position = minimise(Slope(minimum), np.array([[0.4]]), tolerance=1e-12, most_steps=100).position
    assert position[0, 0] == pytest.approx(minimum if end is None else end, abs=5e-5 if end is None else 0.0)
    reached = bounds_reached(sdof.parameters, np.array([position[0, 0], 0.5]))
    assert reached == ({} if end is None else {"k": "lower" if end == 0.0 else "upper"})


def test_a_search_ends_where_a_step_gains_too_little():
    """The tolerance is a decrease of the sum of squares, for as many squares as there are residuals."""

    class Flat(SumOfSquares):
        def residuals(self, position):
            return np.concatenate([position**2 / 4.0, np.ones((len(position), 99))], axis=1)

        def linearise(self, position):
            jacobian = np.zeros((len(position), 1, 100))
            jacobian[:, 0, 0] = position[:, 0] / 2.0
            return Linearisation(self.residuals(position), jacobian)

    loose, tight = (minimise(Flat(), np.array([[0.9]]), tolerance=t, most_steps=200) for t in (0.02, 1e-9))
    assert loose.steps[0] < tight.steps[0]
    assert loose.cost[0] - tight.cost[0] < 0.02


def large_residuals(*lines, size, others=1.0):
    """Sizes of residuals: 1 for noise, large at some lines."""
    sizes = np.full(1001, others)
    sizes[list(lines)] = size
    return sizes


def test_an_isolated_line_stands_out_of_noise_and_of_its_neighbours():
    assert not isolated_lines(large_residuals(500, size=4.9, others=0.1)).any()  # five times noise at least
    assert np.flatnonzero(isolated_lines(large_residuals(500, size=5.1))).tolist() == [500]
    assert not isolated_lines(large_residuals(500, size=9.0, others=2.0)).any()  # or five times its neighbours
    assert isolated_lines(large_residuals(500, size=10.5, others=2.0)).sum() == 1


@pytest.mark.parametrize(("distance", "isolated"), [(1, True), (2, False), (3, False), (4, False), (5, True)])
def test_neighbours_stand_two_to_four_lines_away(distance, isolated):
    assert bool(isolated_lines(large_residuals(500, 500 + distance, size=20.0))[500]) is isolated


def test_where_many_lines_are_isolated_the_model_is_wrong_and_not_the_lines():
    few, many = (np.arange(10, 10 + 10 * count, 10) for count in (45, 55))  # of 1001: 4.5 % and 5.5 %
    assert isolated_lines(large_residuals(*few, size=20.0)).sum() == 45
    assert not isolated_lines(large_residuals(*many, size=20.0)).any()


def test_no_measurement_is_better_than_a_billionth_and_a_short_one_is_taken_for_a_hundredth():
    frequency = np.linspace(100.0, 200.0, 400)
    smooth = dovetail.Frf(frequency, 2.0 + 0j * frequency, "accelerance")
    np.testing.assert_allclose(estimated_variance(smooth), 4e-18, rtol=1e-5)
    np.testing.assert_allclose(known_variance(replace(smooth, variance=np.zeros(400))), 4e-18)
    short = dovetail.Frf(frequency[:9], smooth.values[:9], "accelerance")
    np.testing.assert_allclose(estimated_variance(short), 4e-4)


def test_sharp_resonances_do_not_disturb_the_estimate_of_the_noise():
    """Peaks of three lines on a tenth of the axis spoil the upper part of each bin, not its lower quantile."""
    frequency = np.linspace(1000.0, 3000.0, 2001)
    poles = np.arange(1050.0, 3000.0, 100.0)[:, np.newaxis] * (1.0 + 5e-4j)
    values = 1.0 + np.sum(20.0 / (frequency - poles), axis=0)
    normal = np.random.default_rng(0).standard_normal((2, 2001))
    shown = values + 0.01 * (normal[0] + 1j * normal[1]) / np.sqrt(2.0)
    reported = estimated_variance(dovetail.Frf(frequency, shown, "accelerance"))
    assert np.median(reported) == pytest.approx(1e-4, rel=0.3)


def test_an_eighth_of_the_axis_with_ten_times_the_noise_does_not_disturb_the_rest():
    """Three of 24 bins of the magnitude; floor and share follow the others."""
    values = np.geomspace(0.01, 10.0, 9600)
    truth = 1e-6 + 1e-5 * values**2
    normal = np.random.default_rng(0).standard_normal((2, 9600))
    noise = np.sqrt(truth / 2.0) * (normal[0] + 1j * normal[1])
    noise[-1200:] *= 10.0
    reported = estimated_variance(dovetail.Frf(np.arange(1.0, 9601.0), values + noise, "accelerance"))
    np.testing.assert_allclose(reported[:-1200], truth[:-1200], rtol=0.2)


def amplitudes(values):
    return dovetail.Frf(np.arange(1.0, len(values) + 1.0), values, "accelerance", has_phase=False)


@pytest.mark.parametrize("clear", [0.0, 0.5, 3.0, 30.0, 90.0, 110.0, 1e4])
def test_an_amplitude_has_the_mean_and_the_deviation_of_rices_distribution(clear):
    """Even lines whose mean square is that of the amplitude and of noise with E|e|^2 = 1 together."""
    weighted = Weighted.against(amplitudes(np.full(40, np.hypot(clear, 1.0))), np.ones(40), np.ones(40, dtype=bool))
    scale = np.sqrt(0.5)
    mean, deviation = clear + 0.25 / max(clear, 1.0), scale  # far above the noise
    if clear < 10.0:
        mean, deviation = (getattr(rice(clear / scale, scale=scale), moment)() for moment in ("mean", "std"))
    np.testing.assert_allclose(1.0 / weighted.weight, deviation, rtol=1e-3)
    residuals = weighted.of(np.full((1, 40), clear + 0j))
    np.testing.assert_allclose(residuals, (mean - np.hypot(clear, 1.0)) / deviation, rtol=1e-3, atol=2e-4)


def test_noise_that_happens_to_cancel_a_value_makes_it_no_more_certain():
    """Zero lines say less noise than there is: the deviation is at least that of noise alone, sqrt(1 - pi / 4)."""
    weighted = Weighted.against(amplitudes(np.zeros(40)), np.ones(40), np.ones(40, dtype=bool))
    np.testing.assert_allclose(1.0 / weighted.weight, np.sqrt(1.0 - np.pi / 4.0), rtol=1e-6)


def test_the_size_of_an_amplitude_is_that_of_nine_lines_around():
    values = np.full(41, 2.0)
    values[20] = 20.0
    weight = Weighted.against(amplitudes(values), np.ones(41), np.ones(41, dtype=bool)).weight
    assert np.flatnonzero(weight != weight[0]).tolist() == list(range(16, 25))


def test_the_search_allows_each_line_a_tenth():
    frf = amplitudes(np.full(40, 3.0))
    np.testing.assert_allclose(LogAmplitude(frf, np.full(40, 1e-12)).of(6.0 + np.zeros((1, 40))), np.log(2.0) / 0.1)
    noisy_lines = LogAmplitude(frf, np.full(40, 2.0 * 0.3**2)).of(6.0 + np.zeros((1, 40)))
    np.testing.assert_allclose(noisy_lines, np.log(2.0) / np.hypot(0.1, 0.1))


def test_an_amplitude_far_below_the_model_is_compared(sdof):
    """As one in um that is taken for m: the model stands a hundred million standard deviations above it."""
    frf = noisy(sdof, sdof.frf(), 0.01, 1)
    amplitude = replace(frf, values=np.abs(frf.values) * 1e-6, has_phase=False, variance=frf.variance * 1e-12)
    residual = Weighted.against(amplitude, amplitude.variance, np.ones(len(amplitude.values), dtype=bool))
    values = sdof.frf()[np.newaxis]
    expected = (np.abs(values) - amplitude.amplitude) * residual.weight
    np.testing.assert_allclose(residual.of(values), expected, rtol=1e-4)
    assert not dovetail.identify(sdof, amplitude, method="refined", cause_seconds=0).is_trustworthy


@pytest.mark.parametrize("lines", [1, 2, 4])
def test_the_noise_is_unknown_with_as_few_residuals_as_parameters(sdof, lines):
    """Two or four parameters that reach every value would leave none: the error of a short FRF stands, 1 %."""
    near = slice(*np.argmax(np.abs(sdof.frf())) + np.array([-lines, 0]))
    frf = noisy(sdof.on(sdof.frequency[near]), sdof.frf()[near], 0.01, 1)
    fit = refine(Problem.of(sdof.on(frf.frequency), replace(frf, variance=None)))
    np.testing.assert_allclose(fit.variance, (0.01 * frf.amplitude.max()) ** 2, rtol=0.5)


@pytest.mark.parametrize(("start", "expected"), [(-3e-4, -3e-4), (-1.0, -1e-3), (0.5, 1e-3)])
def test_starts_are_brought_to_the_ends_of_their_ranges_and_no_further(sdof, start, expected):
    plain = json.loads(sdof.description.text)
    plain["response"]["calibration"] = {"delay": {"range": ["-1 ms", "1 ms"]}}
    assembly = dovetail.load(plain)
    target = Observations.of(assembly.description, [noisy(assembly, assembly.frf())])
    (fraction,) = _Refinement(Problem(assembly, target), FitOptions(), 0, silent)._first_batch(
        [np.array([1e6, 50.0, start])]
    )
    np.testing.assert_allclose(assembly.from_unit(fraction), [1e6, 50.0, expected])
