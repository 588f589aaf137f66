"""Errors of a model with too coarse a mesh: natural frequencies, damping and modal constants, against a finer mesh.

    python tests/benchmarks/mesh_errors.py [--joints 40] [--finer-mesh 4]

Poles and residues of the FRFs are those of rational functions through them (AAA), for random joints of each assembly
that ships with a mesh. Errors are roots of mean squares, the largest twentieth cut; the ratios are over the relative
error of the natural frequencies. The last column is how far they displace the joint that is identified from the finer
mesh's FRF, in its own standard deviations: noise of one per cent of the FRF's, the default model error, all linear.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path

import numpy as np
from scipy.interpolate import AAA

import dovetail
from dovetail.inference.posterior import TYPICAL, error_shapes
from dovetail.problem.residuals import FrfResiduals, Weighted
from dovetail_bench.evaluation.mesh_refinement import finer

ASSEMBLIES = Path(__file__).resolve().parents[2] / "assemblies"
NAMES = ("bt40_er32", "bolted_lap_beam", "shaft_hub", "spindle_bt40_er32")
LINES, TOLERANCE, TERMS = 1100, 1e-9, 40
NOISE, PRIOR = 0.01, 12.0
"""Of the FRF's standard deviation in each line; information of a range, in fractions of it."""
SAME, MOST_DAMPED = 0.01, 0.06
"""Relative distance within which a pole of the finer mesh is the same; damping beyond which a pole is none."""


def poles(frequency: np.ndarray, receptance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the complex natural frequencies [Hz] that one FRF shows, and their residues."""
    top, size = 1.1 * frequency[-1], np.abs(receptance).max()
    thin = slice(None, None, max(1, len(frequency) // LINES))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # many terms, of which those that matter are kept
        found = AAA(frequency[thin] / top, receptance[thin] / size, rtol=TOLERANCE, max_terms=TERMS)
        at, residue = found.poles() * top, found.residues() * size * top
    shown = (at.real > 1.5 * frequency[0]) & (at.real < 0.99 * frequency[-1]) & (np.abs(at.imag) < MOST_DAMPED * top)
    return at[shown], residue[shown]


def errors(assembly: dovetail.Assembly, factor: int, joints: int) -> np.ndarray:
    """Return errors of frequency, damping (both over the frequency), modal constant and its angle, (n, 4)."""
    theta = assembly.from_unit(np.random.default_rng(1).random((joints, len(assembly.parameters))))
    frequency = assembly.frequency
    factor_of = (2 * np.pi * frequency) ** 2 if assembly.description.response.quantity == "accelerance" else 1.0
    pairs = zip(assembly.frf(theta) / factor_of, finer(assembly, factor).frf(theta) / factor_of, strict=True)
    rows = []
    for coarse, fine in pairs:
        (ours, constants), (theirs, others) = poles(frequency, coarse), poles(frequency, fine)
        for pole, constant in zip(ours, constants, strict=True):
            nearest = int(np.argmin(np.abs(theirs - pole)))
            if abs(theirs[nearest] - pole) < SAME * abs(pole):
                moved, ratio = (theirs[nearest] - pole) / pole.real, others[nearest] / constant
                rows.append((moved.real, moved.imag, abs(ratio) - 1.0, np.angle(ratio)))
    return np.abs(rows)


def root_mean_square(sizes: np.ndarray) -> float:
    """Return the root of the mean square, the largest twentieth cut."""
    return float(np.sqrt(np.mean(np.minimum(sizes, np.quantile(sizes, 0.95)) ** 2)))


def marginalised(rows: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """Return rows (n, m) scaled so that noise and errors (k, m) together have covariance 1."""
    _, sizes, directions = np.linalg.svd(errors, full_matrices=False)
    return rows - rows @ directions.T * (1.0 - 1.0 / np.sqrt(1.0 + sizes**2)) @ directions


def displacement(assembly: dovetail.Assembly, factor: int, joints: int) -> float:
    """Return the root of the mean square, over joints and parameters, of displacements over standard deviations."""
    fractions = np.random.default_rng(1).random((joints, len(assembly.parameters)))
    theta, found = assembly.from_unit(fractions), []
    for fraction, coarse, fine in zip(fractions, assembly.frf(theta), finer(assembly, factor).frf(theta), strict=True):
        variance = np.full(len(coarse), (NOISE * coarse.std()) ** 2)
        plain = Weighted(coarse, variance, np.sqrt(2.0 / variance), True)
        frf = dovetail.Frf(assembly.frequency, coarse, assembly.description.response.quantity)
        shapes = np.concatenate(list(error_shapes([frf], [coarse], TYPICAL).values()))
        errors = plain.jacobian(coarse[np.newaxis], shapes[np.newaxis])[0]
        jacobian = FrfResiduals(assembly, plain).linearise(fraction[np.newaxis]).jacobian[0]
        jacobian, residuals = marginalised(jacobian, errors), marginalised(plain.of(fine[np.newaxis]), errors)[0]
        precision = jacobian @ jacobian.T + PRIOR * np.eye(len(fraction))
        moved = np.linalg.solve(precision, jacobian @ residuals)
        found.append(moved / np.sqrt(np.diag(np.linalg.inv(precision))))
    return float(np.sqrt(np.mean(np.square(found))))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--joints", type=int, default=40)
    parser.add_argument("--finer-mesh", type=int, default=4)
    parser.add_argument("--assemblies", nargs="+", default=NAMES, choices=NAMES, metavar="NAME")
    given = parser.parse_args()
    print("| assembly | natural frequencies | damping, ratio | modal constants, ratio | their angles, ratio | joint |")
    print("|---|---|---|---|---|---|")
    for name in given.assemblies:
        assembly = dovetail.load(ASSEMBLIES / f"{name}.yaml")
        first, *rest = (root_mean_square(column) for column in errors(assembly, given.finer_mesh, given.joints).T)
        moved = displacement(assembly, given.finer_mesh, given.joints)
        print(f"| `{name}` | {first:.1e} | {' | '.join(f'{one / first:.2g}' for one in rest)} | {moved:.2f} |")
