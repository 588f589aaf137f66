"""The watch of a spindle's tool holder on 500 simulated mornings: false alarms, delay, time, and kills.

    python tests/benchmarks/watch_mornings.py [--mornings 500] [--runs 4] [--changes 10] [--seed 20261127] [--kills 10]

The measured collet assembly is not quite the model: Young's modulus of the tool is 1.4 % higher, its loss factor 20 %,
its diameter is 0.05 mm larger, and the holder's taper is 1 mm longer. Each FRF has complex noise of 1 % of its
standard deviation.
`kt_tc` falls slowly, by 3 % over all mornings, and all stiffnesses and damping coefficients of the collet walk by
0.03 % a morning. None of this may raise an alarm. From random mornings of each run, `kt_tc` falls in addition: by 10 %
at once (`--changes` of each run), or by 0.1 % a morning (half as many).
"""

from __future__ import annotations

import argparse
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from pathlib import Path

import numpy as np
from processors import processor_time

import dovetail
from dovetail.monitoring import WatchOptions
from dovetail.monitoring.reference import Reference
from dovetail.monitoring.tracker import State, Tracker
from dovetail.series import read_series

ASSEMBLY = Path(__file__).resolve().parents[2] / "assemblies" / "bt40_er32.yaml"
NOISE, DRIFT, WALK = 0.01, 0.03, 3e-4
OPTIONS = WatchOptions(false_alarms=1e-3)
CHANGES: dict[str, Callable[[int], float]] = {"10 % at once": lambda _: 0.9, "0.1 % a file": lambda files: 0.999**files}
"""Factors of `kt_tc` at the n-th file of a change."""
MOST_FILES = 30
"""Files of a change that are watched."""
VARYING = ("kt_tc", "kr_tc", "ct_tc", "cr_tc", "kt_hc", "kr_hc", "ct_hc", "cr_hc")
CONSTANT = ("Dc", "dc", "mn1", "mn2")


@dataclass(frozen=True)
class Run:
    """One run of mornings.

    Parameters
    ----------
    false_alarms : list of int
        Mornings of the alarms, from 0.
    judged : int
        Mornings on which an alarm would be false.
    delays : dict of str to list of (int or None)
        Files from the beginning of a change to the alarm, both included, by the kind of change; None without an alarm.
    seconds : (n,) array
        Processor time for each file.
    model : str
        How well the model fits the first file.
    """

    false_alarms: list[int]
    judged: int
    delays: dict[str, list[int | None]]
    seconds: np.ndarray
    model: str


def measured_assembly() -> dovetail.Assembly:
    """Return the assembly that is measured, which is not quite the model."""
    sections = [
        {"length": "10 mm", "outer": "50 mm", "inner": "30.6 mm"},
        {"length": "10 mm", "outer": "50 mm", "inner": "27.8 mm"},
        {"length": "11 mm", "outer": "50 mm", "inner": "25 mm"},
        {"length": "22 mm", "outer": "50 mm", "inner": "22 mm", "elements": 2},
        {"length": "9 mm", "outer": "63 mm", "inner": "17 mm"},
        {"length": "9 mm", "outer": "53 mm", "inner": "17 mm"},
        {"length": "9 mm", "outer": "63 mm", "inner": "17 mm"},
        {"length": "66.4 mm", "outer": "44.45 mm", "outer_end": "25.375 mm", "inner": "17 mm", "elements": 10},
    ]
    tool = {"young": "592 GPa", "density": "14451.3 kg/m^3", "poisson": 0.3, "loss_factor": 0.006}
    holder = {"young": "199.4 GPa", "density": "7711.5 kg/m^3", "poisson": 0.3, "loss_factor": 0.003}
    parts = {
        "tool": {
            "model": "timoshenko_beam",
            "material": tool,
            "sections": [{"length": "100 mm", "outer": "10.05 mm", "elements": 10}],
        },
        "holder": {"model": "timoshenko_beam", "material": holder, "sections": sections},
    }
    return dovetail.load({"extends": str(ASSEMBLY), "substructures": parts})


class Mornings:
    """The joint on all mornings, and its measurements.

    Parameters
    ----------
    count : int
    seed : sequence of int
    """

    def __init__(self, count: int, seed: Sequence[int]) -> None:
        self.assembly, self.random = measured_assembly(), np.random.default_rng(seed)
        parameters = {parameter.name: parameter for parameter in self.assembly.parameters}
        start = {name: float(one.from_unit(self.random.uniform(0.35, 0.65))) for name, one in parameters.items()}
        walk = np.exp(np.cumsum(WALK * self.random.standard_normal((count, len(VARYING))), axis=0))
        walk[:, VARYING.index("kt_tc")] *= 1.0 - DRIFT * np.arange(count) / count
        self.theta = [start | {name: start[name] * row[k] for k, name in enumerate(VARYING)} for row in walk]

    def write(self, file: Path, number: int, factor: float = 1.0) -> None:
        """Write the measurement of a morning, with a factor of `kt_tc`."""
        theta = self.theta[number] | {"kt_tc": factor * self.theta[number]["kt_tc"]}
        exact = dovetail.Frf(self.assembly.frequency, self.assembly.frf(theta), "accelerance")
        dovetail.write_frf(dovetail.noisy_frf(exact, NOISE, self.random), file, overwrite=True)

    def write_all(self, folder: Path) -> None:
        """Write the measurements of all mornings, and the description of the watch next to their folder."""
        folder.mkdir(parents=True)
        for number in range(len(self.theta)):
            self.write(folder / f"{date(2026, 1, 1) + timedelta(days=number)}.csv", number)
        first = f"tests: {{first: {{measured: {folder}/2026-01-01.csv}}}}"
        roles = [*(f"  {name}: varying" for name in VARYING), *(f"  {name}: shared" for name in CONSTANT)]
        lines = ["dovetail_series: 1", f"assembly: {ASSEMBLY}", first, "parameters:", *roles, ""]
        (folder.parent / "watch.yaml").write_text("\n".join(lines), encoding="utf-8")


