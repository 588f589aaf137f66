"""DC offsets under windows: removed where a signal is at rest, reported elsewhere, and never taken from a motion.

The records are integrated in time; none of the limits in `offsets.py` was chosen on them.
"""

from __future__ import annotations

import re
from functools import cache

import numpy as np
import pytest
from scipy.signal import decimate, lsim

from dovetail.measurement import frf_from_signals
from dovetail.measurement.impact_test import frf_estimation
from dovetail.measurement.impact_test.offsets import Offsets

RATE, SAMPLES, NOISE = 4096.0, 2048, 0.02
MASS, STIFFNESS, DAMPING = 1.0, 1e6, 60.0
WINDOWS = ({"force_window": 0.015}, {"exponential_window": 0.01}, {"force_window": 0.015, "exponential_window": 0.02})


def accelerance(s, suspension=0.0):
    """Accelerance at the Laplace variable; with a suspension [Hz], a mass of 5 kg swings on it as well."""
    values = s**2 / (MASS * s**2 + DAMPING * s + STIFFNESS)
    omega = 2 * np.pi * suspension
    return values + (s**2 / (5.0 * (s**2 + 0.04 * omega * s + omega**2)) if suspension else 0.0)


@cache
def records(seed, *, before=0.02, suspension=0.0, noise=NOISE, impacts=3):
    """Force and acceleration of impacts `before` seconds into the record."""
    random = np.random.default_rng(seed)
    times = 4
    t = np.arange(times * SAMPLES) / (times * RATE)
    poles = [(MASS, DAMPING, STIFFNESS)]
    if suspension:
        omega = 2 * np.pi * suspension
        poles.append((5.0, 5.0 * 0.04 * omega, 5.0 * omega**2))
    both = []
    for _ in range(impacts):
        length = 0.002 * random.uniform(0.8, 1.3)
        pulse = np.where((t > before) & (t < before + length), np.sin(np.pi * (t - before) / length), 0.0)
        force = 100 * random.uniform(0.7, 1.3) * pulse
        signal = sum(lsim(([1.0, 0, 0], row), force, t)[1] for row in poles)
        both.append([decimate(one, times, ftype="fir") for one in (force, signal)])
    force, response = np.moveaxis(np.array(both), 1, 0)
    return tuple(one + noise * random.standard_normal(one.shape) for one in (force, response))


def estimate(force, response, window, before=0.02):
    options = window | ({"force_window": before + window["force_window"]} if "force_window" in window else {})
    return frf_from_signals(force, response, RATE, **options)


