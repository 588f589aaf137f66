"""What a measurement of few lines, of mere noise, or of a narrow resonance cannot show, and what is said instead."""

from __future__ import annotations

import numpy as np
import pytest

import dovetail
from dovetail.inference.adequacy.verdict import NOTHING_SHOWN
from support.noisy_measurements import noisy
from support.short_search import one_batch

THETA = np.array([4e6, 60.0])
NO_CAUSES = {"cause_seconds": 0}
CASES = 25


@pytest.fixture(autouse=True)
def _short_search():
    """Fits end after the first batch of starts, which is enough for one resonance."""
    with one_batch():
        yield


def white(frequency, seed, size=1.0):
    parts = np.random.default_rng(seed).standard_normal((2, len(frequency)))
    return size * (parts[0] + 1j * parts[1]) / np.sqrt(2.0)


@pytest.mark.sweep(keep=1)
@pytest.mark.parametrize(
    ("lines", "noise"),
    [
        (1, 0.01),
        (2, 0.05),
        *(pytest.param(*case, marks=pytest.mark.slow) for case in [(1, 0.05), (2, 0.01), (5, 0.01), (5, 0.05)]),
    ],
)
def test_intervals_from_few_lines_contain_the_truth_at_any_noise(sdof, lines, noise):
    """Of 25 measurements that say nothing of their noise; with 5 % of it, 6 held both parameters before."""
    held = np.zeros(2)
    for case in range(CASES):
        rng = np.random.default_rng([7, case])
        theta = sdof.from_unit(rng.uniform(0.05, 0.95, 2))
        axis = np.sort(rng.uniform(*sdof.frequency[[0, -1]], lines))
        values = sdof.on(axis).frf(theta)
        measured = dovetail.Frf(axis, values + white(axis, [8, case], noise * np.abs(values).max()), "accelerance")
        result = dovetail.identify(sdof, measured, form="laplace", samples=100, **NO_CAUSES)
        assert any("do not show their random error" in reason for reason in result.adequacy.reasons)
        low, high = np.transpose([*result.interval.values()])
        held += (low <= theta) & (theta <= high)
    assert np.all(held >= 0.8 * CASES)


@pytest.mark.sweep(keep=4)
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e3])
@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("lines", [50, 600])
def test_white_noise_shows_nothing_of_the_structure(sdof, lines, known, scale):
    axis = sdof.frequency[-lines:]
    variance = np.full(lines, scale**2) if known else None
    measured = dovetail.Frf(axis, white(axis, lines, scale), "accelerance", variance=variance)
    result = dovetail.identify(sdof, measured, form="laplace", **NO_CAUSES)
    assert result.adequacy.word == "does not fit"
    assert result.adequacy.reasons == (NOTHING_SHOWN,)
    assert {verdict.word for verdict in result.posterior.verdicts.values()} == {"not trustworthy"}


@pytest.mark.sweep(keep=2)
@pytest.mark.parametrize("level", [0.3, 1.0])
@pytest.mark.parametrize("known", [True, False])
def test_a_resonance_in_strong_noise_shows_the_structure(sdof, known, level):
    measured = noisy(sdof, sdof.frf(THETA), level, 5, known=known)
    result = dovetail.identify(sdof, measured, "refined", **NO_CAUSES)
    assert NOTHING_SHOWN not in result.adequacy.reasons
    if known:
        assert result.adequacy.word == "to the noise"
        assert result.theta[0] == pytest.approx(THETA[0], rel=0.05)


@pytest.mark.parametrize(("step", "is_narrow"), [(8.0, True), (2.0, False)])
def test_a_resonance_narrower_than_two_lines_gets_a_warning(sdof, step, is_narrow):
    """It is 9.5 Hz wide at 318 Hz."""
    assembly = sdof.on(np.arange(200.0, 450.0, step))
    result = dovetail.identify(assembly, noisy(assembly, assembly.frf(THETA)), "refined", **NO_CAUSES)
    named = [warning for warning in result.warnings if "narrower than two of its lines" in warning]
    assert bool(named) == is_narrow
    assert all("318." in warning and f"lines every {step:g} Hz" in warning for warning in named)


@pytest.mark.sweep(keep=4)
@pytest.mark.parametrize("lines", [10, 14, 20, 28, 40])
@pytest.mark.parametrize("level", [1e-3, 0.03])
def test_a_smooth_curve_of_few_lines_is_not_taken_for_noise(sdof, lines, level):
    """A median of few lines and a lenient test of their size took such a resonance for noise."""
    assembly = sdof.on(np.linspace(305.0, 331.0, lines))
    result = dovetail.identify(
        assembly, noisy(assembly, assembly.frf(THETA), level, 1, known=False), "refined", **NO_CAUSES
    )
    assert NOTHING_SHOWN not in result.adequacy.reasons
    turned = noisy(assembly, np.exp(0.4j) * assembly.frf(THETA), level, 1, known=False)
    assert NOTHING_SHOWN not in dovetail.identify(assembly, turned, "refined", **NO_CAUSES).adequacy.reasons
