"""What becomes of samples whose weights are uneven: moved on below 0.4 effective samples for each, cut below 0.1."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from noisy_measurements import noisy

from dovetail.identification.fitting import refine
from dovetail.identification.posterior import sample_posterior, sampling


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
