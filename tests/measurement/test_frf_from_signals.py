"""H1, H2, coherence and variance from simulated impacts whose FRF is known; windows; what is wrong with records."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hammer_test import HammerTest

from dovetail.errors import MeasurementError
from dovetail.frf import Frf
from dovetail.measurement import frf_from_signals, without_window_damping
from dovetail.measurement.impact_test.signal_files import read_signals
from support.measured_files import accelerance

MODES = ((700.3, 0.03, 0.4), (2100.7, 0.03, 0.5), (5200.1, 0.02, 0.3))
BENCH = HammerTest(samples=4096, force_noise=0.05, acceleration_noise=0.5)
QUIET = replace(BENCH, force_noise=0.0, acceleration_noise=0.0, force_step=1e-9, acceleration_step=1e-9)


def struck(settings: HammerTest, seed: int, *modes: tuple) -> tuple[np.ndarray, np.ndarray]:
    lines = settings.step * np.arange(1, settings.blocks * settings.samples // 2 + 1)
    return settings.records(accelerance(lines, *(modes or MODES)), seed)


def in_band(frf: Frf) -> tuple[np.ndarray, np.ndarray]:
    """Where the hammer excites, and the truth there."""
    band = (frf.frequency > 100) & (frf.frequency < 9000)
    return band, accelerance(frf.frequency[band], *MODES)


def test_h1_is_within_three_standard_deviations_of_the_truth_at_99_percent_of_the_lines() -> None:
    shares = []
    for seed in range(10):
        frf = frf_from_signals(*struck(BENCH, seed), BENCH.rate).frf
        band, truth = in_band(frf)
        error = np.abs(frf.values[band] - truth)
        shares.append(np.mean(error < 3 * np.sqrt(frf.random_variance[band])))
        assert np.median(error / np.abs(truth)) > 1e-3
    assert np.mean(shares) > 0.99
    assert min(shares) > 0.99


def test_the_predicted_variance_is_the_scatter_of_a_hundred_repetitions() -> None:
    done = [frf_from_signals(*struck(BENCH, seed), BENCH.rate).frf for seed in range(100)]
    band, _ = in_band(done[0])
    scatter = np.var([frf.values[band] for frf in done], axis=0, ddof=1)
    predicted = np.mean([frf.random_variance[band] for frf in done], axis=0)
    ratio = predicted / scatter
    assert 0.8 < np.mean(ratio) < 1.2
    by_band = [np.mean(part) for part in np.array_split(ratio, 10)]
    assert all(0.8 < one < 1.2 for one in by_band), by_band


def test_without_noise_both_estimators_are_the_truth() -> None:
    records = struck(QUIET, 1)
    for estimator in ("H1", "H2"):
        estimated = frf_from_signals(*records, QUIET.rate, estimator=estimator)
        band, truth = in_band(estimated.frf)
        np.testing.assert_allclose(estimated.frf.values[band], truth, rtol=3e-3)
        np.testing.assert_allclose(estimated.frf.coherence[band], 1.0, atol=1e-6)
        assert estimated.used == tuple(range(1, 11))
        assert estimated.warnings == ()


def test_a_repeated_impact_has_a_coherence_of_one_and_no_more() -> None:
    for seed in range(5):
        force, response = (np.tile(record[:1], (7, 1)) for record in struck(BENCH, seed))
        frf = frf_from_signals(force, response, BENCH.rate, label="bench", note="seven times").frf
        np.testing.assert_allclose(frf.coherence, 1.0, atol=1e-12)
        assert frf.coherence.max() == 1.0
        assert (frf.label, frf.note) == ("bench", "seven times")


@pytest.mark.parametrize("rate", [0.5, 1e6])
def test_records_may_be_slow_or_fast(rate: float) -> None:
    records = struck(BENCH, 0)
    usual, other = (frf_from_signals(*records, one).frf for one in (BENCH.rate, rate))
    np.testing.assert_allclose(other.frequency, usual.frequency * rate / BENCH.rate)
    np.testing.assert_allclose(other.values, usual.values)


def test_the_rate_may_stand_once_for_each_impact(tmp_path: Path) -> None:
    force, response = struck(BENCH, 0)
    np.savez(tmp_path / "hits.npz", force=force, response=response, rate=np.full(len(force), BENCH.rate))
    assert read_signals(tmp_path / "hits.npz").rate == BENCH.rate


def test_a_misspelt_name_of_a_signal_is_corrected(tmp_path: Path) -> None:
    file = tmp_path / "hits.npz"
    force, response = struck(BENCH, 0)
    np.savez(file, impulse=force, response=response, rate=BENCH.rate)
    np.testing.assert_array_equal(read_signals(file, names={"force": "impulse"}).force, force)
    with pytest.raises(MeasurementError, match=r"no 'impuls' in the file\.\s+Did you mean 'impulse'"):
        read_signals(file, names={"force": "impuls"})


def test_h1_is_low_with_a_noisy_force_and_h2_high_with_a_noisy_response() -> None:
    for estimator, noise in (("H1", {"force_noise": 0.5}), ("H2", {"acceleration_noise": 20.0})):
        settings = replace(QUIET, impacts=200, **noise)
        values = {one: frf_from_signals(*struck(settings, 0), QUIET.rate, estimator=one).frf for one in ("H1", "H2")}
        band, truth = in_band(values["H1"])
        bias = {one: np.median(np.abs(frf.values[band] / truth)) - 1 for one, frf in values.items()}
        other = "H2" if estimator == "H1" else "H1"
        assert abs(bias[other]) < 0.01
        assert bias[estimator] < -0.02 if estimator == "H1" else bias[estimator] > 0.02


def test_it_is_the_textbook_formula() -> None:
    force, response = struck(BENCH, 3)
    frf = frf_from_signals(force, response, BENCH.rate, quantity="mobility").frf
    spectra = np.fft.rfft(force)[:, 1:-1], np.fft.rfft(response)[:, 1:-1]
    cross = np.mean(spectra[0].conj() * spectra[1], axis=0)
    own, other = (np.mean(np.abs(one) ** 2, axis=0) for one in spectra)
    np.testing.assert_allclose(frf.values, cross / own, rtol=1e-9)
    np.testing.assert_allclose(frf.coherence, np.abs(cross) ** 2 / (own * other), rtol=1e-9)
    np.testing.assert_allclose(frf.frequency, BENCH.rate / 4096 * np.arange(1, 2048))
    assert (frf.quantity, frf.averages) == ("mobility", 10)


def test_the_force_window_takes_noise_away() -> None:
    records = struck(replace(BENCH, force_noise=1.0, acceleration_noise=0.0), 0)
    errors = []
    for window in (None, 0.015):
        frf = frf_from_signals(*records, BENCH.rate, force_window=window).frf
        band, truth = in_band(frf)
        errors.append(np.sqrt(np.mean(np.abs(frf.values[band] / truth - 1) ** 2)))
    assert errors[1] < 0.5 * errors[0]
    with pytest.raises(MeasurementError, match=r"the force window of 0\.005 s cuts a pulse whose peak is at 0\.01"):
        frf_from_signals(*records, BENCH.rate, force_window=0.005)


def test_a_force_window_that_is_longer_than_the_records_is_reported() -> None:
    force = np.zeros(512)
    force[10] = 1.0
    response = np.exp(-0.02 * np.arange(512)) * np.sin(0.3 * np.arange(512))
    said = [frf_from_signals(force, response, 1024.0, force_window=each).warnings for each in (0.02, 20.0)]
    assert [any("is not shorter than the records, 0.5 s" in text for text in texts) for texts in said] == [False, True]


def test_the_damping_of_an_exponential_window_is_removed() -> None:
    """A mode that rings beyond the record: H(i omega + decay) is found, and its damping comes back."""
    natural, loss = 700.0, 0.0035
    omega = 2 * np.pi * natural
    ratio = loss / 2

    def viscous(s: np.ndarray) -> np.ndarray:
        return s**2 / (s**2 + 2 * ratio * omega * s + omega**2)

    lines = QUIET.step * np.arange(1, QUIET.blocks * QUIET.samples // 2 + 1)
    long = replace(QUIET, blocks=16)
    lines = long.step * np.arange(1, long.blocks * long.samples // 2 + 1)
    records = long.records(viscous(2j * np.pi * lines), 0)
    plain, windowed = (frf_from_signals(*records, long.rate, exponential_window=end) for end in (None, 0.005))
    assert "at the end" in plain.warnings[0]
    assert windowed.warnings[-1].startswith("the exponential window adds 33.11 1/s")
    band = (windowed.frf.frequency > 400) & (windowed.frf.frequency < 1200)
    s = 2j * np.pi * windowed.frf.frequency[band]
    # The pulse starts 10 ms after the window: both signals lose the same factor there, and it cancels.
    np.testing.assert_allclose(windowed.frf.values[band], viscous(s + windowed.decay), rtol=0.02)
    shifted = viscous(s + windowed.decay)
    assert np.abs(plain.frf.values[band] / viscous(s) - 1).max() > 0.2
    pole = omega * complex(-ratio, np.sqrt(1 - ratio**2)) - windowed.decay
    found = without_window_damping(-pole.real / abs(pole), abs(pole) / (2 * np.pi), windowed.decay)
    np.testing.assert_allclose(found, (ratio, natural), rtol=1e-12)
    assert shifted.size > 100


def test_a_second_hit_is_reported_and_left_out() -> None:
    force, response = struck(BENCH, 0)
    late = int(0.02 * BENCH.rate)
    force[3, late:] += 0.2 * force[3, :-late]
    estimated = frf_from_signals(force, response, BENCH.rate)
    assert len(estimated.warnings) == 1
    assert estimated.warnings[0].startswith("impact 4: a second hit of 20 % at 0.030")
    left = frf_from_signals(force, response, BENCH.rate, leave_out_bad=True)
    assert left.used == (1, 2, 3, 5, 6, 7, 8, 9, 10)
    assert left.frf.averages == 9
    assert left.warnings == ("impact 4 is left out.",)


@pytest.mark.parametrize("duration", [0.1e-3, 0.3e-3, 1e-3, 3e-3])
def test_a_single_hit_is_never_called_a_double_one(duration: float) -> None:
    settings = replace(BENCH, duration=duration, impacts=30)
    assert not any("hit" in text for text in frf_from_signals(*struck(settings, 5), BENCH.rate).warnings)


@pytest.mark.parametrize("share", [0.1, 0.5])
@pytest.mark.parametrize("delay", [3e-3, 20e-3, 60e-3])
@pytest.mark.parametrize("duration", [0.1e-3, 0.3e-3])
def test_every_double_hit_is_found(duration: float, delay: float, share: float) -> None:
    force, response = struck(replace(BENCH, duration=duration), 5)
    late = int(delay * BENCH.rate)
    force[:, late:] += share * force[:, :-late]
    assert sum("a second hit" in text for text in frf_from_signals(force, response, BENCH.rate).warnings) == 10


def test_an_overload_is_reported() -> None:
    force, response = struck(BENCH, 0)
    clipped = np.clip(response, -0.5 * response.max(), 0.5 * response.max())
    assert frf_from_signals(force, clipped, BENCH.rate).warnings[0] == "impact 1: the response is overloaded."
    warnings = frf_from_signals(force, response, BENCH.rate, full_scale=(force[2].max(), 1e9)).warnings
    assert "impact 3: the force is overloaded." in warnings
    with pytest.raises(MeasurementError, match="no impact is left: impact 1: the response is overloaded"):
        frf_from_signals(force[:1], clipped[:1], BENCH.rate, leave_out_bad=True)


def test_a_single_impact_has_no_coherence() -> None:
    force, response = struck(BENCH, 0)
    estimated = frf_from_signals(force[0], response[0], BENCH.rate)
    assert (estimated.frf.coherence, estimated.frf.random_variance, estimated.frf.averages) == (None, None, 1)
    assert estimated.warnings == ("a single impact gives neither coherence nor variance.",)


RECORD = np.sin(np.arange(64.0))


@pytest.mark.parametrize(
    ("force", "response", "rate", "options", "message"),
    [
        (RECORD, RECORD[:-1], 1e3, {}, r"the force has the shape \(1, 64\), the response \(1, 63\)"),
        (RECORD.reshape(1, 1, 64), RECORD.reshape(1, 1, 64), 1e3, {}, r"the same shape \(n_impacts, n_samples\)"),
        (RECORD[:8], RECORD[:8], 1e3, {}, r"a record of 8 samples\.\n  Accepted: 16 or more"),
        (RECORD, RECORD, 0.0, {}, r"the sampling rate is 0\.0 Hz"),
        (RECORD, RECORD, np.nan, {}, "the sampling rate is nan Hz"),
        (RECORD, np.where(RECORD == 0, np.nan, RECORD), 1e3, {}, "the response is nan at impact 1, sample 1, which is"),
        (0 * RECORD, RECORD, 1e3, {}, "the force of impact 1 is zero throughout"),
        (RECORD, RECORD, 1e3, {"estimator": "H3"}, "'H3' is not an estimator"),
        (RECORD, RECORD, 1e3, {"quantity": "speed"}, "'speed' is not a quantity"),
        (RECORD, RECORD, 1e3, {"exponential_window": 0.0}, r"0\.0 is not a final value of the window"),
    ],
)
def test_faulty_input_is_refused_with_its_message(force, response, rate: float, options: dict, message: str) -> None:
    with pytest.raises(MeasurementError, match=message):
        frf_from_signals(force, response, rate, **options)


@pytest.mark.parametrize(
    ("header", "scales"),
    [
        ("time,force,response\nms,lbf,g", (1e-3, 4.4482216152605, 9.80665)),
        ("time,force [lbf],response [g]", (1.0, 4.4482216152605, 9.80665)),
        ("time [s],force [N],response [m/s^2]", (1.0, 1.0, 1.0)),
        ("Time (ms),Force (lbf),Response (g)", (1e-3, 4.4482216152605, 9.80665)),
        ("time,force,response", (1.0, 1.0, 1.0)),
    ],
)
def test_units_of_a_table_are_those_that_it_states(tmp_path: Path, header: str, scales: tuple[float, ...]) -> None:
    rows = [f"{number},{float(number == 0)},{number % 3}" for number in range(64)]
    (tmp_path / "hit.csv").write_text("\n".join([header, *rows]))
    signals = read_signals(tmp_path / "hit.csv")
    second, newton, acceleration = scales
    assert signals.rate == pytest.approx(1.0 / second)
    assert signals.force.max() == pytest.approx(newton)
    assert signals.response.max() == pytest.approx(2.0 * acceleration)


def test_a_time_in_no_unit_of_time_is_refused(tmp_path: Path) -> None:
    rows = [f"{number},1,2" for number in range(64)]
    (tmp_path / "hit.csv").write_text("\n".join(["time [V],force [N],response [g]", *rows]))
    with pytest.raises(MeasurementError, match="the columns are in V, N, g"):
        read_signals(tmp_path / "hit.csv")


def test_an_archive_with_two_responses_does_not_say_which(tmp_path: Path) -> None:
    force, response = struck(BENCH, 0)
    np.savez(tmp_path / "hits.npz", force=force, displacement=response, acceleration=response, rate=BENCH.rate)
    with pytest.raises(MeasurementError, match="displacement, acceleration may each be the response: say which"):
        read_signals(tmp_path / "hits.npz")
    chosen = read_signals(tmp_path / "hits.npz", names={"response": "acceleration"})
    np.testing.assert_array_equal(chosen.response, response)


@pytest.mark.parametrize("rate", [[], [1000.0, 2000.0]])
def test_an_archive_has_one_rate(tmp_path: Path, rate: list[float]) -> None:
    force, response = struck(BENCH, 0)
    np.savez(tmp_path / "hits.npz", force=force, response=response, rate=np.array(rate))
    with pytest.raises(MeasurementError, match=r"real numbers, and one rate"):
        read_signals(tmp_path / "hits.npz")
