"""What becomes of samples whose weights are uneven: moved on below 0.4 effective samples for each, cut below 0.1."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from noisy_measurements import noisy

from dovetail.identification.fitting import refine
from dovetail.identification.posterior import sample_posterior, sampling
from dovetail.identification.posterior.posterior import half_about_the_fit


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


def test_half_of_the_samples_lie_about_the_best_fit_where_the_measurement_tells_it():
    """The first coordinate is told to 0.1, the second not at all; the best fit is far from both means."""
    z = np.random.default_rng(3).standard_normal((4000, 2)) * [0.1, 1.0] + [0.5, 0.0]
    moved, weight = half_about_the_fit(z, np.full(len(z), 2.0), np.array([1.5, 2.0]))
    assert weight.sum() == pytest.approx(1.0)
    np.testing.assert_array_equal(moved[::2], z[::2])
    assert moved[1::2].mean(axis=0) == pytest.approx([0.99 * 1.5, 0.0], abs=0.1)
    assert moved[1::2].std(axis=0) == pytest.approx([0.1, 1.0], rel=0.05)


def test_halves_weigh_alike_however_uneven_the_weights_are():
    uneven = np.array([0.9, 0.02, 0.05, 0.03])
    _, weight = half_about_the_fit(np.arange(8.0).reshape(4, 2), uneven, np.zeros(2))
    assert weight[::2].sum() == pytest.approx(0.5)
    assert weight[1::2] == pytest.approx([0.2, 0.3])
    single, one = half_about_the_fit(np.ones((1, 2)), np.array([3.0]), np.zeros(2))
    assert (single.tolist(), one.tolist()) == ([[1.0, 1.0]], [1.0])
