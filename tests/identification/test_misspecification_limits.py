"""From where residuals are significant and a change counts as an explanation: each limit from both sides."""

from __future__ import annotations

import inspect
from types import SimpleNamespace

import numpy as np
import pytest
from noisy_measurements import noisy
from scipy.stats import chi2, norm

from dovetail.identification.fitting import refine
from dovetail.identification.fitting.residuals import Weighted
from dovetail.identification.misspecification import explanations
from dovetail.identification.misspecification.explanations import Explanation, find_explanations
from dovetail.identification.misspecification.perturbations import list_perturbations
from dovetail.identification.misspecification.significance import (
    Significance,
    assess_runs,
    assess_significance,
    is_negligible,
)
from dovetail.identification.misspecification.whitened_residuals import (
    WhitenedResiduals,
    Whitening,
    small_errors,
    whiten_residuals,
)
from dovetail.identification.posterior import laplace_posterior, sample_posterior


def significance(statistic=0.0, sum_of_squares=0.0, **deviations):
    """Residuals as significant as that, or with these standard deviations along perturbations."""
    return Significance(deviations, dict.fromkeys(deviations, 0.0), sum_of_squares, statistic, 0.0)


@pytest.mark.parametrize(("name", "probability"), [("mass", 2e-4), ("tool: material.young", 1e-4)])
def test_noise_exceeds_the_limit_along_a_perturbation_as_seldom_as_stated(name, probability):
    deviation = norm.isf(probability / 2.0)  # 3.72 and 3.89: a perturbation of either sign counts
    for sign in (1.0, -1.0):
        assert significance(**{name: sign * deviation}).statistic == pytest.approx(1.0, rel=0.01)


def whitened_as(sdof, residuals, errors=()):
    """Whitened residuals (n_freq, 2) against a model that has the errors (k, 2 n_freq)."""
    values = sdof.frf()
    plain = Weighted(values, np.ones(len(values)), np.ones(len(values)), True)
    none = np.zeros((2 * len(values), 0))
    whitening = Whitening.against(plain, np.zeros((1, 2 * len(values))))
    errors = np.reshape(errors, (-1, 2 * len(values)))
    return WhitenedResiduals(sdof.from_unit(np.full(2, 0.5)), values, whitening, residuals.ravel(), none, errors)


def test_a_run_of_lines_is_significant_where_noise_makes_one_in_ten_million(sdof):
    """Eight lines of a in both components: 2 (8 a)^2 / 8 = 16 a^2 with two degrees of freedom, p = exp(-8 a^2)."""
    lines = np.zeros((len(sdof.frequency), 2))
    size = np.sqrt(np.log(1e7) / 8.0)
    for factor in (0.95, 1.0, 1.05):
        lines[200:208] = factor * size
        found = assess_significance(whitened_as(sdof, lines), list_perturbations(sdof))
        assert found.run == pytest.approx(factor**2, rel=1e-6)


def test_fewer_than_eight_lines_are_no_run_of_their_own():
    """Four lines of 5, as an interference makes them, count with four beside them: 200 with 16 degrees of freedom."""
    lines = np.zeros((400, 2))
    lines[200:204] = 5.0
    assert assess_runs(lines) == pytest.approx(-chi2.logsf(200.0, 16) / np.log(10.0), rel=1e-9)


def test_the_models_errors_are_too_large_where_noise_makes_them_once_in_ten_thousand(sdof):
    lines = len(sdof.frequency)
    residuals, error = np.zeros((lines, 2)), np.zeros((1, 2 * lines))
    error[0, 0] = 5.0
    for factor in (0.9, 1.0, 1.1):
        residuals[0, 0] = factor * norm.isf(0.5e-4)
        found = assess_significance(whitened_as(sdof, residuals, error), list_perturbations(sdof))
        expected = -np.log10(2.0 * norm.sf(residuals[0, 0])) / 4.0
        assert found.model_error == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("relative", "counted"), [(3e-4, False), (3e-3, True)])
def test_an_error_that_is_next_to_nothing_is_no_direction_of_its_own(sdof, relative, counted):
    """The eigenvalue is the square of the size: 1e-6 of the largest is a thousandth of its size."""
    lines = len(sdof.frequency)
    residuals, errors = np.zeros((lines, 2)), np.zeros((2, 2 * lines))
    errors[0, 0], errors[1, 1] = 1.0, relative
    residuals[0, 1] = 10.0
    found = assess_significance(whitened_as(sdof, residuals, errors), list_perturbations(sdof))
    assert bool(found.model_error > 1.0) is counted


def test_a_model_that_misses_less_than_two_thousandths_is_good():
    assert [is_negligible(SimpleNamespace(discrepancy=part)) for part in (0.0, 0.0018, 0.0022)] == [False, True, False]


