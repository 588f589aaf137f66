"""A genuine pair of Abaqus files in FORMAT=MATRIX INPUT: a beam of one B33 element against its shape functions.

    python tests/benchmarks/abaqus_beam.py FOLDER

FOLDER is test/test_beam3d_mass_matrix in a clone of JuliaFEM/FEMBeam.jl (MIT), whose files are not copied here. Abaqus
wrote model_STIF1.mtx and model_MASS1.mtx for model.inp: a beam of 3 m, with an internal node of two DOFs. The element
bends without shear; its mass is integrated at three points, and it has no rotary inertia.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import dovetail

LENGTH, AREA, SECOND_MOMENT, TORSION = 3.0, 0.25, 1.5e-4, 3.0e-4
YOUNG, SHEAR, DENSITY = 100e6, 80e6, 100.0
SPRING = {"k_x": 2e7, "k_y": 3e5, "k_z": 4e5, "k_rx": 1e4, "k_ry": 5e4, "k_rz": 6e4}
ORDER = dovetail.DIRECTIONS


def cubic(s: float, derivative: int) -> NDArray[np.float64]:
    """Return a derivative by x of the shape functions of displacement and slope at both ends, at x = s L (4,)."""
    L = LENGTH
    polynomials = [[2.0, -3.0, 0.0, 1.0], [L, -2.0 * L, L, 0.0], [-2.0, 3.0, 0.0, 0.0], [L, -L, 0.0, 0.0]]
    return np.array([np.polyval(np.polyder(np.array(each), derivative), s) for each in polynomials]) / L**derivative


def matrices() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return K and M (14, 14): six DOFs of both ends, then the slopes of the axial displacement, by three points."""
    K, M = np.zeros((14, 14)), np.zeros((14, 14))
    points, weights = np.polynomial.legendre.leggauss(3)
    axial, upright, sideways, twist = [0, 12, 6, 13], [1, 5, 7, 11], [2, 4, 8, 10], [3, 9]
    for s, weight in zip((points + 1.0) / 2.0, weights * LENGTH / 2.0, strict=True):
        shape, slope, curvature = (cubic(s, order) for order in range(3))
        turned = np.array([1.0, -1.0, 1.0, -1.0])  # a rotation about y is minus the slope
        linear, step = np.array([1.0 - s, s]), np.array([-1.0, 1.0]) / LENGTH
        for dofs, sign in ((axial, 1.0), (upright, 1.0), (sideways, turned)):
            stiffness, strain = (YOUNG * AREA, slope) if dofs is axial else (YOUNG * SECOND_MOMENT, curvature)
            K[np.ix_(dofs, dofs)] += weight * stiffness * np.outer(sign * strain, sign * strain)
            M[np.ix_(dofs, dofs)] += weight * DENSITY * AREA * np.outer(sign * shape, sign * shape)
        K[np.ix_(twist, twist)] += weight * SHEAR * TORSION * np.outer(step, step)
        M[np.ix_(twist, twist)] += weight * DENSITY * 2.0 * SECOND_MOMENT * np.outer(linear, linear)
    return K, M


def read(path: Path) -> NDArray[np.float64]:
    """Return a matrix in the order of `matrices`; the slopes of the internal node's DOFs have units of their own."""
    model = dovetail.read_matrices(path)
    (matrix,), table = model.matrices.values(), model.table
    assert table is not None
    rows = {dof: row for row, dof in enumerate(zip(table.nodes, table.directions, strict=True))}
    wanted = [(node, str(number)) for node in "12" for number in range(1, 7)] + [("-1", "1"), ("-1", "2")]
    order = [rows[dof] for dof in wanted]
    return np.asarray(matrix.values.toarray()[np.ix_(order, order)])


def assembly(folder: Path, direction: str) -> dovetail.Assembly:
    """Return the imported beam on springs against the ground, seen at its free end."""
    part = {
        "model": "matrices",
        "stiffness": str(folder / "model_STIF1.mtx"),
        "mass": str(folder / "model_MASS1.mtx"),
        "coordinates": str(folder / "model.inp"),
        "units": {"length": "1 m", "mass": "1 kg", "stiffness": "1 N/m"},
        "loss_factor": 0.02,
        "place": {},
    }
    parameters = {name: {"value": value} for name, value in SPRING.items()}
    parameters |= {name.replace("k_", "c_"): {"value": 0.0} for name in SPRING}
    ends = {"a": {"to": "beam", "at": "node 1"}, "b": {"to": "floor", "at": 0.0}}
    described: dict[str, Any] = {
        "dovetail": 1,
        "name": "beam",
        "frequency": {"start": 1.0, "stop": 100.0, "step": 1.0},
        "substructures": {"beam": part, "floor": {"model": "ground"}},
        "joints": {"foot": {"model": "bushing", "connect": ends, "parameters": parameters}},
        "response": {"at": "beam", "position": "node 2", "direction": direction, "quantity": "receptance"},
    }
    return dovetail.load(described)


def expected(direction: str, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the receptance of the same structure by a dense solution of `matrices`."""
    K, M = matrices()
    springs = np.zeros((14, 14))
    springs[:6, :6] = np.diag(list(SPRING.values()))
    dof = 6 + ORDER.index(direction)
    omegas = 2.0 * np.pi * frequency
    return np.array([np.linalg.inv(K * (1 + 0.02j) + springs - w**2 * M)[dof, dof] for w in omegas])


def main() -> None:
    """Print the differences of the matrices and of FRFs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    for name, ours in zip(("STIF", "MASS"), matrices(), strict=True):
        theirs = read(folder / f"model_{name}1.mtx")
        print(f"{name}: {len(theirs)} DOFs, largest difference at the ends' nodes {worst(theirs, ours):.1e}")
    for direction in ORDER:
        there = assembly(folder, direction)
        found, ours = there.frf(), expected(direction, there.frequency)
        print(f"FRF along {direction}: largest difference {np.abs(found - ours).max() / np.abs(ours).max():.1e}")


def worst(theirs: NDArray[np.float64], ours: NDArray[np.float64]) -> float:
    """Return the largest difference between the DOFs of the ends, over the largest entry of both rows."""
    size = np.sqrt(np.outer(np.diagonal(ours), np.diagonal(ours)))[:12, :12]
    return float((np.abs(theirs - ours)[:12, :12] / size).max())


if __name__ == "__main__":
    main()
