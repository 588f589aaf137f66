"""How does the program judge real structures, and does it name the cause if a measurement was altered on purpose?

    python tests/benchmarks/measured_structures.py --convert CLONE --convert CLONE --data FOLDER
    python tests/benchmarks/measured_structures.py --data FOLDER [--altered] [--method posterior] [--only beam]

The measurements are public, but only the oscillator's licence (MIT) would allow them to be part of this repository; so
they are read from clones, once:

    git clone https://github.com/Daniel-Sottovia/Grupo-6                                       # FRF.csv: frame
    git clone https://github.com/matthijsvandevosse/Structual-Model-Updating-TNO               # a .mat file: beam
    git clone https://github.com/vibrationtoolbox/vibration_toolbox                            # case1.mat: oscillator

`--convert` writes the FRFs that it finds in a clone to NPZ files in the folder of `--data`, 15 of the beam, three of
the frame, one of the oscillator. What is known about the structures stands in the descriptions in the folder
measured_structures. A structure whose file is missing is left out.

The first table compares measured natural frequencies, from a fit of complex modes, with those of the identified model.
With `--altered` the sign, gain, unit, delay, phase, point and mass of each measurement are changed, one at a time, and
the table shows the cause that is named first. No cause should be named where nothing was altered. The frame with the
masses of its drawings is left out there: a gain of 0.7 explains much of its residual. The column *rise* shows by how
much an alteration makes the best fit worse (`QuickFit.misfit`): where that is less than the least that a cause is named
for, the unknown parameters make up for the alteration, and no comparison of fits can show it.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from measured_data import cases, convert, measured

import dovetail
from dovetail.identification.measured_lines import MeasuredLines
from dovetail.inference.adequacy.causes import CAUSE_SECONDS, Settings
from dovetail.inference.adequacy.quick_fits import QuickFits
from dovetail.inference.fitting import refine

SAME = {
    "unaltered": ("",),
    "unit": ("unit", "gain"),
    "delay as measured": ("delay",),
    "overhang": ("overhang", "point"),
}
"""Kinds of causes that are right for an alteration, where they are others than its name."""


def table_of_structures(data: Path, method: str, only: str) -> None:
    """Print the verdict, natural frequencies, coherence and time of each unaltered measurement."""
    print("| structure | response | verdict | measured [Hz] | model [Hz] | coherence | chi-squared | time |")
    print("|---|---|---|---|---|---|---|---|")
    for structure, frf in measured(data):
        if not structure.name.startswith(only):
            continue
        begin = time.perf_counter()
        result = dovetail.identify(structure.assembly(), frf, method)
        took = time.perf_counter() - begin
        model = ", ".join(f"{mode.natural_frequency:.2f}" for mode in result.modes)
        cells = (
            structure.name,
            result.point or frf.response,
            verdict(result),
            ", ".join(f"{natural:g}" for natural in structure.modes),
            model,
            f"{result.mean_coherence:.3f}",
            "-" if result.fit is None else f"{result.fit.chi_squared:.3g}",
            f"{took:.1f} s",
        )
        print(f"| {' | '.join(cells)} |", flush=True)


def table_of_alterations(data: Path, method: str, only: str, cause_seconds: float) -> None:
    """Print the cause that is named first for each measurement, unaltered and altered, and how many are right."""
    print("| measurement | verdict | rise | first cause | right | time |")
    print("|---|---|---|---|---|---|")
    right: dict[bool, list[bool]] = {True: [], False: []}
    visible: list[bool] = []
    unaltered = 0.0
    for name, frf, assembly in cases(data):
        if not name.startswith(only):
            continue
        begin = time.perf_counter()
        result = dovetail.identify(assembly, frf, method, cause_seconds=cause_seconds)
        took = time.perf_counter() - begin
        kind, words = first_cause(result)
        change = name.split(", ")[1].split(":")[0]
        hit = kind in SAME.get(change, (change,))
        right[change == "unaltered"].append(hit)
        misfit = best_misfit(assembly, frf)
        unaltered = misfit if change == "unaltered" else unaltered
        rise = misfit - unaltered
        if change != "unaltered":
            visible.append(rise >= Settings.least)
        cells = (name, verdict(result), f"{rise:+.2f}", words, "yes" if hit else "no", f"{took:.1f} s")
        print(f"| {' | '.join(cells)} |", flush=True)
    reported = [hit for hit, seen in zip(right[False], visible, strict=True) if seen]
    print(f"\nThe right cause is first in {sum(right[False])} of {len(right[False])} altered measurements.")
    print(
        f"Of the {len(reported)} that make the best fit worse by {Settings.least} or more "
        f"it is first in {sum(reported)}."
    )
    print(f"None is named in {sum(right[True])} of {len(right[True])} unaltered ones.")


def best_misfit(assembly: dovetail.Assembly, frf: dovetail.Frf) -> float:
    """Return how far a measurement is from the best fit of a model, as causes are compared."""
    lines = MeasuredLines.of(assembly, frf)
    return QuickFits(lines.problem, refine(lines.problem)).unchanged.misfit


def verdict(result: dovetail.Identification) -> str:
    """Return the word for how well the model fits."""
    return "not judged" if result.adequacy is None else result.adequacy.word


def first_cause(result: dovetail.Identification) -> tuple[str, str]:
    """Return the kind of the cause that is named first and what is said of it; an empty kind and a dash for none."""
    causes = () if result.adequacy is None else result.adequacy.causes
    return (causes[0].name, causes[0].words) if causes else ("", "-")


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder with the NPZ files")
    parser.add_argument("--convert", type=Path, action="append", default=[], metavar="CLONE", help="may be repeated")
    parser.add_argument("--altered", action="store_true", help="alter the measurements, and name the causes")
    parser.add_argument("--cause-seconds", type=float, default=CAUSE_SECONDS, help="in which causes are searched for")
    parser.add_argument("--method", default="refined")
    parser.add_argument("--only", default="", help="structures whose name begins so")
    arguments = parser.parse_args()
    for clone in arguments.convert:
        print(f"{len(convert(clone, arguments.data))} FRFs of {clone}")
    if arguments.convert:
        return
    if arguments.altered:
        table_of_alterations(arguments.data, arguments.method, arguments.only, arguments.cause_seconds)
    else:
        table_of_structures(arguments.data, arguments.method, arguments.only)


if __name__ == "__main__":
    main()
