"""Samples from means of neighbouring lines have the posterior of all lines, or all lines are used."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dovetail
from dovetail.inference.fitting import refine
from dovetail.inference.posterior import ModelError, fewer_lines, sample_posterior
from dovetail.inference.posterior.fewer_lines import with_fewer_lines
from dovetail.inference.posterior.model_error import TYPICAL
from dovetail.problem import Problem

TRUTH = np.array([3e6, 4.0])
EXACT = ModelError(0.0)


@pytest.fixture(autouse=True)
def few(monkeypatch):
    """Draw samples from 400 lines."""
    monkeypatch.setattr(fewer_lines, "_SETTINGS", fewer_lines.Settings(lines=400))


def problem(sdof, *, lines=3000, seed=0, **changes):
    """A resonance at 275.7 Hz, 0.64 Hz wide, with 1 % of noise."""
    frequency = np.linspace(260.0, 300.0, lines)
    assembly = sdof.on(frequency)
    clean = dovetail.Frf(frequency, assembly.frf(TRUTH), "accelerance")
    return Problem.of(assembly, replace(dovetail.noisy_frf(clean, 0.01, seed), **changes))


@pytest.mark.sweep(keep=1)
@pytest.mark.parametrize("model_error", [EXACT, TYPICAL], ids=["exact", "typical"])
@pytest.mark.parametrize("seed", [0, 1])
def test_samples_and_evidence_are_those_of_all_lines(sdof, monkeypatch, seed, model_error):
    measured = problem(sdof, seed=seed)
    fit = refine(measured)
    few = sample_posterior(measured, fit, model_error=model_error, samples=2000)
    assert len(with_fewer_lines(measured, fit, model_error)[1].variance) < 450
    monkeypatch.setattr(fewer_lines, "_SETTINGS", fewer_lines.Settings())
    whole = sample_posterior(measured, fit, model_error=model_error, samples=2000)
    assert with_fewer_lines(measured, fit, model_error)[0] is measured
    means, deviations = [], []
    for posterior in (few, whole):
        means.append(posterior.weight @ posterior.fraction)
        deviations.append(np.sqrt(posterior.weight @ (posterior.fraction - means[-1]) ** 2))
    assert (np.abs(means[0] - means[1]) < 0.2 * deviations[1]).all()
    np.testing.assert_allclose(deviations[0], deviations[1], rtol=0.08)
    if few.evidence is not None and whole.evidence is not None:  # single weights may dominate one of them
        assert few.evidence.log == pytest.approx(whole.evidence.log, abs=0.1)


def test_lines_that_the_fit_left_out_are_in_no_mean(sdof):
    measured = problem(sdof)
    fit = refine(measured)
    spoiled = measured.values.copy()
    spoiled[1000:1010] *= 100.0
    wrong = measured.with_frfs([replace(measured.measured[0], values=spoiled)])
    used = np.ones(3000, dtype=bool)
    used[1000:1010] = False
    there = replace(fit, used=used, ignored=measured.observations.frequency[~used])
    fewer, few = with_fewer_lines(wrong, there, EXACT)
    assert len(few.variance) < 450
    assert few.used.all()
    values = fewer.frf_at(fit.theta)
    assert (np.abs(fewer.values - values) < 6.0 * np.sqrt(few.variance)).all()


def test_all_lines_remain_where_means_would_lose_information(sdof):
    """A resonance that is narrower than the distance of the lines shows on one or two of them."""
    frequency = np.linspace(100.0, 3000.0, 2000)
    assembly = sdof.on(frequency)
    frf = dovetail.noisy_frf(dovetail.Frf(frequency, assembly.frf([3e6, 0.05]), "accelerance"), 0.01, 0)
    measured = Problem.of(assembly, frf)
    fit = refine(measured, [np.array([3e6, 0.05])])
    coarse = with_fewer_lines(measured, fit, EXACT)
    kept = fewer_lines._information(*coarse)
    whole = fewer_lines._information(measured, fit)
    assert np.linalg.eigvals(np.linalg.solve(whole, kept)).real.min() >= 0.99


@pytest.mark.parametrize("reason", ["amplitudes", "averages", "few lines", "other errors"])
def test_all_lines_remain(sdof, reason):
    measured = problem(sdof, lines=600 if reason == "few lines" else 3000)
    if reason == "amplitudes":
        (frf,) = measured.measured
        measured = measured.with_frfs([replace(frf, values=frf.amplitude, has_phase=False)])
    errors = {"averages": ModelError(2e-3), "other errors": ModelError(1e-4, other=0.01)}
    fit = refine(measured)
    assert with_fewer_lines(measured, fit, errors.get(reason, EXACT))[0] is measured
