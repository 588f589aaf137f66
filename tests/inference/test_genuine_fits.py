"""Noise is distinguished from a smooth misfit, and the searches for realistic measurements converge, and quickly."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import yaml

import dovetail
from dovetail.inference.fitting import refine
from dovetail.inference.fitting.lines import SearchLines, Smoothed
from dovetail.inference.fitting.searches import Starts
from dovetail.inference.fitting.whiteness import assess_runs, has_size_of_noise, is_white
from dovetail.problem import Problem
from dovetail.problem.least_squares import Linearisation, SumOfSquares, minimise
from dovetail.problem.observations import Observations
from dovetail.problem.random_error import known_variance, residual_variance
from support.noisy_measurements import noisy


def resonances(frequency, *poles, loss=2e-3):
    return sum(frequency**2 / (pole**2 * (1.0 + 1j * loss) - frequency**2) for pole in poles)


def averaged(values, averages, seed, level=0.3):
    """Return H1 and its coherence from spectra of a random force and of a response with noise."""
    rng = np.random.default_rng(seed)
    force, error = (part[0] + 1j * part[1] for part in rng.standard_normal((2, 2, averages, len(values))))
    response = values * force + level * error
    cross, power = np.sum(np.conj(force) * response, axis=0), np.sum(np.abs(force) ** 2, axis=0)
    coherence = np.abs(cross) ** 2 / (power * np.sum(np.abs(response) ** 2, axis=0))
    frequency = np.arange(1.0, len(values) + 1.0)
    return dovetail.Frf(frequency, cross / power, "accelerance", coherence=coherence, averages=averages)


@pytest.mark.parametrize("known", [True, False])
def test_a_small_smooth_misfit_is_not_taken_for_noise(sdof, known):
    """A ripple that raises chi-squared to 1.2, as a wrong minimum of many lines does."""
    sdof = sdof.on(np.linspace(1.0, 600.0, 6000))
    frf = noisy(sdof, sdof.frf(), 0.01, 1, known=known)
    deviation = 0.01 * sdof.frf().std()
    ripple = np.sqrt(0.2) * deviation * np.exp(2j * np.pi * np.arange(6000) / 700.0)
    assert refine(Problem.of(sdof, frf)).discrepancy == 0.0
    fit = refine(Problem.of(sdof, replace(frf, values=frf.values + ripple)))
    assert 1.05 < fit.chi_squared < 1.3
    assert fit.discrepancy > 0.0
    assert fit.starts > 4  # further searches were tried first


@pytest.mark.parametrize("lines", [40, 5000])
def test_noise_is_white_and_a_shift_in_one_place_is_not(lines):
    for seed in range(20):
        assert is_white(np.random.default_rng(seed).standard_normal((lines, 2)))
    residuals = np.random.default_rng(0).standard_normal((lines, 2))
    residuals[8:24] += 2.5
    assert np.mean(residuals**2) < 4.0
    assert not is_white(residuals)


@pytest.mark.parametrize(("lines", "run"), [(7, 0), (8, 8), (15, 8), (16, 16), (31, 16), (32, 32)])
def test_a_run_is_eight_lines_twice_or_four_times_as_many_and_all_of_them_at_most(lines, run):
    """Two residuals of 1 for each line: the squares of both sums over n lines, each over n, are 2 n: exp(-n)."""
    assert assess_runs(np.ones((lines, 2))) == pytest.approx(run / np.log(10.0))


def test_large_residuals_of_either_sign_are_not_taken_for_noise():
    """Their sum vanishes. 16 squares of 9, as a sum of 8 exponentially distributed numbers: Erlang's distribution."""
    residuals = 3.0 * np.resize([[1.0], [-1.0]], (8, 1)) * np.ones(2)
    probability = math.exp(-72.0) * sum(72.0**k / math.factorial(k) for k in range(8))
    assert assess_runs(residuals) == pytest.approx(-math.log10(probability))
    assert not is_white(np.concatenate([residuals, np.random.default_rng(0).standard_normal((40, 2))]))


@pytest.mark.parametrize(("error", "batches"), [("ripple", 3), ("resonance", 5)])
def test_a_misfit_is_reported_after_three_batches_or_five_if_a_resonance_is_missing(sdof, monkeypatch, error, batches):
    frequency, frf = sdof.frequency, noisy(sdof, sdof.frf(), 1e-3, 1)
    ripple = 0.05 * frf.values * np.sin(frequency / 3.0)
    more = ripple if error == "ripple" else 3e-3 * frf.amplitude.max() * resonances(frequency, 300.0, loss=0.01)
    made, similar = [], Starts.similar
    monkeypatch.setattr(Starts, "similar", lambda *given: made.append(similar(*given)) or made[-1])
    fit = refine(Problem.of(sdof, replace(frf, values=frf.values + more)))
    assert fit.discrepancy > 0.01
    assert len(made) == batches
    assert fit.agreeing > fit.starts / 2