def noise_of_a_line(force, window, impacts=3):
    """Standard deviation of the noise at each line of an FRF of white noise on the response."""
    end = window.get("exponential_window", 1.0)
    weight = end ** (np.arange(SAMPLES) / SAMPLES)
    spectrum = np.abs(np.fft.rfft(force * weight)[:, 1:-1]).mean(axis=0)
    return NOISE * np.sqrt(np.sum(weight**2) / impacts) / spectrum


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("seed", range(6))
def test_offsets_under_a_window_are_removed_to_within_the_noise(seed, window):
    """Drawn at random, one for all impacts or one for each."""
    random = np.random.default_rng(seed + 100)
    force, response = records(seed)
    shape = (1, 1) if seed % 2 else (3, 1)
    biased = force + random.normal(0, 3, shape), response + random.normal(0, 3, shape)
    clean, found = estimate(force, response, window), estimate(*biased, window)
    band = clean.frf.frequency < 900
    change = np.abs(found.frf.values - clean.frf.values)[band] / noise_of_a_line(force, window)[band]
    assert np.median(change) < 0.2
    assert change.max() < 10
    assert any("an offset of the force" in text for text in found.warnings)
    truth = accelerance(2j * np.pi * clean.frf.frequency + clean.decay)[band]
    errors = [np.median(np.abs(one.frf.values[band] / truth - 1)) for one in (clean, found)]
    assert errors[1] < 1.05 * errors[0]


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("seed", range(6))
def test_an_frf_without_an_offset_does_not_change(monkeypatch, seed, window):
    """Bit for bit, for white noise and for noise whose samples depend on one another."""
    force, response = records(seed, before=(0.02, 0.005)[seed % 2], suspension=(0.0, 1.5)[seed // 2 % 2])
    if seed > 3:
        smooth = np.ones(20) / 20
        rumble = np.random.default_rng(seed).standard_normal((3, SAMPLES + 19))
        response = response + 0.1 * np.array([np.convolve(row, smooth, mode="valid") for row in rumble])
    found = estimate(force, response, window, (0.02, 0.005)[seed % 2])
    monkeypatch.setattr(frf_estimation, "remove_force_offset", lambda force: Offsets(force, ()))
    monkeypatch.setattr(frf_estimation, "remove_response_offset", lambda _, response: Offsets(response, ()))
    before = estimate(force, response, window, (0.02, 0.005)[seed % 2])
    np.testing.assert_array_equal(found.frf.values, before.frf.values)
    assert not any("is removed" in text for text in found.warnings)


@pytest.mark.parametrize("window", WINDOWS[1:])
@pytest.mark.parametrize("offset", [0.0, -2.0])
def test_a_slow_motion_of_the_response_is_kept(window, offset):
    """A suspension of 1.5 Hz, whose acceleration has a mean within a record of half a second."""
    force, response = records(1, suspension=1.5, noise=1e-4)
    found = estimate(force, response + offset, window)
    low = found.frf.frequency < 20
    truth = accelerance(2j * np.pi * found.frf.frequency[low] + found.decay, 1.5)
    np.testing.assert_allclose(found.frf.values[low], truth, rtol=0.02)


@pytest.mark.parametrize("window", WINDOWS)
def test_a_drift_of_the_force_is_removed(window):
    force, response = records(3)
    drift = 2.0 + 3.0 * np.arange(SAMPLES) / SAMPLES
    clean, found = estimate(force, response, window), estimate(force + drift, response, window)
    band = clean.frf.frequency < 900
    assert np.median(np.abs(found.frf.values / clean.frf.values - 1)[band]) < 1e-3
    assert any("an offset of the force of up to 5" in text for text in found.warnings)


@pytest.mark.parametrize("before", [0.0, 0.001])
def test_an_offset_of_a_response_without_a_rest_before_the_impact_is_reported(before):
    force, response = records(4, before=before)
    found = estimate(force + 2.0, response + 1.0, WINDOWS[2], before)
    assert any(re.match(r"the response ends with a mean of (1|0\.99|1\.0)", text) for text in found.warnings)
    assert "too little was recorded before the impact" in " ".join(found.warnings)
    assert any("an offset of the force of 2" in text for text in found.warnings)
    clean = estimate(force, response + 1.0, WINDOWS[2], before)
    band = clean.frf.frequency < 900
    assert np.median(np.abs(found.frf.values / clean.frf.values - 1)[band]) < 1e-3


def test_a_drift_of_the_response_is_reported():
    force, response = records(5)
    found = estimate(force, response + 2.0 * np.arange(SAMPLES) / SAMPLES, WINDOWS[1])
    assert any("the response ends with a mean of 1.7" in text for text in found.warnings)


def test_without_a_window_nothing_is_removed():
    """An offset is at 0 Hz then, which is not a line of the FRF."""
    force, response = records(6)
    clean, found = (frf_from_signals(force + offset, response + offset, RATE) for offset in (0.0, 5.0))
    np.testing.assert_allclose(found.frf.values, clean.frf.values, rtol=1e-9)
    assert not any("offset" in text for text in found.warnings)


@pytest.mark.parametrize("step", [0.01, 0.05])
def test_the_steps_of_a_converter_are_not_an_offset(step):
    force, response = (np.round(one / step) * step for one in records(7))
    found = estimate(force, response, WINDOWS[2])
    assert not any("is removed" in text for text in found.warnings)
    biased = estimate(force + 0.5, response - 0.5, WINDOWS[2])
    band = found.frf.frequency < 900
    assert np.median(np.abs(biased.frf.values / found.frf.values - 1)[band]) < 1e-3
