"""Resonance peaks of an FRF, also a noisy one, and the modes they belong to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dovetail
from dovetail.frf.resonance_peaks import counterpart, resonance_peaks
from dovetail.frf.resonances import fit_resonances

FREQUENCY = np.arange(100.0, 9001.0, 2.0)
NATURAL = np.array([1319.0, 6446.0, 8133.0])


def modal_sum(noise: float = 0.0, seed: int = 0) -> dovetail.Frf:
    """Three modes with 0.3 to 1 % structural damping and a rigid-body part; `noise` is relative to its spread."""
    omega = 2 * np.pi * FREQUENCY
    receptance = -1.0 / omega**2
    for natural, loss, residue in zip(NATURAL, (0.003, 0.01, 0.005), (4.0, 2.0, 3.0), strict=True):
        receptance = receptance + residue / ((2 * np.pi * natural) ** 2 * (1 + 1j * loss) - omega**2)
    values = -(omega**2) * receptance
    rng = np.random.default_rng(seed)
    spread = noise * values.std() / np.sqrt(2)
    values = values + spread * (rng.normal(size=omega.size) + 1j * rng.normal(size=omega.size))
    return dovetail.Frf(FREQUENCY, values, "accelerance")


def test_the_peaks_of_a_clean_frf_are_placed_between_the_lines() -> None:
    np.testing.assert_allclose(resonance_peaks(modal_sum()), NATURAL, rtol=2e-4)


@pytest.mark.parametrize("seed", range(20))
def test_noise_of_one_percent_makes_no_peaks_of_its_own(seed: int) -> None:
    np.testing.assert_allclose(resonance_peaks(modal_sum(0.01, seed)), NATURAL, rtol=1e-3)


def test_the_quantity_and_the_phase_do_not_matter() -> None:
    frf = modal_sum()
    np.testing.assert_allclose(resonance_peaks(frf.to("receptance")), resonance_peaks(frf), rtol=1e-9)
    amplitude = dovetail.Frf(FREQUENCY, frf.amplitude, "accelerance", has_phase=False)
    np.testing.assert_allclose(resonance_peaks(amplitude), resonance_peaks(frf), rtol=1e-9)


def test_an_frf_without_resonance_has_no_peak() -> None:
    assert resonance_peaks(dovetail.Frf(FREQUENCY, np.ones_like(FREQUENCY), "accelerance")).size == 0
    assert resonance_peaks(dovetail.Frf([1.0, 2.0], [1.0, 2.0], "accelerance")).size == 0


@pytest.mark.filterwarnings("error")
def test_a_peak_next_to_a_zero_line_is_located() -> None:
    amplitude = np.ones_like(FREQUENCY)
    amplitude[1000:1003] = (0.0, 1e3, 900.0)
    (peak,) = resonance_peaks(dovetail.Frf(FREQUENCY, amplitude, "accelerance", has_phase=False))
    assert FREQUENCY[1000] < peak < FREQUENCY[1002]


def damped_mode(noise: float, seed: int) -> dovetail.Frf:
    """A mode with 2 % damping on the flank of others: a step with a low peak above the natural frequency."""
    frequency = np.arange(5000.0, 10001.0, 2.0)
    omega, own = 2 * np.pi * frequency, 2 * np.pi * 8000.0
    values = 60.0 - 2.0 * omega**2 / (own**2 + 2j * 0.02 * own * omega - omega**2)
    rng = np.random.default_rng(seed)
    spread = noise * np.abs(values) / np.sqrt(2)
    values = values + spread * (rng.normal(size=omega.size) + 1j * rng.normal(size=omega.size))
    return dovetail.Frf(frequency, values, "accelerance")


def test_a_low_peak_is_found_on_request_and_placed_where_the_accelerance_is_highest() -> None:
    clean = damped_mode(0.0, 0)
    (peak,) = resonance_peaks(clean, prominence=1.5)
    assert peak == pytest.approx(clean.frequency[np.argmax(clean.amplitude)], rel=2e-3)
    noisy = [resonance_peaks(damped_mode(0.003, seed), prominence=1.5) for seed in range(20)]
    assert {found.size for found in noisy} == {1}
    np.testing.assert_allclose(np.concatenate(noisy), peak, rtol=1e-3)


def test_at_the_usual_prominence_a_low_peak_is_not_listed() -> None:
    assert resonance_peaks(damped_mode(0.0, 0)).size == 0


def two_modes(decibels: float, noise: float = 0.0) -> dovetail.Frf:
    """A peak of so many decibels over even lines, in logarithms a bell of forty lines, and noise of that deviation."""
    level = decibels * np.exp(-(((FREQUENCY - 5000.0) / 80.0) ** 2))
    normal = np.random.default_rng(0).standard_normal((2, len(FREQUENCY)))
    values = 10.0 ** (level / 20.0) + noise * (normal[0] + 1j * normal[1])
    return dovetail.Frf(FREQUENCY, values, "accelerance")


def test_a_peak_rises_by_six_decibels() -> None:
    assert resonance_peaks(two_modes(5.7)).size == 0
    np.testing.assert_allclose(resonance_peaks(two_modes(6.3)), [5000.0], rtol=1e-3)


def test_amplitudes_below_ten_standard_deviations_of_the_noise_are_not_distinguished() -> None:
    """A peak of 20 dB from 1 to 10; with a floor at 10 s it stands out by 10 log10((100 + f^2) / (1 + f^2))."""
    for noise, peaks in ((0.45, 1), (0.75, 0)):  # floors of 4.5 and 7.5: 7.5 dB and 4.4 dB
        assert resonance_peaks(two_modes(20.0, noise)).size == peaks


@pytest.mark.parametrize(("distance", "paired"), [(0.14, True), (0.16, False)])
def test_counterparts_are_within_a_seventh_of_the_frequency(distance: float, paired: bool) -> None:
    other = counterpart(1000.0, np.array([1000.0]), np.array([1000.0 * (1.0 + distance)]))
    assert (other is not None) is paired


@pytest.mark.parametrize("quantity", ["receptance", "mobility", "accelerance"])
@pytest.mark.parametrize("at", [6.0, 480.0])
def test_a_noise_that_is_even_in_one_quantity_hides_no_resonance_and_makes_none(quantity, at):
    """Of 20,000 lines, the noise 60 dB below the peak: in another quantity it grows or falls over four decades."""
    frequency = 0.025 * np.arange(1, 20001)
    values = 1.0 / (at**2 * (1.0 + 0.04j) - frequency**2)
    frf = dovetail.Frf(frequency, values, "receptance").to(quantity)
    noise = 1e-3 * frf.amplitude.max() * np.random.default_rng(5).standard_normal((2, len(frequency)))
    peaks = resonance_peaks(replace(frf, values=frf.values + noise[0] + 1j * noise[1]))
    assert peaks == pytest.approx([at], rel=1e-2)


def test_many_lines_have_the_resonances_of_fewer() -> None:
    """Every fifth of 40,000 lines is fitted, 1.1 Hz apart; one resonance is 0.2 Hz wide."""
    few, many = np.arange(100.0, 9001.0, 2.0), np.linspace(100.0, 9000.0, 40_001)
    true = np.array([1319.0 + 0.1j, 6446.0 + 20.0j, 8133.0 + 8.0j])
    found = []
    for frequency in (few, many):
        terms = 1.0 / (frequency - true[:, np.newaxis]) - 1.0 / (frequency + true.conj()[:, np.newaxis])
        values = (true.imag[:, np.newaxis] * terms).sum(axis=0)
        found.append(fit_resonances([dovetail.Frf(frequency, values, "receptance")], [values]).poles)
    assert found[0] == pytest.approx(true, rel=1e-6)
    assert found[1] == pytest.approx(true, rel=1e-6)
