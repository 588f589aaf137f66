"""Identify the bolted lap, the shaft in its hub and the spindle from their measurements: errors and intervals.

    python assemblies/measurements/identify_joints.py [NAME ...] [--mesh TIMES]

Prints, as Markdown, each parameter's estimate and true value, its error and its 90 % interval. Prints also the time
of an FRF and its difference from the direct solve of the whole assembly. With ``--mesh 4`` the identifying model has
the mesh of the structure that was measured and is allowed no error, so that noise alone is left; the direct solve,
which takes minutes there, is left out.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np
from make_joints import finer

import dovetail
from dovetail.identification.truth import read_truth
from dovetail.synthesis import direct_receptance

HERE = Path(__file__).resolve().parent
NAMES = ("bolted_lap_beam", "shaft_hub", "spindle_bt40_er32")


def identified(name: str, mesh: int) -> tuple[dovetail.Assembly, dovetail.Identification, np.ndarray]:
    """Return the assembly, the result and the true values."""
    assembly = dovetail.load(HERE.parent / f"{name}.yaml")
    options = {}
    if mesh > 1:
        assembly = dovetail.load(finer(json.loads(assembly.description.text), mesh))
        options = {"model_error": 0.0}
    result = dovetail.identify(assembly, dovetail.read_frf(HERE / f"{name}.uff"), "posterior", **options)
    known = read_truth(HERE / f"{name}.truth.json", assembly.parameters)
    truth = np.array([known.parameters[parameter.name] for parameter in assembly.parameters])
    return assembly, result, truth


def off_direct_solve(assembly: dovetail.Assembly, theta: np.ndarray) -> float:
    """Return the largest relative difference of the receptance from the direct solve, over all lines."""
    response = assembly.description.response  # along x
    number = [int(assembly.graph.substructure_dofs(response.substructure)[2 * response.node])]
    by_joint = assembly.by_joint(theta)
    direct = direct_receptance(assembly.graph, assembly.frequency, by_joint, number, number)[:, 0, 0]
    found = assembly.frf(theta) / -((2 * np.pi * assembly.frequency) ** 2)
    return float(np.max(np.abs(found - direct) / np.abs(direct)))


def time_of_frf(assembly: dovetail.Assembly, batch: int = 64) -> float:
    """Return seconds for one FRF of a batch on one thread."""
    assembly.engine.threads = 1
    theta = assembly.from_unit(np.random.default_rng(0).random((batch, len(assembly.parameters))))
    assembly.frf(theta)
    begin = time.perf_counter()
    assembly.frf(theta)
    return (time.perf_counter() - begin) / batch


def show(name: str, mesh: int) -> None:
    """Print one assembly's table and figures."""
    begin = time.perf_counter()
    assembly, result, truth = identified(name, mesh)
    seconds = time.perf_counter() - begin
    posterior = result.posterior
    assert posterior is not None
    print("| parameter | unit | truth | estimate | error | 90 % interval | inside | precision | verdict |")
    print("|---|---|---|---|---|---|---|---|---|")
    for parameter, true, value in zip(assembly.parameters, truth, posterior.estimate, strict=True):
        lower, upper = posterior.interval()[parameter.name]
        verdict = posterior.verdicts[parameter.name]
        inside = "yes" if lower <= true <= upper else "no"
        print(
            f"| `{parameter.name}` | {parameter.unit} | {true:.4g} | {value:.4g} | {value / true - 1.0:+.2%} "
            f"| {lower:.4g} to {upper:.4g} | {inside} | {verdict.precision} | {verdict.word} |"
        )
    fit = result.fit
    assert fit is not None
    print(
        f"\nChi-squared {fit.chi_squared:.3f}, mean coherence {result.mean_coherence:.5f}; the fit took "
        f"{fit.seconds:.1f} s, all of it {seconds:.1f} s."
    )
    lines, milliseconds = len(assembly.frequency), 1e3 * time_of_frf(assembly)
    print(f"One FRF of {lines} lines takes {milliseconds:.2f} ms on one thread.")
    if mesh == 1:
        print(f"It is off the direct solve by {off_direct_solve(assembly, truth):.1e} at most.")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=NAMES)
    parser.add_argument("--mesh", type=int, default=1, help="elements of the identifying model, times")
    given = parser.parse_args()
    for chosen in given.names:
        if len(given.names) > 1:
            print(f"\n## {chosen}\n")
        show(chosen, given.mesh)