def watched(place: Path, mornings: Mornings, changes: int) -> Run:
    """Watch all mornings, then changes that begin on some of them, and return alarms and times."""
    reference = Reference.of(read_series(place / "watch.yaml"))
    tracker, seconds, alarms = Tracker(reference, OPTIONS), list[float](), list[int]()
    states = [tracker.start()]
    for number, file in enumerate(sorted((place / "files").iterdir())):
        began = processor_time()
        step = tracker.step(states[-1], reference.read([file]).observations, {})
        seconds.append(processor_time() - began)
        states.append(step.state)
        alarms += [number] if step.alarm else []
    chosen = mornings.random.integers(OPTIONS.reference, len(states) - MOST_FILES, changes + changes // 2)
    delays: dict[str, list[int | None]] = {name: [] for name in CHANGES}
    for number, begin in enumerate(chosen.tolist()):
        name = list(CHANGES)[number >= changes]
        delays[name].append(_delay(place, mornings, tracker, states[begin], begin, CHANGES[name]))
    error = np.sqrt(np.mean(reference.model.model_variance / reference.model.random_variance))
    model = f"model error {error:.2g} of the noise"
    return Run(alarms, len(states) - 1 - OPTIONS.reference, delays, np.array(seconds), model)


def _delay(
    place: Path, mornings: Mornings, tracker: Tracker, state: State, begin: int, factor_of: Callable[[int], float]
) -> int | None:
    """Return how many files of a change it takes to raise an alarm."""
    for files in range(1, MOST_FILES + 1):
        mornings.write(place / "changed.csv", begin + files - 1, factor_of(files))
        step = tracker.step(state, tracker.reference.read([place / "changed.csv"]).observations, {})
        if step.alarm:
            return files
        state = step.state
    return None


def same_after_kills(place: Path, kills: int, random: np.random.Generator, mornings: int) -> bool:
    """Watch a folder in processes that are killed at random moments; return whether the journal is as without kills."""
    words = [sys.executable, "-m", "dovetail", "-q", "watch", str(place / "watch.yaml"), str(place / "files")]
    words += ["--settle", "0", "-o"]
    subprocess.run([*words, str(place / "out"), "--once"], stdout=subprocess.DEVNULL, check=False)
    words.append(str(place / "killed"))
    journal = place / "killed" / "files.jsonl"
    for number in range(kills):
        process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        while lines_in(journal) < (number + 1) * mornings // (kills + 1) and process.poll() is None:
            time.sleep(0.01)
        time.sleep(random.uniform(0.0, 0.05))
        process.send_signal(signal.SIGKILL)
        process.wait()
    subprocess.run([*words, "--once"], stdout=subprocess.DEVNULL, check=False)
    journals = [(place / folder / "files.jsonl").read_bytes() for folder in ("out", "killed")]
    return journals[0] == journals[1]


def lines_in(journal: Path) -> int:
    """Return the number of lines of a journal, 0 if there is none yet."""
    return journal.read_bytes().count(b"\n") if journal.exists() else 0


def run_all(count: int, runs: int, changes: int, seed: int, kills: int) -> list[str]:
    """Return the results as lines of text."""
    results, lines = list[Run](), list[str]()
    for number in range(runs):
        with tempfile.TemporaryDirectory() as folder:
            place, mornings = Path(folder), Mornings(count, [seed, number])
            mornings.write_all(place / "files")
            results.append(watched(place, mornings, changes))
            print(f"run {number}: {results[-1].model}, false alarms {results[-1].false_alarms}", flush=True)
            if number == runs - 1 and kills:
                same = same_after_kills(place, kills, mornings.random, count)
                lines.append(f"The same journal after {kills} kills: {'yes' if same else 'NO'}")
    judged, false = sum(run.judged for run in results), sum(len(run.false_alarms) for run in results)
    seconds = np.concatenate([run.seconds for run in results])
    median, late = np.quantile(seconds, [0.5, 0.99])
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return [
        f"False alarms: {false} of {judged} files, {1000.0 * false / judged:.2g} per 1000 (specified: at most 1)",
        *(_delays_text(name, [delay for run in results for delay in run.delays[name]]) for name in CHANGES),
        f"Processor time per file: median {1e3 * median:.0f} ms, 99 % below {1e3 * late:.0f} ms, longest "
        f"{seconds.max():.1f} s (once, when the first files are learned from); memory {peak:.0f} MB",
        *lines,
    ]


def _delays_text(name: str, delays: list[int | None]) -> str:
    """Return how many changes raised the alarm at which file."""
    counts = Counter(delays)
    found = [f"{counts[files]} at file {files}" for files in sorted(one for one in counts if one is not None)]
    return f"kt_tc falls by {name}, {len(delays)} times, alarm: {', '.join(found)}; none {counts[None]}"


def main() -> None:
    """Print the results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name, value in (("mornings", 500), ("runs", 4), ("changes", 10), ("seed", 20261127), ("kills", 10)):
        parser.add_argument(f"--{name}", type=int, default=value)
    options = parser.parse_args()
    print(*run_all(options.mornings, options.runs, options.changes, options.seed, options.kills), sep="\n")


if __name__ == "__main__":
    main()