def test_residuals_are_whitened_by_the_errors_that_a_model_is_allowed(sdof):
    """0.6 of the model's error for frequencies, twice that for magnitude and phase, and 0.2 % of each line."""
    target = noisy(sdof, sdof.frf(), 1e-4)
    fit = refine(sdof, target)
    whitened = whiten_residuals(sdof, target, fit, 1e-3)
    values, frequency = sdof.frf(fit.theta), sdof.frequency
    variance = fit.variance + (0.002 * np.abs(values)) ** 2
    weighted = Weighted.against(target, variance, np.ones(len(frequency), dtype=bool))
    peaks = np.linspace(frequency[0], frequency[-1], 6)
    hats = np.stack([np.interp(frequency, peaks, height) for height in np.eye(6)])
    stretched, scaled = 6e-4 * frequency * np.gradient(values, frequency), 1.2e-3 * values
    errors = np.concatenate([hats * stretched, hats * scaled, 1j * hats * scaled])
    np.testing.assert_allclose(small_errors(frequency, values, 6e-4), errors, rtol=1e-12)
    expected = Whitening.against(weighted, weighted.jacobian(values[np.newaxis], errors[np.newaxis])[0])
    shown = values * (1.0 + 0.01 * np.random.default_rng(0).standard_normal((3, len(values))))
    np.testing.assert_allclose(whitened.whitening.of(shown), expected.of(shown), rtol=1e-6, atol=1e-9)


def test_what_the_models_small_errors_do_not_have_is_allowed_for_each_line(sdof):
    """A ripple of 0.1 % of the magnitude is none of the joint's; one of 2 % is."""
    values, ripple = sdof.frf(), np.sin(sdof.frequency / 3.0)
    squares = []
    for size in (0.001, 0.02):
        fit = refine(sdof, noisy(sdof, values, 1e-6))
        whitened = whiten_residuals(sdof, noisy(sdof, values * (1.0 + size * ripple), 1e-6), fit)
        squares.append(np.mean(whitened.residuals**2))
    # a sine in phase with each value, of 0.5 and 10 standard deviations: half of 2 |e|^2 / sigma^2, over two components
    assert squares[0] == pytest.approx(0.25 / 2.0, rel=0.25)
    assert squares[1] == pytest.approx(100.0 / 2.0, rel=0.25)


@pytest.fixture
def flagged():
    """A measurement that is off by much, whose residuals have a sum of squares of 1000."""

    def made(statistic=5.0):
        return SimpleNamespace(
            assembly=None, target=None, model_error=0.0, significance=significance(statistic, sum_of_squares=1000.0)
        )

    return made


def names_of(monkeypatch, measurement, sums, gross=()):
    """The explanations that are named, of candidates that leave these sums of squares."""
    for function, left in (("_try_perturbations", sums), ("_try_gross_changes", gross)):
        candidates = [Explanation(f"{rest:g}", rest) for rest in left]
        monkeypatch.setattr(explanations, function, lambda _, candidates=candidates: iter(candidates))
    return [explanation.words for explanation in find_explanations(measurement)]


def test_an_explanation_must_be_worth_it_and_the_best_is_named_with_its_equals(flagged, monkeypatch):
    assert names_of(monkeypatch, flagged(), [989.0]) == []  # 11 less is what chance and one more unknown give
    assert names_of(monkeypatch, flagged(), [987.0]) == ["987"]
    assert names_of(monkeypatch, flagged(), [500.0, 513.0, 511.0]) == ["500", "511"]
    assert names_of(monkeypatch, flagged(), [500.0, 501.0, 502.0, 503.0]) == ["500", "501", "502"]


def test_gross_changes_are_tried_where_the_deviation_is_gross_and_nothing_small_explains_it(flagged, monkeypatch):
    assert names_of(monkeypatch, flagged(9.5), [], [100.0]) == []
    assert names_of(monkeypatch, flagged(10.5), [], [100.0, 90.0]) == ["100"]
    assert names_of(monkeypatch, flagged(10.5), [500.0], [100.0]) == ["500"]


def test_nothing_new_is_tried_when_time_is_up(flagged, monkeypatch):
    clock = iter([0.0, 59.0, 61.0, 62.0])
    monkeypatch.setattr(explanations.time, "monotonic", lambda: next(clock))
    assert names_of(monkeypatch, flagged(), [500.0, 501.0, 502.0]) == ["500", "501"]


@pytest.mark.parametrize(
    ("before", "limit"),
    [(5.0, 1.5), (2.4, 1.2), (1.5, 1.0)],
    ids=["nearly noise", "half of what it was", "noise"],
)
def test_with_an_explanation_the_residuals_are_nearly_noise_and_half_of_what_they_were(
    flagged, monkeypatch, before, limit
):
    monkeypatch.setattr(explanations, "refine", lambda *_: SimpleNamespace(discrepancy=0.0))
    monkeypatch.setattr(explanations, "whiten_residuals", lambda *_: None)
    monkeypatch.setattr(explanations, "list_perturbations", lambda _: ())
    for after, explained in ((0.97 * limit, True), (1.03 * limit, False)):
        monkeypatch.setattr(explanations, "assess_significance", lambda *_, after=after: significance(after))
        assert (explanations._fit_assembly(flagged(before), None, "it were so") is not None) is explained


def test_a_model_is_allowed_half_a_thousandth_where_nothing_is_said(sdof):
    """As in docs/misspecification.md; it is the same for the check of misspecification and for the posterior."""
    target = noisy(sdof, sdof.frf(), 0.01)
    fit = refine(sdof, target)
    by_default, stated = whiten_residuals(sdof, target, fit), whiten_residuals(sdof, target, fit, 5e-4)
    np.testing.assert_array_equal(by_default.whitening.factors, stated.whitening.factors)
    assert laplace_posterior(sdof, target, fit, samples=10).model_error == 5e-4
    assert inspect.signature(sample_posterior).parameters["model_error"].default == 5e-4
