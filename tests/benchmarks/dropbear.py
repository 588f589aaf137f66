"""Where a roller under a beam is, from the beam's natural frequencies: the DROPBEAR data, error in mm.

    python tests/benchmarks/dropbear.py CLONE [--calibration 4] [--files 2] [--step 0.2]

CLONE is a clone of High-Rate-SHM-Working-Group/Dataset-8-DROPBEAR-Acceleration-vs-Roller-Displacement (CC BY-SA 4.0),
of which nothing is copied here. No force was measured: natural frequencies of the decaying vibrations are identified
from the accelerometer's signal, and the model's are fitted to them. On the plateaus of a few files with slow steps the
roller's position is taken from its sensor, and the clamp, the contact, Young's modulus and the accelerometer's mass
are identified: the tests are a series with shared values. In all other files the position is identified, window by
window, from the accelerations alone, and compared with the sensor.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.signal
from numpy.typing import NDArray
from processors import processor_time

import dovetail
from dovetail.identification.measured_modes import MeasuredModes
from dovetail.inference.adequacy.judgement import JudgementOptions, judge
from dovetail.inference.fitting import fit_at
from dovetail.series.description import Role, SeriesDescription, SeriesTest
from dovetail.series.fitted_tests import FittedTest
from dovetail.series.fitting import fit_series
from dovetail.series.result import SeriesIdentification
from dovetail.series.unknowns import SeriesUnknowns

HERE = Path(__file__).with_name("measured_series")
SLOW = "data/Slow Postional Displacement/trial data/10steps"
RANDOM = "data/Random Index Set Random Dwell/set0/trial data"
HERTZ, METRES_PER_VOLT = 5000.0, 1.0 / 17.18
"""Sampling frequency; scale of the position sensor, with 0 V at the clamp, as users of the data publish it (its README
gives none). Both stiffness and range agree with it: with the offset unknown, a fit moves it by less than 1 mm."""
BANDS = ((15.0, 60.0), (130.0, 300.0))
"""Hz; of the first and of the second natural frequency."""
WINDOWS = (0.4, 0.2)
"""Seconds from which each is identified; the second one decays within a few tenths of a second."""
RELATIVE_ERRORS = (0.003, 0.02)
"""Standard deviations of the model's natural frequencies in the calibration, whose residuals give those of the rest."""
STARTS = (0.25, 0.5, 0.75)
"""Where the fits of the series begin, in parts of all ranges."""
STILL = 0.02
"""Volt by which the sensor's signal varies at most on a plateau: 1.2 mm."""


@dataclass(frozen=True, eq=False)
class Recording:
    """One file.

    Parameters
    ----------
    name : str
    acceleration, position : (n,) arrays
        Volt, and m from the clamp.
    """

    name: str
    acceleration: NDArray[np.float64]
    position: NDArray[np.float64]


def read(file: Path) -> Recording:
    """Read a file: columns for the accelerometer, gauges and a second accelerometer, position and time."""
    table = np.loadtxt(file, skiprows=9)
    lowpass = scipy.signal.butter(4, 40.0, fs=HERTZ, output="sos")
    volt = scipy.signal.sosfiltfilt(lowpass, table[:, -2])
    return Recording(f"{file.parents[1].name}/{file.name}", table[:, 0], volt * METRES_PER_VOLT)


