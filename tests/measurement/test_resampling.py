"""Interpolation to the assembly's grid: its error near sharp resonances, noise, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dovetail.errors import MeasurementError
from dovetail.frf import Frf
from dovetail.measurement import complex_noise, on_grid
from support.measured_files import accelerance

MEASURED = 1.5625 * np.arange(64, 5761)
GRID = np.arange(100.0, 9001.0, 2.0)
SHARP = {
    "one mode at 1 kHz": [(1000.37, 0.003, 1.0)],
    "one mode at 8 kHz": [(8000.37, 0.003, 1.0)],
    "four modes": [(1319.4, 0.003, 0.3), (3210.3, 0.003, 0.5), (6446.2, 0.005, 0.2), (8133.1, 0.004, 0.4)],
    "free": [(1.0, 0.0, 0.6), (1319.4, 0.003, 0.3), (6446.2, 0.005, 0.2), (8133.1, 0.005, 0.4)],
}


def errors(modes: list, *, has_phase: bool = True) -> np.ndarray:
    """Error of each line of the grid over its own true value."""
    values, truth = accelerance(MEASURED, *modes), accelerance(GRID, *modes)
    if not has_phase:
        values, truth = np.abs(values), np.abs(truth)
    resampled = on_grid(Frf(MEASURED, values, "accelerance", has_phase=has_phase), GRID)
    return np.abs(resampled.values - truth) / np.abs(truth)


@pytest.mark.parametrize("modes", SHARP.values(), ids=SHARP)
def test_the_error_near_sharp_resonances_is_below_1e_7(modes: list) -> None:
    assert errors(modes).max() < 1e-7


@pytest.mark.parametrize("modes", SHARP.values(), ids=SHARP)
def test_the_error_of_an_amplitude_alone_is_below_1e_4(modes: list) -> None:
    assert errors(modes, has_phase=False).max() < 1e-4


def test_the_error_between_two_modes_four_lines_apart_stays_between_them() -> None:
    error = errors([(1000.3, 0.003, 1.0), (1006.2, 0.003, 0.8), (5000, 0.003, 0.5)])
    assert 0.01 < error.max() < 0.07
    assert error[np.abs(GRID - 1003) > 20].max() < 1e-4


def test_simpler_interpolations_are_far_worse() -> None:
    values, truth = (accelerance(axis, *SHARP["one mode at 1 kHz"]) for axis in (MEASURED, GRID))
    linear = np.interp(GRID, MEASURED, values.real) + 1j * np.interp(GRID, MEASURED, values.imag)
    assert np.max(np.abs(linear - truth) / np.abs(truth)) > 0.05


def test_noise_is_not_amplified() -> None:
    modes = SHARP["free"]
    values, truth = accelerance(MEASURED, *modes), accelerance(GRID, *modes)
    floor = 0.1 * np.median(np.abs(values))
    deviations = []
    for seed in range(10):
        generator = np.random.default_rng(seed)
        normal = (generator.standard_normal(MEASURED.size) + 1j * generator.standard_normal(MEASURED.size)) / np.sqrt(2)
        scatter = np.hypot(0.01 * np.abs(values), floor)
        resampled = on_grid(Frf(MEASURED, values + scatter * normal, "accelerance"), GRID)
        deviations.append(np.abs(resampled.values - truth) / np.hypot(0.01 * np.abs(truth), floor))
    assert np.sqrt(np.mean(np.square(deviations))) < 0.95
    assert np.max(deviations) < 4.5


def test_noise_of_one_per_cent_stays_one_per_cent_at_the_peaks() -> None:
    modes = SHARP["four modes"]
    noisy = complex_noise(accelerance(MEASURED, *modes), 0.01, 0)
    truth = accelerance(GRID, *modes)
    deviation = np.abs(on_grid(Frf(MEASURED, noisy, "accelerance"), GRID).values - truth) / np.abs(truth)
    assert np.sqrt(np.mean(deviation**2)) < 0.0095
    assert deviation.max() < 0.04


def test_the_measured_lines_themselves_come_back(measured: Frf) -> None:
    some = measured.frequency[5:300:3]
    resampled = on_grid(measured, some)
    np.testing.assert_allclose(resampled.values, measured.values[5:300:3], rtol=1e-14)
    np.testing.assert_allclose(resampled.coherence, measured.coherence[5:300:3], rtol=1e-14)
    assert (resampled.quantity, resampled.label) == ("accelerance", "bench")


def test_coherence_is_interpolated(measured: Frf) -> None:
    middle = (measured.frequency[10] + measured.frequency[11]) / 2
    expected = (measured.coherence[10] + measured.coherence[11]) / 2
    np.testing.assert_allclose(on_grid(measured, [middle]).coherence, expected, rtol=1e-14)


@pytest.mark.parametrize("lines", [1, 2, 3, 4])
def test_few_lines_are_interpolated_by_a_straight_line(lines: int) -> None:
    frequency = np.arange(1.0, lines + 1)
    resampled = on_grid(Frf(frequency, frequency + 2j, "mobility"), np.linspace(1, lines, 7)[: 7 if lines > 1 else 1])
    np.testing.assert_allclose(resampled.values, resampled.frequency + 2j, rtol=1e-14)


@pytest.mark.parametrize("has_phase", [True, False])
def test_lines_that_are_zero_are_interpolated(has_phase: bool) -> None:
    frequency = np.arange(1.0, 10.0)
    values = np.where((frequency == 5) | (frequency == 6), 0.0, 1.0)
    resampled = on_grid(Frf(frequency, values, "mobility", has_phase=has_phase), np.linspace(1, 9, 33))
    assert resampled.amplitude.max() < 1.2
    assert resampled.amplitude[16] == resampled.amplitude[20] == 0


def test_a_grid_that_is_not_covered_is_refused(measured: Frf) -> None:
    with pytest.raises(MeasurementError) as caught:
        on_grid(measured, np.arange(100.0, 701.0, 2.0))
    assert str(caught.value) == (
        "bench\n  the measurement covers 100 to 623.4375 Hz, and 100 to 700 Hz are wanted.\n"
        "  Nothing is extrapolated: measure the whole range, or narrow 'frequency' in the description."
    )
    with pytest.raises(MeasurementError, match=r"and 99\.9 to 200 Hz are wanted"):
        on_grid(measured, [99.9, 200])


def test_cover_has_the_tolerance_of_rounding(measured: Frf) -> None:
    last = measured.frequency[-1]
    resampled = on_grid(measured, [100 * (1 - 0.9e-9), last * (1 + 0.9e-9)])
    np.testing.assert_allclose(resampled.values, measured.values[[0, -1]], rtol=1e-14)
    for grid in ([100 * (1 - 1.1e-9), 200], [100, last * (1 + 1.1e-9)]):
        with pytest.raises(MeasurementError, match="are wanted"):
            on_grid(measured, grid)


@pytest.mark.parametrize("grid", [[], [[100.0, 200.0]], [100.0, np.nan], 150.0])
def test_a_grid_that_is_not_a_list_of_frequencies_is_refused(measured: Frf, grid: object) -> None:
    with pytest.raises(MeasurementError, match="the grid is not a list of finite frequencies"):
        on_grid(measured, grid)


def test_a_decreasing_grid_is_refused(measured: Frf) -> None:
    with pytest.raises(MeasurementError, match="the frequency does not increase after line 1"):
        on_grid(replace(measured, coherence=None), [200.0, 150.0])


def test_the_variance_is_the_scatter_of_interpolated_values() -> None:
    modes = SHARP["four modes"]
    values = accelerance(MEASURED, *modes)
    grid = GRID[::7]
    deviation = np.hypot(0.02 * np.abs(values), 0.001 * np.median(np.abs(values)))
    generator = np.random.default_rng(1)
    for has_phase in (True, False):
        samples = []
        for _ in range(300):
            noise = generator.standard_normal((2, MEASURED.size)) * deviation / np.sqrt(2)
            noisy = values + noise[0] + 1j * noise[1]
            kind = Frf(MEASURED, noisy if has_phase else np.abs(noisy), "accelerance", has_phase=has_phase)
            samples.append(on_grid(kind, grid).values)
        clean = Frf(
            MEASURED,
            values if has_phase else np.abs(values),
            "accelerance",
            has_phase=has_phase,
            variance=deviation**2 if has_phase else deviation**2 / 2,
        )
        ratio = on_grid(clean, grid).variance / np.var(samples, axis=0)
        assert np.median(ratio) == pytest.approx(1, abs=0.05)
        near = np.abs(grid[:, np.newaxis] - [mode[0] for mode in modes]).min(axis=1) < 20
        assert near.sum() >= 8
        assert np.mean((ratio[near] > 0.7) & (ratio[near] < 1.4)) > 0.85


def test_the_variance_on_the_grid_is_that_of_coherence_and_averages(measured: Frf) -> None:
    known = replace(measured, averages=10, coherence=np.full(measured.frequency.size, 0.9))
    resampled = on_grid(known, measured.frequency[10:20])
    np.testing.assert_allclose(resampled.variance, known.random_variance[10:20], rtol=1e-9)
    between = on_grid(known, (measured.frequency[10:20] + measured.frequency[11:21]) / 2)
    assert np.all(between.variance < known.random_variance[10:20])
    assert resampled.averages == 10
    unknown = replace(known, coherence=np.zeros(measured.frequency.size))
    assert on_grid(unknown, measured.frequency[10:20]).variance is None


@pytest.mark.parametrize(("has_phase", "unit"), [(True, 1.0), (True, 1e-12), (True, 1e12), (False, 1.0)])
def test_lines_with_too_wide_gaps_are_refused_in_any_unit(has_phase: bool, unit: float) -> None:
    modes = [(400.3 + 130.0 * n, 0.004, 0.5 * unit) for n in range(12)]
    grid = np.arange(300.0, 2000.0, 2.0)
    for spacing, reported in ((1.5625, True), (3.125, True), (60.0, False), (100.0, False)):
        lines = spacing * np.arange(np.floor(250 / spacing), 2200 / spacing)
        values = accelerance(lines, *modes)
        frf = Frf(lines, values if has_phase else np.abs(values), "accelerance", has_phase=has_phase)
        truth = accelerance(grid, *modes)
        if reported:
            drawn = on_grid(frf, grid).values
            error = np.abs(drawn) - np.abs(truth)
            assert np.linalg.norm(error) < (0.02 if has_phase else 0.04) * np.linalg.norm(truth)
            continue
        with pytest.raises(MeasurementError, match="too far to determine the FRF between them") as caught:
            on_grid(frf, grid)
        assert f"are {spacing:g} Hz apart" in str(caught.value)
        np.testing.assert_array_equal(on_grid(frf, lines[3:20]).values, frf.values[3:20])


@pytest.mark.parametrize("count", [4, 7, 12, 15])
def test_a_short_gap_between_lines_is_refused_like_a_long_one(count: int) -> None:
    lines = np.linspace(300.0, 2000.0, count)
    frf = Frf(lines, accelerance(lines, *[(400.3 + 130.0 * n, 0.004, 0.5) for n in range(12)]), "accelerance")
    with pytest.raises(MeasurementError, match="too far to determine the FRF between them"):
        on_grid(frf, np.arange(300.0, 2000.0, 2.0))


def test_an_frf_that_is_zero_is_zero_between_its_lines() -> None:
    zero = Frf(MEASURED, np.zeros(MEASURED.size), "accelerance")
    with np.errstate(invalid="raise"):
        np.testing.assert_array_equal(on_grid(zero, GRID).values, 0.0)


def test_an_outlier_in_the_last_line_changes_no_line_before_it() -> None:
    """The last of an even number of lines is not drawn from every other one, since none is behind it."""
    frequency, values = np.arange(100.0, 140.0), np.ones(40)
    values[-1] = 1e4
    drawn = on_grid(Frf(frequency, values, "accelerance"), np.arange(100.5, 136.0)).values
    np.testing.assert_allclose(drawn, 1.0, rtol=1e-12)


def test_a_noisy_measurement_is_not_called_too_coarse() -> None:
    values = accelerance(MEASURED, *SHARP["four modes"])
    for seed in range(5):
        on_grid(Frf(MEASURED, complex_noise(values, 0.4, seed), "accelerance"), GRID)
