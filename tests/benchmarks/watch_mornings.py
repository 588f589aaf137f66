"""The watch of a spindle's tool holder on 500 simulated mornings: false alarms, delay, time, and kills.

    python tests/benchmarks/watch_mornings.py [--mornings 500] [--runs 4] [--seed 20261127] [--kills 10]

The measured collet assembly is not quite the model: Young's modulus of the tool is 1.4 % higher, its loss factor 20 %,
its diameter is 0.05 mm larger, and the holder's taper is 1 mm longer. Each FRF has complex noise of 1 % of its
standard deviation.
`kt_tc` falls slowly, by 3 % over all mornings, and all stiffnesses and damping coefficients of the collet walk by
0.03 % a morning. Half of the runs have no sudden change; in the others `kt_tc` falls by 10 % on a random morning.
"""

from __future__ import annotations

import argparse
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from pathlib import Path

import numpy as np

import dovetail
from dovetail.monitoring import ALARM, PREDICTED, Watch, WatchOptions

ASSEMBLY = Path(__file__).resolve().parents[2] / "assemblies" / "bt40_er32.yaml"
NOISE, DRIFT, WALK, LOSS = 0.01, 0.03, 3e-4, 0.10
FALSE_ALARMS = 1e-3
VARYING = ("kt_tc", "kr_tc", "ct_tc", "cr_tc", "kt_hc", "kr_hc", "ct_hc", "cr_hc")
CONSTANT = ("Dc", "dc", "mn1", "mn2")


@dataclass(frozen=True)
class Run:
    """One watched folder.

    Parameters
    ----------
    loss_at : int or None
        The morning of the sudden loss, from 0.
    alarms : list of int
        Mornings of the alarms, from 0.
    judged : int
        Mornings without a change on which an alarm would be false.
    seconds : (n,) array
        Processor time for each file.
    model : str
        How well the model fits the first file.
    """

    loss_at: int | None
    alarms: list[int]
    judged: int
    seconds: np.ndarray
    model: str

    @property
    def false_alarms(self) -> int:
        """Number of alarms not at the loss: before it, or after the first alarm that follows it."""
        return len(self.alarms) - (self.delay is not None)

    @property
    def delay(self) -> int | None:
        """Number of files from the loss to the alarm, both included; None without one."""
        after = [] if self.loss_at is None else [number for number in self.alarms if number >= self.loss_at]
        return after[0] - self.loss_at + 1 if after and self.loss_at is not None else None


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


def write_mornings(folder: Path, mornings: int, loss_at: int | None, seed: Sequence[int]) -> None:
    """Write the measurements of all mornings, and the description of the watch next to them."""
    folder.mkdir(parents=True)
    assembly, random = measured_assembly(), np.random.default_rng(seed)
    parameters = {parameter.name: parameter for parameter in assembly.parameters}
    start = {name: float(one.from_unit(random.uniform(0.35, 0.65))) for name, one in parameters.items()}
    walk = np.cumsum(WALK * random.standard_normal((mornings, len(VARYING))), axis=0)
    for number in range(mornings):
        theta = start | {name: start[name] * np.exp(walk[number, k]) for k, name in enumerate(VARYING)}
        theta["kt_tc"] *= 1.0 - DRIFT * number / mornings
        theta["kt_tc"] *= 1.0 - LOSS if loss_at is not None and number >= loss_at else 1.0
        exact = dovetail.Frf(assembly.frequency, assembly.frf(theta), "accelerance")
        day = date(2026, 1, 1) + timedelta(days=number)
        dovetail.write_frf(dovetail.noisy_frf(exact, NOISE, random), folder / f"{day}.csv")
    roles = [*(f"  {name}: varying" for name in VARYING), *(f"  {name}: shared" for name in CONSTANT)]
    lines = ["dovetail_series: 1", f"assembly: {ASSEMBLY}", f"tests: {{first: {{measured: {folder}/2026-01-01.csv}}}}"]
    (folder.parent / "watch.yaml").write_text("\n".join([*lines, "parameters:", *roles, ""]), encoding="utf-8")


def watched(place: Path, loss_at: int | None) -> Run:
    """Watch a folder, and return its alarms and times."""
    watch = Watch(place / "watch.yaml", place / "files", place / "out", WatchOptions(FALSE_ALARMS), settle=0.0)
    ends = [time.process_time()]
    watch.look(report=lambda _: ends.append(time.process_time()))
    records = watch.records
    alarms = [number for number, record in enumerate(records) if record["status"] == ALARM]
    judged = sum(record["status"] in (PREDICTED, ALARM) for record in records)
    model = watch.reference.model
    error = np.sqrt(np.mean(model.model_variance / model.random_variance))
    return Run(loss_at, alarms, judged, np.diff(ends), f"model error {error:.2g} of the noise")


def same_after_kills(place: Path, kills: int, random: np.random.Generator, mornings: int) -> bool:
    """Watch a folder again in processes that are killed at random moments; return whether the journal is the same."""
    words = [sys.executable, "-m", "dovetail", "-q", "watch", str(place / "watch.yaml"), str(place / "files")]
    words += ["-o", str(place / "killed"), "--settle", "0"]
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


def run_all(mornings: int, runs: int, seed: int, kills: int) -> list[str]:
    """Return the results as lines of text."""
    results, lines = list[Run](), list[str]()
    for number in range(runs):
        random = np.random.default_rng([seed, number])
        loss_at = int(random.integers(mornings // 5, 4 * mornings // 5)) if number % 2 else None
        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder)
            write_mornings(place / "files", mornings, loss_at, [seed, number])
            results.append(watched(place, loss_at))
            print(f"run {number}: {results[-1].model}, loss {loss_at}, alarms {results[-1].alarms}", flush=True)
            if number == runs - 1 and kills:
                same = same_after_kills(place, kills, random, mornings)
                lines.append(f"The same journal after {kills} kills: {'yes' if same else 'NO'}")
    judged, false = (sum(getattr(run, name) for run in results) for name in ("judged", "false_alarms"))
    delays = [run.delay for run in results if run.loss_at is not None]
    seconds = np.concatenate([run.seconds for run in results])
    median, late = np.quantile(seconds, [0.5, 0.99])
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return [
        f"False alarms: {false} of {judged} files, {1000.0 * false / judged:.2g} per 1000 (specified: 1)",
        f"Files until the alarm after a loss of 10 %: {delays} (1: the first file after it; None: missed)",
        f"Processor time per file: median {1e3 * median:.0f} ms, 99 % below {1e3 * late:.0f} ms, longest "
        f"{seconds.max():.1f} s (once, when the first files are learned from); memory {peak:.0f} MB",
        *lines,
    ]


def main() -> None:
    """Print the results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name, value in (("mornings", 500), ("runs", 4), ("seed", 20261127), ("kills", 10)):
        parser.add_argument(f"--{name}", type=int, default=value)
    options = parser.parse_args()
    print(*run_all(options.mornings, options.runs, options.seed, options.kills), sep="\n")


if __name__ == "__main__":
    main()
