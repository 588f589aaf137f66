"""Are measurements flagged that the model cannot have produced, and no others? Eight kinds of them, random joints.

    python tests/benchmarks/misspecified_measurements.py [--misspecified 25] [--genuine 500] [--finer 100]

The noise is complex, in every line one or five per cent of the standard deviation of the FRF. Its size is not given to
the check. With `--model MODEL` the answer of a trained network is checked as well. With `--name` the flagged cases are
counted whose explanation names the true cause, alone or among others. With `--reach` the cases are counted that any
test could detect: no joint within the ranges comes nearer than the standard deviations of the noise that a detection of
95 % at 2 % of false alarms needs.
"""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import AAA
from scipy.stats import norm

import dovetail
from dovetail.dataset import latin_hypercube
from dovetail.identification.fitting import refine
from dovetail.identification.misspecification import check_misspecification
from dovetail.identification.misspecification.whitened_residuals import whiten_residuals
from dovetail.identification.posterior.model_error import MODEL_ERROR
from dovetail.measurement import complex_noise

ASSEMBLY = Path(__file__).resolve().parents[2] / "assemblies" / "bt40_er32.yaml"
NOISES = (0.01, 0.05)
NEEDED = norm.ppf(0.95) + norm.ppf(0.98)
"""Standard deviations by which two FRFs must differ for a test to detect 95 % at 2 % of false alarms: 3.7."""
Kind = Callable[[np.ndarray, int], np.ndarray]
"""From a joint (n_params,) and the number of the case to the FRF that is measured, without noise."""


def changed(change: Callable[[dict[str, Any]], None]) -> dovetail.Assembly:
    """Return the assembly with another description."""
    description = json.loads(dovetail.load(ASSEMBLY).description.text)
    change(description)
    return dovetail.load(description)


@cache
def with_tool(longer: float) -> dovetail.Assembly:
    """Return the assembly with a tool that stands out further [mm]."""

    def change(description: dict[str, Any]) -> None:
        length = 100.0 + longer
        tool = description["substructures"]["tool"]
        (section,) = tool["sections"]
        lengths = {"10 mm": 1, f"{length - 30} mm": 8, "20 mm": 2}
        tool["sections"] = [dict(section, length=one, elements=count) for one, count in lengths.items()]
        at = [f"{length - back} mm" for back in (20.0, 10.0, 0.0)]
        description["joints"]["collet"]["connect"]["tool"]["at"] = at

    return changed(change)


@cache
def with_holder(section: int, longer: float) -> dovetail.Assembly:
    """Return the assembly with one section of the holder longer [mm]."""

    def change(description: dict[str, Any]) -> None:
        one = description["substructures"]["holder"]["sections"][section]
        one["length"] = f"{float(one['length'].split()[0]) + longer} mm"

    return changed(change)


@cache
def measured_at(position: float) -> dovetail.Assembly:
    """Return the assembly measured at another point of the tool [mm from the tip]."""
    return changed(lambda description: description["response"].update(position=f"{position} mm"))


@cache
def finer(factor: int) -> dovetail.Assembly:
    """Return the assembly with `factor` elements in the place of each."""

    def change(description: dict[str, Any]) -> None:
        for part in description["substructures"].values():
            for section in part["sections"]:
                section["elements"] = int(section.get("elements", 1)) * factor
        description["joints"]["collet"]["elements_per_segment"] = factor

    return changed(change)


def stretched(assembly: dovetail.Assembly, theta: np.ndarray, by: float) -> np.ndarray:
    """Return the FRF on a frequency axis that is off by the part `by`: f is said to be f (1 + by)."""
    return assembly.on(assembly.frequency / (1.0 + by)).frf(theta)


def cut_off(values: np.ndarray, share: float) -> np.ndarray:
    """Return an FRF whose amplitude is limited to the level that `share` of its lines exceed."""
    level = np.quantile(np.abs(values), 1.0 - share)
    return np.where(np.abs(values) > level, level * values / np.abs(values), values)


def without_mode(frequency: np.ndarray, values: np.ndarray, rank: int, part: float = 1.0) -> np.ndarray:
    """Return an accelerance without (a part of) one of its two most prominent resonances.

    Its poles come from a rational function through the FRF (AAA), and the pair of poles is taken off the receptance.
    """
    rational = AAA(frequency, -values, rtol=1e-9, max_terms=60)  # receptance times omega squared
    poles, residues = rational.poles(), rational.residues()
    inside = (poles.real > frequency[0]) & (poles.real < frequency[-1]) & (poles.imag > 0)
    poles, residues = poles[inside], residues[inside]
    strongest = np.argsort(-np.abs(residues / poles.imag))
    chosen = strongest[min(rank, len(strongest) - 1)]
    pole, residue = poles[chosen], residues[chosen] / poles[chosen] ** 2
    term = residue / (frequency - pole) - np.conj(residue) / (frequency + np.conj(pole))
    return values + part * frequency**2 * term


