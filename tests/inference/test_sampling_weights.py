"""Samples with uneven weights: moved if the effective share is below 0.4, weights truncated if below 0.1."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import dovetail
from dovetail.inference.fitting import refine
from dovetail.inference.posterior import (
    annealing,
    drawn_samples,
    laplace_posterior,
    sample_posterior,
    sampling,
    typical_model_error,
)
from dovetail.inference.posterior.alternating import Alternating
from dovetail.inference.posterior.drawn_samples import MovedSamples
from dovetail.inference.posterior.exploration import Exploration
from dovetail.inference.posterior.laplace import half_about_the_fit
from dovetail.inference.posterior.likelihood import squared_norms
from dovetail.inference.posterior.randomize_then_optimize import LinearisedPoints
from dovetail.inference.posterior.separate_modes import separate_modes
from dovetail.inference.posterior.tangent_mixture import TangentMixture
from dovetail.inference.posterior.weights import clipped, effective_after_moves
from dovetail.problem import Problem
from dovetail.problem.least_squares import Linearisation
from support.noisy_measurements import noisy


@pytest.mark.parametrize(("effective", "complete", "moved"), [(36, True, True), (44, True, False), (44, False, True)])
def test_samples_are_moved_where_few_of_them_count_or_a_part_may_be_missing(
    sdof, monkeypatch, effective, complete, moved
):
    """Of 100 samples so many have weight 1, and the others next to none."""
    z, calls = np.random.default_rng(0).standard_normal((100, 2)), []

    class Sampler(sampling._Sampler):
        def begin(self, _):
            pass

        def _search(self, *_):
            log_density = np.where(np.arange(100) < effective, 0.0, 50.0)
            return SimpleNamespace(
                ends=SimpleNamespace(z=z),
                log_density=log_density,
                log_weight=-log_density,
                begun=100,
                is_complete=complete,
                log_weight_at=None,
            )

    def move_by_weight(_density, _ends, count, *_):
        calls.append(count)
        return MovedSamples(z, np.zeros(100), 100.0, 0.0, -np.inf)

    monkeypatch.setattr(sampling, "_Sampler", Sampler)
    monkeypatch.setattr(Exploration, "log_likelihood", lambda _, z: squared_norms(z) / 2.0)
    monkeypatch.setattr(sampling, "move_by_weight", move_by_weight)
    frf = noisy(sdof, sdof.frf(), 0.1)
    posterior = sample_posterior(Problem.of(sdof, frf), refine(Problem.of(sdof, frf)), samples=100)
    assert calls == ([100] if moved else [])
    assert posterior.effective_sample_size == pytest.approx(100 if moved else effective)


@pytest.mark.parametrize(("light", "kept"), [(4.0, False), (3.5, True)])
def test_weights_are_cut_where_fewer_than_a_tenth_of_the_samples_count(monkeypatch, light, kept):
    """20 of 1000 weigh 1, the others exp(-4) or exp(-3.5): 71 or 118 count. Cut at 97.5 %, all weigh the same."""
    chosen = []

    def decorrelate(_, starts, *__):
        chosen.append(starts)
        return SimpleNamespace(z=starts, log_posterior=np.zeros(1000), correlation=0.0)

    monkeypatch.setattr(drawn_samples, "decorrelate", decorrelate)
    monkeypatch.setattr(annealing, "anneal", lambda *_, **__: None)
    log_weight = np.where(np.arange(1000) < 20, 0.0, -light)
    ends = drawn_samples.SearchEnds(np.arange(1000.0)[:, np.newaxis], log_weight, 1000, complete=True)
    density = SimpleNamespace(residuals=None)
    drawn_samples.move_by_weight(density, ends, 1000, np.random.default_rng(0))
    share = np.mean(chosen[0][:, 0] < 20)
    weight = np.exp(log_weight)
    assert share == pytest.approx(weight[:20].sum() / weight.sum() if kept else 0.02, abs=0.002)


class Parabola:
    """One coordinate of which (z - 2)(z + 1) is measured, and reported to be 0: a posterior with two modes."""

    error = 0.05

    def residuals(self, z):
        return np.concatenate([z, (z - 2.0) * (z + 1.0) / self.error], axis=1)

    def linearise(self, z):
        return Linearisation(self.residuals(z), np.stack([np.ones_like(z), (2.0 * z - 1.0) / self.error], axis=2))


def sampled_about(problem, modes, count):
    """Return samples of searches about separate modes, and their weights."""
    separate = separate_modes(LinearisedPoints.at(problem, modes))
    mixture = TangentMixture(problem, separate, separate.z, np.random.default_rng(0))
    mixture.sample(count, count)
    weight = np.exp(mixture.log_weight - mixture.log_weight.max())
    return mixture.ends.z, weight / weight.sum()


@pytest.mark.parametrize("order", [1, -1])
def test_samples_about_separate_modes_have_the_weights_of_the_posterior(order):
    z = np.linspace(-3.0, 4.0, 700_001)
    density = np.exp(-np.sum(Parabola().residuals(z[:, np.newaxis]) ** 2, axis=1) / 2.0)
    samples, weight = sampled_about(Parabola(), np.array([[2.0], [-1.0]])[::order], 4000)
    right = samples[:, 0] > 0.5
    assert weight @ right == pytest.approx(density[z > 0.5].sum() / density.sum(), abs=0.01)
    assert weight[right] @ samples[right, 0] / weight[right].sum() == pytest.approx(
        density[z > 0.5] @ z[z > 0.5] / density[z > 0.5].sum(), abs=1e-3
    )


def test_the_same_mode_counts_once_and_one_of_hardly_any_probability_not_at_all():
    modes = np.array([[2.0], [2.001], [-1.0]])
    assert len(separate_modes(LinearisedPoints.at(Parabola(), modes)).z) == 2
    steep = Parabola()
    steep.residuals = lambda z: np.concatenate([z, (z - 2.0) * (z + 1.0) / 0.05 + 10.0 * (z < 0.5)], axis=1)
    assert len(separate_modes(LinearisedPoints.at(steep, modes)).z) == 1


def test_without_an_end_that_is_a_mode_there_is_no_separate_one():
    nowhere = LinearisedPoints.at(Parabola(), np.empty((0, 1)))
    assert len(separate_modes(nowhere).z) == 0


@pytest.mark.parametrize(("light", "kept"), [(4.0, False), (3.5, True)])
def test_the_largest_weights_are_cut_where_a_few_dominate(light, kept):
    log_weight = np.where(np.arange(1000) < 20, 0.0, -light)
    weight = np.exp(clipped(log_weight))
    share = weight[:20].sum() / weight.sum()
    assert share == pytest.approx(20 / (20 + 980 * np.exp(-light)) if kept else 0.02, abs=0.002)


HEAVY_CART = {
    "dovetail": 1,
    "name": "cart",
    "frequency": {"start": "1 Hz", "stop": "10 Hz", "step": "0.05 Hz"},
    "substructures": {
        "cart": {"model": "lumped", "masses": [{"mass": {"about": "1 kg", "sd": "5 %"}}]},
        "base": {"model": "ground"},
    },
    "joints": {
        "spring": {
            "model": "spring_damper",
            "direction": "x",
            "connect": {"a": {"to": "cart", "at": 0}, "b": {"to": "base", "at": 0}},
            "parameters": {
                "k": {"range": [20.0, 5000.0], "scale": "log"},
                "c": {"range": [0.05, 200.0], "scale": "log"},
            },
        }
    },
    "response": {"at": "cart", "position": 0, "quantity": "receptance"},
}


@pytest.fixture(scope="module")
def light_cart():
    """A cart of which the fit has three standard deviations less mass than its prior: problem, fit and error."""
    cart = dovetail.load(HEAVY_CART)
    measured = noisy(cart, cart.frf({"k": 1050.0, "c": 2.7, "cart.masses.0.mass": 0.85}), 0.05, 4)
    problem = Problem.of(cart, measured)
    return problem, refine(problem), replace(typical_model_error(1e-3), quantities=2e-3)


@pytest.mark.parametrize("draw", [sample_posterior, laplace_posterior])
def test_samples_about_a_fit_far_from_its_prior_keep_the_natural_frequency(light_cart, draw):
    """The measurement shows k / m far better than either: neither half of the samples may leave it."""
    problem, fit, error = light_cart
    posterior = draw(problem, fit, model_error=error)
    k, _, mass = posterior.theta.T
    natural = np.sqrt(k / mass) / (2.0 * np.pi)
    assert np.abs(natural / (np.sqrt(1050.0 / 0.85) / (2.0 * np.pi)) - 1.0).max() < 0.01
    order = Alternating(len(mass))
    assert posterior.weight[order.given_measurement].sum() == pytest.approx(0.5)
    assert np.median(mass[order.about_fit]) < np.median(mass[order.given_measurement]) + 0.01  # the fit has 0.85 kg


def test_both_halves_of_unevenly_weighted_samples_have_equal_weight(light_cart):
    uneven, z = np.array([0.9, 0.02, 0.05, 0.03]), np.zeros((4, 3))
    both, weight = half_about_the_fit(*light_cart, z, uneven, 0)
    assert weight == pytest.approx([0.5 * 0.9 / 0.95, 0.25, 0.5 * 0.05 / 0.95, 0.25])
    order = Alternating(4)
    assert (both[order.given_measurement] == 0.0).all()
    assert (both[order.about_fit] != 0.0).all()
    assert [np.count_nonzero(rows[:2]) for rows in (order.given_measurement, order.about_fit)] == [1, 1]
    single, one = half_about_the_fit(*light_cart, np.ones((1, 3)), np.array([3.0]), 0)
    assert (single.tolist(), one.tolist()) == ([[1.0, 1.0, 1.0]], [1.0])


@pytest.mark.parametrize(
    ("drawn_from", "correlation", "expected"), [(100, 0.25, 100.0), (10, 0.0, 100.0), (10, 1.0, 10.0), (0, 1.0, 1.0)]
)
def test_samples_that_resemble_their_starts_count_less(drawn_from, correlation, expected):
    assert effective_after_moves(drawn_from, 100, correlation) == pytest.approx(expected)


def test_moved_samples_of_one_measurement_report_what_they_have_in_common(sdof, monkeypatch):
    """The weights are even after the moves, and would count all of them."""
    monkeypatch.setattr(sampling, "are_even", lambda *_: False)
    monkeypatch.setattr(drawn_samples, "effective_after_moves", lambda *_: 60.0)
    frf = noisy(sdof, sdof.frf(), 0.1)
    posterior = sample_posterior(Problem.of(sdof, frf), refine(Problem.of(sdof, frf)), samples=100)
    assert 1.0 / np.sum(posterior.weight**2) > 99.0
    assert posterior.effective_sample_size == pytest.approx(60.0)


@pytest.mark.parametrize(("ended", "complete"), [(69, False), (70, True)])
def test_searches_of_which_seven_tenths_end_are_complete(ended, complete):
    mixture = object.__new__(TangentMixture)
    mixture.ends, mixture.begun = SimpleNamespace(z=np.zeros((ended, 1))), 100
    assert mixture.is_complete is complete