def test_smoothed_noise_is_as_large_as_before_and_no_line_counts_twice_where_lines_are_far_apart():
    frequency = np.concatenate([np.arange(10.0, 20.0), np.linspace(1000.0, 1200.0, 2000)])
    frf = dovetail.Frf(frequency, np.ones(len(frequency), complex), "accelerance")
    observations = Observations((frf,))
    weighted = observations.weighted(np.full(len(frequency), 2.0), np.ones(len(frequency), bool))
    smoothed = Smoothed.over(observations, weighted, 0.01)
    noise = np.random.default_rng(0).standard_normal((400, 2, len(frequency)))
    residuals = smoothed.of(frf.values + noise[:, 0] + 1j * noise[:, 1])
    assert np.mean(residuals**2) == pytest.approx(1.0, abs=0.02)
    np.testing.assert_allclose(residuals[:, 0:20:2], noise[:, 0, :10])
    assert residuals.shape[1] < 2 * (10 + 25)
    shift = smoothed.jacobian(frf.values, np.ones((1, 1, len(frequency)), complex))[0, 0]
    assert shift[-20] == pytest.approx(smoothed.of(frf.values[np.newaxis] + 1.0)[0, -20])
    assert shift[-20] > 10.0  # what neighbours share grows by the root of their number


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize(("floor", "share"), [(1e-2, 0.0), (0.0, 1e-4), (1e-3, 1e-4)])
def test_floor_and_share_of_the_noise_are_estimated_from_all_residuals_in_any_unit(floor, share, unit):
    frequency = np.linspace(50.0, 1000.0, 2000)
    model = resonances(frequency, 200.0, 550.0)
    truth = floor + share * np.abs(model) ** 2
    normal = np.random.default_rng(4).standard_normal((2, 2000))
    values = model + np.sqrt(truth / 2.0) * (normal[0] + 1j * normal[1])
    measured = dovetail.Frf(frequency, unit * values, "accelerance")
    reported = residual_variance(measured, unit * model, np.ones(2000, dtype=bool)) / unit**2
    np.testing.assert_allclose(reported, truth, rtol=0.15, atol=1e-6)
    assert np.mean(np.abs(values - model) ** 2 / reported) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("averages", [5, 16])
def test_a_coherence_from_few_averages_leaves_a_chi_squared_of_one(averages):
    frf = averaged(np.full(20_000, 2.0 + 1.0j), averages, 7)
    assert np.mean(np.abs(frf.values - (2.0 + 1.0j)) ** 2 / known_variance(frf)) == pytest.approx(1.0, abs=0.03)
    smooth = replace(frf, coherence=np.full(20_000, 0.9))
    np.testing.assert_allclose(known_variance(smooth), smooth.random_variance)


def test_noise_over_a_variance_of_few_averages_is_white_noise():
    """Squares over a variance of five averages have the long tail of an F distribution: most would look wrong."""
    values, plain, normal = np.full(20_000, 2.0 + 1.0j), [], []
    for seed in range(10):
        observations = Observations((averaged(values, 5, seed),))
        every = np.ones(len(values), dtype=bool)
        residuals = observations.weighted(observations.variance(), every).of(values[np.newaxis])[0]
        plain.append(is_white(residuals.reshape(-1, 2)))
        (of_response,) = observations.by_line(residuals)
        normal.append(is_white(of_response))
        assert np.mean(of_response**2) == pytest.approx(1.0, abs=0.03)
        np.testing.assert_allclose(np.angle(of_response @ [1, 1j]), np.angle(residuals.reshape(-1, 2) @ [1, 1j]))
    assert all(normal)
    assert sum(plain) < 3


@pytest.mark.parametrize(("lines", "limit"), [(100, 1.549), (200, 1.373), (10_000, 1.0483)])
def test_few_lines_may_leave_a_larger_chi_squared(lines, limit):
    """Once in a million times, by the chi-squared distribution of two residuals for each line."""
    assert has_size_of_noise(2 * lines * (limit - 0.001), 2 * lines, lines, variance_known=True)
    assert not has_size_of_noise(2 * lines * (limit + 0.001), 2 * lines, lines, variance_known=True)
    assert has_size_of_noise(2 * lines * 1.1 * limit, 2 * lines, lines, variance_known=False)


def test_a_hundred_lines_that_scatter_by_chance_are_judged_to_the_noise(sdof):
    """Noise alone has a chi-squared of 1.32 here, which it exceeds once in a thousand times."""
    few = sdof.on(np.linspace(20.0, 600.0, 100))
    result = dovetail.identify(few, noisy(few, few.frf(), 0.01, 307), "refined")
    assert result.fit.chi_squared == pytest.approx(1.32, abs=0.02)
    assert result.adequacy.word == "to the noise"


