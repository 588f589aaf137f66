"""A stiffness matrix in the place of the mass matrix is refused: it has no kinetic energy when the part translates."""

from __future__ import annotations

import numpy as np
import pytest

import dovetail

COUNT = 5
CHAIN = np.diag([1.0, *[2.0] * (COUNT - 2), 1.0]) - np.eye(COUNT, k=1) - np.eye(COUNT, k=-1)


def load(folder, mass, stiffness, order=range(COUNT)):
    rows = list(order)
    place = np.ix_(rows, rows)
    np.savez(folder / "part.npz", M=mass[place], K=stiffness[place])
    lines = [f"{node + 1},x,{10 * node},{row + 1}" for row, node in enumerate(rows)]
    (folder / "dofs.csv").write_text("\n".join(["node,direction,position,row", *reversed(lines)]) + "\n")
    return dovetail.load(
        {
            "dovetail": 1,
            "name": "part",
            "frequency": {"start": 10, "stop": 100, "step": 10},
            "substructures": {
                "part": {
                    "model": "matrices",
                    "file": str(folder / "part.npz"),
                    "dofs": str(folder / "dofs.csv"),
                    "units": {"length": "1 mm"},
                },
                "base": {"model": "ground"},
            },
            "joints": {
                "mount": {
                    "model": "spring_damper",
                    "direction": "x",
                    "connect": {"a": {"to": "part", "at": "node 1"}, "b": {"to": "base", "at": 0}},
                    "parameters": {"k": {"range": [1e5, 1e7]}, "c": {"value": 1.0}},
                }
            },
            "response": {"at": "part", "position": "node 1", "quantity": "receptance"},
        }
    )


@pytest.mark.parametrize("scale", [1.0, 1e6, 1e-6])
@pytest.mark.parametrize("order", [range(COUNT), (3, 0, 4, 1, 2)], ids=str)
def test_exchanged_mass_and_stiffness_are_refused(tmp_path, scale, order):
    mass = np.diag(np.arange(1.0, COUNT + 1.0))
    load(tmp_path, scale * mass, 1e6 * CHAIN, order)
    with pytest.raises(dovetail.DovetailError, match="a motion of all nodes along 'x' has the mass"):
        load(tmp_path, 1e6 * CHAIN, scale * mass, order)


def test_a_consistent_mass_matrix_is_accepted(tmp_path):
    load(tmp_path, np.eye(COUNT) * 4.0 + np.eye(COUNT, k=1) + np.eye(COUNT, k=-1), 1e6 * CHAIN)
