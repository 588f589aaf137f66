"""Weights say how much lines count in the estimate; how well the model fits is judged by the random error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dovetail
from support.noisy_measurements import noisy
from support.short_search import one_batch

THETA = np.array([4e6, 60.0])


@pytest.fixture(autouse=True)
def _short_search():
    """Fits end after the first batch of starts, which is enough for one resonance."""
    with one_batch():
        yield


def weightings(frf):
    """Return weights of every kind, some of them far from the inverse variance."""
    lines = len(frf.frequency)
    return {
        "amplitude": "amplitude",
        "coherence": "coherence",
        "equal": np.ones(lines),
        "steep": np.logspace(-4.0, 4.0, lines),
        "few lines": np.where(np.arange(lines) < lines // 10, 1.0, 1e-6),
    }


@pytest.fixture(scope="module")
def few(sdof):
    """The SDOF assembly on a fifth of its lines."""
    return sdof.on(sdof.frequency[::5])


@pytest.mark.sweep(keep=5)
@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize(
    ("kind", "method"),
    [(kind, "refined") for kind in ("amplitude", "coherence", "equal", "steep", "few lines")]
    + [("steep", "multistart")],
)
def test_the_verdict_does_not_depend_on_weights(few, kind, known, method):
    measured = replace(noisy(few, few.frf(THETA), 0.01, 5, known=known), coherence=np.full(len(few.frequency), 0.99))
    options = {"starts": 4} if method == "multistart" else {}
    weights = weightings(measured)[kind]
    result = dovetail.identify(few, measured, method, weights=weights, cause_seconds=0, **options)
    assert result.adequacy.word == "to the noise"
    assert np.allclose(result.theta, THETA, rtol=0.5)


def test_a_misfit_is_not_hidden_by_weights(few):
    upper = few.frequency > np.median(few.frequency)
    measured = noisy(few, np.where(upper, 1.3, 1.0) * few.frf(THETA), 0.01, 5)
    weights = np.where(upper, 1e-8, 1.0) / measured.variance
    plain, weighted = (
        dovetail.identify(few, measured, "refined", weights=each, cause_seconds=0) for each in (None, weights)
    )
    assert plain.adequacy.word == weighted.adequacy.word != "to the noise"
    assert np.max(np.abs(weighted.theta / THETA - 1.0)) < 0.02  # the estimate follows the weights
    assert weighted.fit.chi_squared > 10.0
