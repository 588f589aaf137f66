"""How often the 90 % intervals of the twelve unknowns of a bushing, from five FRFs, hold the true values.

    python tests/benchmarks/bushing_coverage.py [--cases 100] [--structures 10] [--seed 0] [--samples 100]
                                                [--first 0] [--file CASES] [--seconds 480]

A rigid body of random mass, inertia and place sits on a bushing with random axes upon a post that is welded to the
ground. Sensors and hammer are at random points of the body and in random directions; the lines have random errors of
1 %, and the model is exact. The true parameters are drawn evenly from their ranges, on their scales, which is the
prior. The columns are those of `interval_coverage.py`.

With `--file`, each case is added to a file as it ends, cases that are in it are not run again, none begins after
`--seconds`, and the tables are those of all its cases: so a study runs in slices.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import lru_cache
from pathlib import Path

import numpy as np
from interval_coverage import Case, outcome, table

import dovetail

RANGES = {"k": (1e5, 1e8, "N/m"), "kr": (1e2, 1e5, "N m/rad"), "c": (1.0, 1e3, "N s/m"), "cr": (1e-3, 1.0, "N m s/rad")}
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")


def described(rng: np.random.Generator) -> dict[str, object]:
    """Return the description of a random body on a bushing upon a post."""
    mass, gyration = rng.uniform(0.5, 5.0), rng.uniform(0.02, 0.06, 3)
    moments = mass * (gyration @ gyration - gyration**2)
    points = {f"p{number}": rng.uniform(-0.08, 0.08, 3).tolist() for number in range(6)}
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    parameters = {}
    for direction in DIRECTIONS:
        for letter in "kc":
            low, high, unit = RANGES[letter + "r" * direction.startswith("r")]
            ends = [f"{end:g} {unit}" for end in (low, high)]
            parameters[f"{letter}_{direction}"] = {"range": ends, "scale": "log"}
    responses = [
        {
            "at": "body",
            "position": f"p{number}",
            "direction": rng.normal(size=3).tolist(),
            "force": {"position": "p5", "direction": rng.normal(size=3).tolist()},
        }
        for number in range(5)
    ]
    section = {"length": 0.15, "width": 0.05, "height": 0.04, "elements": 4}
    return {
        "dovetail": 1,
        "name": "body on a bushing",
        "frequency": {"start": 10.0, "stop": 2000.0, "lines": 800},
        "substructures": {
            "body": {
                "model": "rigid_body",
                "mass": mass,
                "inertia": moments.tolist(),
                "nodes": {"foot": rng.uniform(-0.05, 0.05, 3).tolist(), **points},
                "place": {},
            },
            "post": {
                "model": "spatial_beam",
                "material": {"young": 210e9, "density": 7850.0, "loss_factor": 0.002},
                "sections": [section],
                "place": {},
            },
            "ground": {"model": "ground"},
        },
        "joints": {
            "weld": {
                "model": "rigid",
                "direction": "all",
                "connect": {"a": {"to": "post", "at": 0.0}, "b": {"to": "ground", "at": 0.0}},
            },
            "bushing": {
                "model": "bushing",
                "axes": {"x": axes[:, 0].tolist(), "y": axes[:, 1].tolist()},
                "connect": {"a": {"to": "post", "at": 0.15}, "b": {"to": "body", "at": "foot"}},
                "parameters": parameters,
            },
        },
        "responses": responses,
    }


@lru_cache(maxsize=32)
def structure(number: int, seed: int) -> dovetail.Assembly:
    """Return one of the structures, whose body stands on the post."""
    whole = described(np.random.default_rng([seed, 95, number]))
    parts = whole["substructures"]
    parts["body"]["place"] = {"origin": (np.array([0.0, -0.15, 0.0]) - parts["body"]["nodes"]["foot"]).tolist()}
    return dovetail.load(whole)


def identified(number: int, seed: int, structures: int, samples: int) -> Case:
    """Draw a case and identify it by the default method."""
    rng, assembly = np.random.default_rng([seed, 96, number]), structure(number % structures, seed)
    theta = assembly.from_unit(rng.random(len(assembly.parameters)))
    seeds = rng.integers(0, 2**31, len(assembly.each_response)).tolist()
    alone = zip(assembly.each_response, seeds, strict=True)
    measured = [dovetail.noisy_frf(each.simulate(theta), 0.01, draw) for each, draw in alone]
    return outcome(number, number % structures, assembly, theta, measured, samples)


def cases_in(file: Path) -> list[Case]:
    """Return the cases of a file, one JSON object a line."""
    if not file.exists():
        return []
    names, cases = [field.name for field in fields(Case)], []
    for line in file.read_text(encoding="utf-8").splitlines():
        values = {name: json.loads(line)[name] for name in names}
        arrays = {name: np.array(values[name], dtype=bool) for name in ("below", "above")}
        texts = {name: tuple(values[name]) for name in ("names", "verdicts")}
        cases.append(Case(**{**values, **arrays, **texts}))
    return cases


def add(case: Case, file: Path) -> None:
    """Add a case to a file."""
    arrays = {"below": case.below.tolist(), "above": case.above.tolist()}
    with file.open("a", encoding="utf-8") as lines:
        lines.write(json.dumps({**vars(case), **arrays}) + "\n")


def run_slice(count: int, structures: int, seed: int, samples: int, first: int, file: Path, limit: float) -> list[Case]:
    """Identify cases that a file lacks, until `limit` [s] is over, and return all that it then has."""
    began, known = time.monotonic(), {case.number for case in cases_in(file)}
    for number in range(first, first + count):
        if number not in known and time.monotonic() - began < limit:
            add(identified(number, seed, structures, samples), file)
    return cases_in(file)


def print_tables(cases: Sequence[Case], report: Callable[[str], object] = print) -> None:
    """Print the tables."""
    report(table("all", cases, lambda case, index: "all"))
    report(table("verdict", cases, lambda case, index: case.verdicts[index]))
    report(table("parameter", cases, lambda case, index: case.names[index]))
    report(table("structure", cases, lambda case, index: f"{case.structure:2d}"))
    report(f"median {np.median([case.seconds for case in cases]):.2f} s for five FRFs")


def study(
    count: int, structures: int, seed: int, samples: int, report: Callable[[str], object] = print, first: int = 0
) -> list[Case]:
    """Identify the cases from number `first` on and print the tables."""
    cases = [identified(number, seed, structures, samples) for number in range(first, first + count)]
    print_tables(cases, report)
    return cases


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--structures", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0, help="of the structures, parameters and noise")
    parser.add_argument("--samples", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="number of the first case, to run a study in slices")
    parser.add_argument("--file", type=Path, help="that keeps the cases")
    parser.add_argument("--seconds", type=float, default=480.0, help="after which no further case begins, with --file")
    options = parser.parse_args()
    run = options.cases, options.structures, options.seed, options.samples
    if options.file:
        print_tables(run_slice(*run, options.first, options.file, options.seconds))
    else:
        study(*run, first=options.first)