def test_a_search_looks_at_few_lines_but_at_every_resonance():
    frequency = np.linspace(50.0, 1000.0, 50_000)
    poles = np.array([200.0, 203.0, 640.0])
    values = resonances(frequency, *poles, loss=2e-4)
    observations = Observations((dovetail.Frf(frequency, values, "accelerance"),))
    lines = SearchLines(observations, np.full(50_000, 1e-6))
    few = lines.few
    assert len(few) < 800
    assert (few[0], few[-1]) == (0, 49_999)
    assert np.diff(few).max() <= 49_999 / 299 + 1  # 300 lines at equal distances
    tops = [np.argmin(np.abs(frequency - pole)) for pole in poles]
    assert all(np.abs(few - top).min() <= 2 for top in tops)  # a resonance is ten lines wide
    some = lines.thinned(1000)
    assert np.isin(few, some).all()
    assert 1000 <= len(some) <= 1000 + len(few)


def test_a_resonance_without_a_counterpart_is_missed():
    frequency = np.linspace(50.0, 1000.0, 3000)
    observations = Observations((dovetail.Frf(frequency, resonances(frequency, 200.0, 640.0), "accelerance"),))
    variance = np.full(3000, 1e-6)
    lines = SearchLines(observations, variance)
    (missed,) = lines.missed_resonances(variance, resonances(frequency, 205.0, 800.0))
    assert missed == pytest.approx(640.0, rel=1e-3)
    assert not lines.missed_resonances(variance, resonances(frequency, 205.0, 630.0)).size


class Curve(SumOfSquares):
    """Exponentials through 5000 points."""

    def __init__(self):
        self._x = np.linspace(0.0, 1.0, 5000)
        noise = np.random.default_rng(0).standard_normal(5000)
        self._y = np.exp(-3.0 * 0.7 * self._x) + 0.2 + 0.01 * noise

    def residuals(self, position):
        return (np.exp(-3.0 * position[:, :1] * self._x) + position[:, 1:] - self._y) / 0.01

    def linearise(self, position):
        slope = -3.0 * self._x * np.exp(-3.0 * position[:, :1] * self._x) / 0.01
        return Linearisation(self.residuals(position), np.stack([slope, np.full_like(slope, 100.0)], axis=1))


def test_a_search_over_many_residuals_ends_where_the_gradient_vanishes():
    problem = Curve()
    found = minimise(problem, np.array([[0.1, 0.9]]), tolerance=1e-8, most_steps=100)
    np.testing.assert_allclose(found.position, [[0.7, 0.2]], atol=0.01)
    at_end = problem.linearise(found.position)
    assert np.abs(at_end.gradient / np.sqrt(np.diagonal(at_end.curvature, axis1=1, axis2=2))).max() < 1e-2
    np.testing.assert_allclose(found.cost, at_end.cost)


def test_wide_ranges_lose_no_resonance(assemblies):
    """Stiffnesses of the lap over five decades."""
    text = (assemblies / "bolted_lap_beam.yaml").read_text()
    wide = text.replace("[5e6 N/m, 2e9 N/m]", "[1e5 N/m, 1e10 N/m]").replace("[100 N m/rad, 5e4", "[5 N m/rad, 5e5")
    assert wide.count("1e10 N/m") == wide.count("5e5 N m/rad") == 1
    assembly = dovetail.load(yaml.safe_load(wide)).on(np.linspace(123.4, 4900.0, 2500))
    theta = assembly.from_unit(np.array([0.45, 0.4, 0.3, 0.6]))
    fit = refine(Problem.of(assembly, noisy(assembly, assembly.frf(theta), 0.01, 3, known=False)))
    assert fit.discrepancy == 0.0
    assert fit.chi_squared == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("decimals", [2, 3, 4])
def test_a_coherence_rounded_to_one_does_not_determine_the_noise(sdof, decimals):
    """A variance of zero on many lines would leave a chi-squared of any size."""
    assembly = sdof.on(np.arange(1.0, 601.0))
    exact = averaged(assembly.frf(), 10, 1, level=0.02 * np.abs(assembly.frf()).max() ** 0.5)
    rounded = replace(exact, coherence=np.round(exact.coherence, decimals))
    assert np.mean(rounded.coherence == 1.0) > 0.01
    fit = refine(Problem.of(assembly, rounded))
    assert not fit.variance_known
    assert fit.chi_squared == pytest.approx(1.0, abs=0.1)
    assert dovetail.identify(assembly, rounded, "refined").adequacy.word == "to the noise"


def test_a_few_coherences_of_one_count_like_the_highest_that_is_less(sdof):
    exact = averaged(sdof.frf(), 10, 1)
    coherence = exact.coherence.copy()
    coherence[[10, 200]] = 1.0
    variance = known_variance(replace(exact, coherence=coherence))
    highest = coherence[coherence < 1.0].max()
    ratio = (1.0 - highest) / (highest * 9) * 9 / 8
    np.testing.assert_allclose(variance[[10, 200]], exact.amplitude[[10, 200]] ** 2 * ratio)