NAMES = {
    "tool": "tool stood out",
    "holder": "length' of the holder|holder stood out",
    "quantity": "(9.807|4.448|1000) times too|it were a (mobility|receptance)",
    "mass": "accelerometer mass",
    "point": "measured on the tool at 20 mm",
    "axis": "frequency axis",
    "clipped": "cut off",
    "mode": "resonance were missing",
}
"""What the name of a cause must say, by the first word of the kind."""


def says(words: str, kind: str) -> bool:
    """Say whether words name what kind of a measurement it is."""
    return any(kind.startswith(first) and re.search(pattern, words) is not None for first, pattern in NAMES.items())


def kinds(assembly: dovetail.Assembly) -> Mapping[str, Kind]:
    """Return the eight kinds at the sizes at which they happen."""
    turned = 2j * np.pi * assembly.frequency
    units = (9.80665, 1.0 / 9.80665, 4.44822, 1.0 / 4.44822, 1e-3)
    quantities = (turned**-1, turned**-2)
    sections = (2, 4, 5, 7)

    def unit_or_quantity(theta: np.ndarray, case: int) -> np.ndarray:
        by = quantities[case // 2 % 2] if case % 2 else units[case // 2 % len(units)]
        return assembly.frf(theta) * by

    return {
        "tool 10 mm longer": lambda theta, _: with_tool(10.0).frf(theta),
        "holder section 10 mm longer": lambda theta, case: with_holder(sections[case % 4], 10.0).frf(theta),
        "quantity or unit": unit_or_quantity,
        "mass of 1.2 g left in": lambda theta, _: assembly.frf(theta) / (1.0 + 1.2e-3 * assembly.frf(theta)),
        "point 10 mm away": lambda theta, _: measured_at(20.0).frf(theta),
        "axis off by 1 %": lambda theta, case: stretched(assembly, theta, (0.01, -0.01)[case % 2]),
        "clipped, 3 % of the lines": lambda theta, _: cut_off(assembly.frf(theta), 0.03),
        "mode missing": lambda theta, case: without_mode(assembly.frequency, assembly.frf(theta), case % 2),
    }


def sizes(assembly: dovetail.Assembly) -> Mapping[str, Kind]:
    """Return causes of several sizes."""

    def axis(by: float) -> Kind:
        return lambda theta, case: stretched(assembly, theta, by if case % 2 else -by)

    def mass(grams: float) -> Kind:
        return lambda theta, _: assembly.frf(theta) / (1.0 + 1e-3 * grams * assembly.frf(theta))

    return {
        "mass of 0.3 g left in": mass(0.3),
        "mass of 0.1 g left in": mass(0.1),
        "all values 1 % too large": lambda theta, _: 1.01 * assembly.frf(theta),
        "axis off by 2 %": axis(0.02),
        "axis off by 0.5 %": axis(0.005),
        "holder section 20 mm longer": lambda theta, case: with_holder((2, 4, 5, 7)[case % 4], 20.0).frf(theta),
        "tool 3 mm longer": lambda theta, _: with_tool(3.0).frf(theta),
    }


def measurement(assembly: dovetail.Assembly, values: np.ndarray, level: float, seed: int) -> dovetail.Frf:
    """Return an FRF with noise of `level` times its own standard deviation in each line, which it does not tell."""
    random = np.random.default_rng([seed, round(1e3 * level)])
    return dovetail.Frf(assembly.frequency, complex_noise(values, level, random, kind="uniform"), "accelerance")


def distance(
    assembly: dovetail.Assembly, values: np.ndarray, level: float, theta: np.ndarray, model_error: float
) -> float:
    """Return how far an FRF without noise is from the nearest joint, in standard deviations of the noise.

    What the model is allowed to err counts as noise. No test can tell it from that joint's FRF better than a test that
    knows both, whose power this distance gives.
    """
    variance = np.full(len(values), (level * values.std()) ** 2)
    measured = dovetail.Frf(assembly.frequency, values, "accelerance", variance=variance)
    fits = (refine(assembly, measured), refine(assembly, measured, (theta,)))
    residuals = (whiten_residuals(assembly, measured, replace(fit, variance=variance), model_error) for fit in fits)
    return min(float(np.linalg.norm(near.whitening.of(near.values[np.newaxis]))) for near in residuals)


class Outcomes:
    """What the check says of the measurements of one kind."""

    def __init__(self) -> None:
        self.refined: dict[float, list[bool]] = {level: [] for level in NOISES}
        self.network: dict[float, list[bool]] = {level: [] for level in NOISES}
        self.named: dict[float, list[bool]] = {level: [] for level in NOISES}
        self.in_reach: dict[float, list[bool]] = {level: [] for level in NOISES}
        self.words: dict[float, list[str]] = {level: [] for level in NOISES}


def study(
    assembly: dovetail.Assembly,
    of_kinds: Mapping[str, tuple[Kind, int]],
    model: dovetail.Identifier | None,
    *,
    model_error: float = MODEL_ERROR,
    name: bool = False,
    reach: bool = False,
) -> Iterator[tuple[str, Outcomes]]:
    """Yield what the check says of the measurements of each kind, (kind, number of cases)."""
    for kind, (make, count) in of_kinds.items():
        counts = Outcomes()
        for case, theta in enumerate(latin_hypercube(assembly, count, seed=len(kind))):
            values = make(theta, case)
            for level in NOISES:
                measured = measurement(assembly, values, level, case)
                verdict = check_misspecification(
                    assembly, measured, refine(assembly, measured), model_error, explain=name
                )
                counts.refined[level].append(verdict.flagged)
                counts.words[level].append(verdict.looks_like)
                if name and verdict.flagged and not kind.startswith("genuine"):
                    counts.named[level].append(says(verdict.looks_like, kind))
                if model is not None:
                    answer = model.identify(measured).misspecification
                    counts.network[level].append(answer is not None and answer.flagged)
                if reach:
                    separation = distance(assembly, values, level, theta, model_error)
                    counts.in_reach[level].append(separation > NEEDED)
        yield kind, counts


def together(each_kind: Iterable[Outcomes]) -> Outcomes:
    """Return the counts of several kinds as one."""
    whole = Outcomes()
    for counts in each_kind:
        for level in NOISES:
            whole.refined[level] += counts.refined[level]
            whole.in_reach[level] += counts.in_reach[level]
            whole.named[level] += counts.named[level]
            whole.network[level] += counts.network[level]
    return whole


def row(kind: str, counts: Outcomes) -> str:
    """Return one line of the table."""
    cells = []
    for by_level in (counts.refined, counts.in_reach, counts.named, counts.network):
        cells += [f"{sum(flags)} of {len(flags)}" if flags else "-" for flags in by_level.values()]
    return f"| {kind} | " + " | ".join(cells) + " |"


HEADER = (
    "| measurement | flagged, 1 % noise | 5 % | in reach, 1 % | 5 % | named, 1 % | 5 % | network, 1 % | 5 % |\n"
    "|---|---|---|---|---|---|---|---|---|"
)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--misspecified", type=int, default=25, help="cases of each kind")
    parser.add_argument("--genuine", type=int, default=500)
    parser.add_argument("--finer", type=int, default=100, help="genuine cases from a mesh four times finer")
    parser.add_argument("--model", type=Path, help="folder of a trained model")
    parser.add_argument("--model-error", type=float, default=MODEL_ERROR, help="0 if the model is known to be exact")
    parser.add_argument("--reach", action="store_true", help="count those that any test could find")
    parser.add_argument("--name", action="store_true", help="name what looks wrong, and print it")
    parser.add_argument("--sizes", action="store_true", help="causes of other sizes in place of the eight kinds")
    parser.add_argument("--only", help="kinds that begin with this, or one of these with commas between")
    options = parser.parse_args()
    assembly = dovetail.load(ASSEMBLY)
    model = None if options.model is None else dovetail.load_model(options.model)
    causes = sizes(assembly) if options.sizes else kinds(assembly)
    of_kinds: dict[str, tuple[Kind, int]] = {kind: (make, options.misspecified) for kind, make in causes.items()}
    of_kinds["genuine"] = lambda theta, _: assembly.frf(theta), options.genuine
    of_kinds["genuine, mesh four times finer"] = lambda theta, _: finer(4).frf(theta), options.finer
    if options.only:
        of_kinds = {kind: entry for kind, entry in of_kinds.items() if kind.startswith(tuple(options.only.split(",")))}
    print(HEADER, flush=True)
    misspecified = []
    for kind, counts in study(
        assembly, of_kinds, model, model_error=options.model_error, name=options.name, reach=options.reach
    ):
        if kind == "genuine" and misspecified:
            print(row("all of these", together(misspecified)), flush=True)
        misspecified.append(counts)
        print(row(kind, counts), flush=True)
        if options.name:
            for level, words in counts.words.items():
                print("\n".join(f"    {level:.0%}: {sentence}" for sentence in words), flush=True)


if __name__ == "__main__":
    main()