def poles(signal: NDArray[np.float64], order: int, step: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return natural frequencies [Hz] and amplitudes of the decaying oscillations of a signal (matrix pencil)."""
    rows = np.lib.stride_tricks.sliding_window_view(signal, len(signal) // 2)
    basis = np.linalg.svd(rows, full_matrices=False)[2][:order].T
    z = np.linalg.eigvals(np.linalg.lstsq(basis[:-1], basis[1:], rcond=None)[0])
    powers = np.vander(z, len(signal), increasing=True).T
    amplitude = np.abs(np.linalg.lstsq(powers, signal.astype(complex), rcond=None)[0])
    s = np.log(z) / step
    decaying = (s.imag > 0.0) & (-s.real < 0.05 * np.abs(s)) & (-s.real > -0.01 * np.abs(s))
    return np.abs(s[decaying]) / (2.0 * np.pi), amplitude[decaying]


def windows(recording: Recording, step: float) -> Iterator[tuple[float, float, float, dovetail.ModalParameters]]:
    """Yield the time, the mean position [m], its range [m] and the natural frequencies of each window that rings."""
    signals = []
    for (low, high), factor in zip(BANDS, (20, 5), strict=True):
        band = scipy.signal.butter(4, [low, high], btype="band", fs=HERTZ, output="sos")
        signals.append((scipy.signal.sosfiltfilt(band, recording.acceleration)[::factor], factor / HERTZ))
    last = len(recording.position) / HERTZ - max(WINDOWS)
    for start in np.arange(0.2, last, step).tolist():
        found = []
        for (signal, interval), (low, high), length in zip(signals, BANDS, WINDOWS, strict=True):
            part = signal[round(start / interval) : round((start + length) / interval)]
            frequency, amplitude = poles(part, 6, interval)
            inside = (frequency > low) & (frequency < high) & (amplitude > 0.01)
            found.append(float(frequency[inside][np.argmax(amplitude[inside])]) if inside.any() else np.nan)
        if np.isnan(found[0]):
            continue
        frequency = np.array([one for one in found if np.isfinite(one)])
        sd = frequency * RELATIVE_ERRORS[: len(frequency)]
        there = recording.position[round(start * HERTZ) : round((start + max(WINDOWS)) * HERTZ)]
        yield start, float(there.mean()), float(np.ptp(there)), dovetail.ModalParameters(frequency, frequency_sd=sd)


def assembly(**joints: object) -> dovetail.Assembly:
    """Return the assembly of the description with some of its parameters changed."""
    description = {"extends": str(HERE / "roller_beam.yaml"), **joints}
    return dovetail.load(description, plugins=[str(HERE / "moving_support.py")])


def calibrated(recordings: list[Recording], step: float) -> SeriesIdentification:
    """Identify what all tests share, from the plateaus with known positions."""
    plateaus: dict[float, list[tuple[float, dovetail.ModalParameters]]] = {}
    for recording in recordings:
        for _, position, spread, table in windows(recording, step):
            if spread < STILL * METRES_PER_VOLT:
                plateaus.setdefault(round(position, 2), []).append((position, table))
    fitted, tests = [], []
    for level, found in sorted(plateaus.items()):
        position = float(np.mean([one for one, _ in found]))
        both = [[table.frequency[k] for _, table in found if len(table.frequency) > k] for k in range(2)]
        frequency = np.array([np.median(each) for each in both if len(each) > 2])
        table = dovetail.ModalParameters(frequency, frequency_sd=frequency * RELATIVE_ERRORS[: len(frequency)])
        known = assembly(joints={"roller": {"parameters": {"position": {"value": position}}}})
        test = SeriesTest(f"{1e3 * level:.0f} mm", known, ())
        modes = MeasuredModes(known, table)
        fit = fit_at(modes.problem, np.full(len(known.parameters), STARTS[len(tests) % len(STARTS)]))
        judged = judge(modes.problem, fit, JudgementOptions(cause_seconds=0.0))
        tests.append(test)
        fitted.append(FittedTest(test, modes, judged))
        print(f"{1e3 * position:.1f} mm, {len(found)} windows: {np.round(frequency, 2).tolist()} Hz", flush=True)
    described = SeriesDescription("plateaus", tuple(tests), {}, {}, Role("shared"))
    unknowns = SeriesUnknowns(described)
    return SeriesIdentification(described, tuple(fitted), unknowns, fit_series(unknowns, fitted))


@dataclass(frozen=True, eq=False)
class Tracker:
    """The model's natural frequencies (n, 2) [Hz] at positions (n,) of the roller [m]; relative errors (2,)."""

    position: NDArray[np.float64]
    frequency: NDArray[np.float64]
    relative_errors: NDArray[np.float64]

    @staticmethod
    def of(series: SeriesIdentification) -> Tracker:
        """Return those of the assembly with what the plateaus have in common, and their errors from the residuals."""
        names = [parameter.name for parameter in series.tests[0].test.assembly.parameters]
        known = dict(zip(names, series.theta(0).tolist(), strict=True))
        roller, positions = assembly(), np.arange(0.046, 0.235, 0.002)
        there = [{**known, "roller.position": at} for at in positions.tolist()]
        rows = [dovetail.natural_frequencies(roller, theta, count=2) for theta in there]
        fine = np.arange(positions[0], positions[-1], 1e-4)
        frequency = np.stack([np.interp(fine, positions, column) for column in np.transpose(rows)], axis=1)
        return Tracker(fine, frequency, _errors(series))

    def locate(self, table: dovetail.ModalParameters) -> tuple[float, float, float]:
        """Return the mean and the ends of the 90 % interval of the position; before, it may be anywhere."""
        count = len(table.frequency)
        distance = (self.frequency[:, :count] / table.frequency - 1.0) / self.relative_errors[:count]
        weight = np.exp(-np.sum(distance**2, axis=1) / 2.0 + np.sum(distance**2, axis=1).min() / 2.0)
        share = np.cumsum(weight) / weight.sum()
        low, high = np.interp([0.05, 0.95], share, self.position)
        return float(weight @ self.position / weight.sum()), float(low), float(high)


def _errors(series: SeriesIdentification) -> NDArray[np.float64]:
    """Return the standard deviation (2,) of the relative errors of both natural frequencies on the plateaus."""
    groups: tuple[list[float], list[float]] = ([], [])
    for index, fitted in enumerate(series.tests):
        measured = fitted.problem.observations.amplitude
        residuals = fitted.problem.frf_at(series.theta(index)).real / measured - 1.0
        for group, residual in zip(groups, residuals.tolist(), strict=False):
            group.append(residual)
    count = sum(map(len, groups))
    return np.sqrt([np.mean(np.square(group)) * count / (count - series.unknowns.count) for group in groups])


def tracked(tracker: Tracker, recording: Recording, step: float) -> NDArray[np.float64]:
    """Return a row (6,) for each window: time [s]; position, its range, estimate, ends of the 90 % interval [m]."""
    return np.array([[*known, *tracker.locate(table)] for *known, table in windows(recording, step)])


def main() -> None:
    """Print the calibration, and the errors of the tracked positions."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clone", type=Path)
    parser.add_argument("--calibration", type=int, default=4, help="files with slow steps, whose positions are known")
    parser.add_argument("--files", type=int, default=2, help="further files of both kinds that are tracked")
    parser.add_argument("--step", type=float, default=0.2, help="seconds from window to window")
    options = parser.parse_args()
    began = processor_time()
    slow = sorted((options.clone / SLOW).glob("test*.txt"))
    series = calibrated([read(file) for file in slow[: options.calibration]], options.step)
    for row in series.rows:
        print(f"{row.name} = {row.fit:.5g} {row.unit}")
    tracker = Tracker.of(series)
    print(f"Relative errors of the natural frequencies: {np.round(tracker.relative_errors, 4).tolist()}")
    print("| file | windows | roller | median error mm | 90 % below mm | in the 90 % interval |")
    print("|---|---|---|---|---|---|")
    for kind, files in (
        ("slow steps", slow[options.calibration :]),
        ("random", sorted((options.clone / RANDOM).glob("test*.txt"))),
    ):
        rows = np.concatenate([tracked(tracker, read(file), options.step) for file in files[: options.files]])
        error = np.abs(rows[:, 3] - rows[:, 1])
        still, inside = rows[:, 2] < STILL * METRES_PER_VOLT, (rows[:, 4] <= rows[:, 1]) & (rows[:, 1] <= rows[:, 5])
        for name, chosen in (("at rest", still), ("moving", ~still)):
            if chosen.any():
                median, most = 1e3 * np.quantile(error[chosen], [0.5, 0.9])
                cells = [kind, chosen.sum(), name, f"{median:.1f}", f"{most:.1f}", f"{inside[chosen].mean():.0%}"]
                print(f"| {' | '.join(map(str, cells))} |", flush=True)
    print(f"{processor_time() - began:.0f} s of processor time")


if __name__ == "__main__":
    main()
