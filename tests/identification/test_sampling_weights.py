"""Samples with uneven weights: moved if the effective share is below 0.4, weights truncated if below 0.1."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from noisy_measurements import noisy

import dovetail
from dovetail.identification.fitting import refine
from dovetail.identification.posterior import laplace_posterior, sample_posterior, sampling, typical_model_error
from dovetail.identification.posterior.laplace import half_about_the_fit


@pytest.mark.parametrize(("effective", "moved"), [(36, True), (44, False)])
def test_samples_are_moved_where_fewer_than_four_tenths_of_them_count(sdof, monkeypatch, effective, moved):
    """Of 100 samples so many have weight 1, and the others next to none."""
    z, calls = np.random.default_rng(0).standard_normal((100, 2)), []

    class Sampler:
        lines = 9

        def __init__(self, *_):
            pass

        def search(self, _):
            return z, np.where(np.arange(100) < effective, 0.0, -50.0)

        def move(self, points, log_weight, count):
            calls.append(count)
            return points, np.zeros(len(points))

    monkeypatch.setattr(sampling, "_Sampler", Sampler)
    frf = noisy(sdof, sdof.frf(), 0.1)
    posterior = sample_posterior(sdof, frf, refine(sdof, frf), samples=100)
    assert calls == ([100] if moved else [])
    assert posterior.effective_sample_size == pytest.approx(100 if moved else effective)


@pytest.mark.parametrize(("light", "kept"), [(4.0, False), (3.5, True)])
def test_weights_are_cut_where_fewer_than_a_tenth_of_the_samples_count(monkeypatch, light, kept):
    """20 of 1000 weigh 1, the others exp(-4) or exp(-3.5): 71 or 118 count. Cut at 97.5 %, all weigh the same."""
    monkeypatch.setattr(sampling, "decorrelate", lambda _, points, *__: points)
    points = SimpleNamespace(z=None, log_posterior=np.zeros(1))
    chosen = []

    def at(_, z):
        chosen.append(z)
        return points

    monkeypatch.setattr(sampling.LinearisedPoints, "at", staticmethod(at))
    sampler = SimpleNamespace(
        _random=np.random.default_rng(0),
        _posterior=None,
        _log_posterior=lambda _: np.zeros(1),
        _mode=None,
        _progress=None,
    )
    log_weight = np.where(np.arange(1000) < 20, 0.0, -light)
    z = np.arange(1000.0)[:, np.newaxis]
    sampling._Sampler.move(sampler, z, log_weight, 1000)
    share = np.mean(chosen[0][:, 0] < 20)
    weight = np.exp(log_weight)
    assert share == pytest.approx(weight[:20].sum() / weight.sum() if kept else 0.02, abs=0.002)


@pytest.mark.parametrize(("light", "kept"), [(4.0, False), (3.5, True)])
def test_weights_of_samples_from_a_table_of_modes_are_cut_alike(monkeypatch, light, kept):
    """1000 searches end where their residuals say nothing, and weigh as those above."""
    chosen = []

    def rows_of(z):
        log_posterior, residuals = np.where(z[:, 0] < 20, 0.0, -light), np.zeros((len(z), 1))
        return SimpleNamespace(
            z=z, log_posterior=log_posterior, residuals=residuals, at_rows=lambda rows: rows_of(z[rows])
        )

    class Map:
        def __init__(self, *_):
            pass

        def components(self, residuals):
            return residuals

        def log_determinant(self, points):
            return np.zeros(len(points.z))

        def solve(self, target, *_):
            return rows_of(np.arange(1000.0)[:, np.newaxis]), np.ones(1000, dtype=np.bool_)

    monkeypatch.setattr(sampling, "decorrelate", lambda _, points, *__: chosen.append(points.z) or points)
    monkeypatch.setattr(sampling.LinearisedPoints, "at", staticmethod(lambda _, z: rows_of(z)))
    monkeypatch.setattr(sampling, "TangentMap", Map)
    sampling.draw(None, np.zeros((1, 1)), "samples", 1000, 0)
    share = np.mean(chosen[0][:, 0] < 20)
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
    """A cart of which the fit has three standard deviations less mass than its prior: assembly, FRF, fit and error."""
    cart = dovetail.load(HEAVY_CART)
    measured = noisy(cart, cart.frf({"k": 1050.0, "c": 2.7, "cart.masses.0.mass": 0.85}), 0.05, 4)
    return cart, measured, refine(cart, measured), replace(typical_model_error(1e-3), quantities=2e-3)


@pytest.mark.parametrize("draw", [sample_posterior, laplace_posterior])
def test_samples_about_a_fit_far_from_its_prior_keep_the_natural_frequency(light_cart, draw):
    """The measurement tells k / m far better than either: neither half of the samples may leave it."""
    cart, measured, fit, error = light_cart
    posterior = draw(cart, measured, fit, model_error=error)
    k, _, mass = posterior.theta.T
    natural = np.sqrt(k / mass) / (2.0 * np.pi)
    assert np.abs(natural / (np.sqrt(1050.0 / 0.85) / (2.0 * np.pi)) - 1.0).max() < 0.01
    assert posterior.weight[::2].sum() == pytest.approx(0.5)
    assert np.median(mass[1::2]) < np.median(mass[::2]) + 0.01  # the fit has 0.85 kg, and what errs tells less


def test_halves_weigh_alike_however_uneven_the_weights_are(light_cart):
    uneven, z = np.array([0.9, 0.02, 0.05, 0.03]), np.zeros((4, 3))
    both, weight = half_about_the_fit(*light_cart, z, uneven, 0)
    assert weight == pytest.approx([0.5 * 0.9 / 0.95, 0.25, 0.5 * 0.05 / 0.95, 0.25])
    assert (both[::2] == 0.0).all()
    assert (both[1::2] != 0.0).all()
    single, one = half_about_the_fit(*light_cart, np.ones((1, 3)), np.array([3.0]), 0)
    assert (single.tolist(), one.tolist()) == ([[1.0, 1.0, 1.0]], [1.0])
