"""The simulated impact test against time integration and against Newton."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hammer_test import HammerTest, anti_alias
from scipy.signal import lsim

QUIET = HammerTest(
    impacts=1, scatter=0.0, force_noise=0.0, acceleration_noise=0.0, force_step=1e-9, acceleration_step=1e-9
)
MASS = 0.1


def lines(settings: HammerTest) -> np.ndarray:
    return settings.step * np.arange(1, settings.blocks * settings.samples // 2 + 1)


def oscillator(settings: HammerTest, natural: float, ratio: float) -> np.ndarray:
    omega, own = 2 * np.pi * lines(settings), 2 * np.pi * natural
    return -(omega**2) / MASS / (own**2 + 2j * ratio * own * omega - omega**2)


def test_the_force_is_a_half_sine_of_the_given_peak_and_length():
    force, _ = QUIET.records(np.full(lines(QUIET).size, 1 / MASS, dtype=complex), 0)
    impulse = 2 / np.pi * QUIET.peak * QUIET.duration
    assert force.sum() / QUIET.rate == pytest.approx(impulse, rel=1e-6)
    long = replace(QUIET, duration=2e-3)  # nearly all of it below the filter
    force, _ = long.records(np.full(lines(long).size, 1 / MASS, dtype=complex), 0)
    assert force.max() == pytest.approx(long.peak, rel=1e-2)
    assert np.count_nonzero(force[0] > 0.02 * long.peak) == pytest.approx(2e-3 * long.rate, abs=2)


def test_a_free_mass_moves_by_newton():
    force, acceleration = QUIET.records(np.full(lines(QUIET).size, 1 / MASS, dtype=complex), 0)
    np.testing.assert_allclose(acceleration, force / MASS, atol=1e-7)


def test_an_oscillator_rings_as_integration_in_time_says():
    natural, ratio = 900.0, 0.01
    settings = replace(QUIET, duration=1e-3)
    force, acceleration = settings.records(oscillator(settings, natural, ratio), 0)
    own = 2 * np.pi * natural
    system = ([[0, 1], [-(own**2), -2 * ratio * own]], [[0], [1 / MASS]], [[-(own**2), -2 * ratio * own]], [[1 / MASS]])
    time = np.arange(settings.samples) / settings.rate
    _, integrated, _ = lsim(system, force[0], time)
    assert np.abs(acceleration[0] - integrated).max() < 0.01 * np.abs(integrated).max()


def test_what_rings_beyond_the_record_is_cut_off_and_not_wrapped_around():
    _, acceleration = QUIET.records(oscillator(QUIET, 300.0, 0.001), 0)
    before, end = acceleration[0, : int(0.9 * QUIET.before * QUIET.rate)], acceleration[0, -500:]
    assert np.abs(end).max() > 0.2 * np.abs(acceleration[0, 1000:2000]).max()
    assert np.abs(before).max() < 0.05 * np.abs(end).max()


def test_the_filter_spares_what_is_evaluated():
    frequency = np.array([0.0, 9000.0, 10200.0, 12800.0])
    np.testing.assert_allclose(anti_alias(frequency, 25600.0), [1.0, 1.0, 1.0, 0.0], atol=1e-12)


def test_noise_has_the_given_size_and_the_seed_decides():
    settings = HammerTest(impacts=2)
    accelerance = np.full(lines(settings).size, 1 / MASS, dtype=complex)
    force, acceleration = settings.records(accelerance, 3)
    assert force[:, -4000:].std() == pytest.approx(settings.force_noise, rel=0.05)
    assert acceleration[:, -4000:].std() == pytest.approx(settings.acceleration_noise, rel=0.05)
    again, _ = settings.records(accelerance, 3)
    other, _ = settings.records(accelerance, 4)
    assert np.array_equal(force, again)
    assert not np.array_equal(force, other)
