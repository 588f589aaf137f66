"""A beam exported to each file format that the substructure `matrices` reads, and an assembly with it."""

from __future__ import annotations

import json

import numpy as np
import scipy.io
import scipy.sparse as sp

import dovetail
from dovetail.registry import components

MATERIAL = {"young": 2.1e11, "density": 7800, "loss_factor": 0.004}
SECTIONS = [{"length": 0.16, "outer": 0.02, "elements": 8}]


def beam():
    model = components().find("substructure", "timoshenko_beam").component
    return model(model.Config(material=MATERIAL, sections=SECTIONS))


def table():
    """Nodes, directions and positions of the beam's DOFs."""
    nodes = beam().nodes
    return {
        "nodes": [node.label for node in nodes for _ in "xr"],
        "directions": [axis for _ in nodes for axis in ("x", "rz")],
        "positions": [node.position for node in nodes for _ in "xr"],
    }


def parts(matrix, name):
    return {f"{name}_data": matrix.data, f"{name}_indices": matrix.indices, f"{name}_indptr": matrix.indptr}


def write(folder, form, *, matrices=None, columns=None):
    """Write the beam in one of the forms and return the section that reads it."""
    given = beam().matrices()
    found = {"M": given.M, "K": given.K, "D": given.D} | (matrices or {})
    found = {name: matrix for name, matrix in found.items() if matrix is not None}
    columns = table() if columns is None else columns
    if form == "npz":
        np.savez(folder / "part.npz", **found, **columns)
    elif form == "sparse npz":
        sparse = {}
        for name, matrix in found.items():
            sparse |= parts(sp.csr_array(matrix), name)
        np.savez(folder / "part.npz", **sparse, **columns)
    elif form == "mat":
        cells = {name: np.array(values, dtype=object) for name, values in columns.items() if name != "positions"}
        positions = {"positions": columns["positions"]} if "positions" in columns else {}
        sparse = {name: sp.csc_array(matrix) for name, matrix in found.items()}
        scipy.io.savemat(folder / "part.mat", sparse | cells | positions)
    if form in ("npz", "sparse npz", "mat"):
        return {"model": "matrices", "file": f"part.{form.split()[-1]}"}
    options = {"M": "mass", "K": "stiffness", "D": "structural_damping"}
    for name, matrix in found.items():
        scipy.io.mmwrite(folder / f"{name}.mtx", sp.coo_array(matrix), symmetry="symmetric" if name == "K" else None)
    lines = [",".join(cells) for cells in zip(columns["nodes"], columns["directions"], strict=True)]
    if "positions" in columns:
        lines = [f"{line},{place!r}" for line, place in zip(lines, columns["positions"], strict=True)]
    header = "node,direction" + (",position" if "positions" in columns else "")
    (folder / "dofs.csv").write_text("\n".join([header, *lines]) + "\n")
    return {"model": "matrices", "dofs": "dofs.csv"} | {options[name]: f"{name}.mtx" for name in found}


def load(folder, part, at=(0.0, 0.16)):
    """The part on two springs to the ground."""
    description = {
        "dovetail": 1,
        "name": "imported",
        "frequency": {"start": 20, "stop": 6000, "step": 20},
        "substructures": {"part": part, "base": {"model": "ground"}},
        "joints": {
            end: {
                "model": "spring_damper",
                "connect": {"a": {"to": "part", "at": place}, "b": {"to": "base", "at": 0}},
            }
            for end, place in zip(("near", "far"), at, strict=True)
        },
        "response": {"at": "part", "position": at[0]},
    }
    file = folder / "assembly.yaml"
    file.write_text(json.dumps(description))
    return dovetail.load(file)
