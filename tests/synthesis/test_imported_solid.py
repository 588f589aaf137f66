"""A solid finite element model, imported from a file into an assembly: FRF, time and memory.

pytest tests/synthesis/test_imported_solid.py -m slow -s
"""

from __future__ import annotations

import json
import resource
import time

import numpy as np
import pytest

import dovetail
from dovetail.synthesis import assembly_matrices, direct_receptance
from support.solid_bar import solid_bar, with_rigid_sections

LENGTH, SIDE, LOSS = 300.0, 30.0, 0.003
YOUNG, DENSITY = 2.1e5, 7.8e-9
"""N/mm^2 and t/mm^3, as finite element programs like them."""
NODES = {"tip": 0.0, "front": 0.9, "end": 1.0}


def write_solid(folder, along, across):
    """Write M and K of a bar with three rigid cross-sections in N, mm and t; their DOFs alone are in the table."""
    mesh = solid_bar(LENGTH, SIDE, along, across, young=YOUNG, density=DENSITY)
    M, K = with_rigid_sections(*mesh, [place * LENGTH for place in NODES.values()])
    arrays = {}
    for name, matrix in (("M", M), ("K", K)):
        arrays |= {f"{name}_data": matrix.data, f"{name}_indices": matrix.indices, f"{name}_indptr": matrix.indptr}
    directions = ("ux", "uy", "uz", "rx", "ry", "rz")
    np.savez(
        folder / "bar.npz",
        **arrays,
        nodes=[node for node in NODES for _ in directions],
        directions=[direction for _ in NODES for direction in directions],
        rows=np.arange(6 * len(NODES)) + 1,
    )
    return K.shape[0]


def load(folder, step, tolerance):
    """The bar in a holder (a beam), on two contact nodes."""
    lap = (1 - 0.9) * LENGTH * 1e-3
    description = {
        "dovetail": 1,
        "name": "solid in a holder",
        "frequency": {"start": 100, "stop": 9100, "step": step},
        "substructures": {
            "bar": {
                "model": "matrices",
                "file": "bar.npz",
                "displacement": "uy",
                "units": {"length": "1 mm", "mass": "1 t", "stiffness": "1 N/mm"},
                "loss_factor": LOSS,
                "tolerance": tolerance,
            },
            "holder": {
                "model": "timoshenko_beam",
                "material": {"young": 2e11, "density": 7800, "loss_factor": 0.003},
                "sections": [{"length": lap, "outer": 0.04}, {"length": 0.1, "outer": 0.04, "elements": 4}],
            },
        },
        "joints": {
            "layer": {
                "model": "spring_damper",
                "nodes": 2,
                "connect": {"a": {"to": "bar", "at": ["front", "end"]}, "b": {"to": "holder", "at": [0, lap]}},
            }
        },
        "response": {"at": "bar", "position": "tip"},
    }
    (folder / "assembly.yaml").write_text(json.dumps(description))
    return dovetail.load(folder / "assembly.yaml")


def matrices_of(assembly):
    theta = assembly.vector(None)
    return assembly.by_joint(theta)


def error(assembly, lines):
    """Largest relative difference from the direct solve of the whole assembly at some lines."""
    name, dof = assembly.description.response.point
    number = [int(assembly.graph.substructure_dofs(name)[dof])]
    frequency = assembly.frequency[lines]
    truth = direct_receptance(assembly.graph, frequency, matrices_of(assembly), number, number)[:, 0, 0]
    truth *= -((2 * np.pi * frequency) ** 2)
    return float(np.max(np.abs(assembly.frf()[lines] - truth) / np.abs(truth)))


@pytest.mark.parametrize("tolerance", [0.0, 1e-9])
def test_an_imported_solid_gives_the_frf_of_the_direct_solve(tolerance, tmp_path):
    write_solid(tmp_path, 20, 2)
    assembly = load(tmp_path, 150, tolerance)
    assert error(assembly, slice(None)) < 1e-6


def test_an_imported_solid_is_nearly_the_beam_of_its_section(tmp_path):
    """A mesh this coarse is a few per cent too stiff in bending."""
    write_solid(tmp_path, 40, 4)
    assembly = load(tmp_path, 150, 1e-9)
    description = json.loads((tmp_path / "assembly.yaml").read_text())
    side = SIDE * 1e-3
    sections = [{"length": 0.27, "width": side, "height": side, "elements": 27}]
    sections.append({"length": 0.03, "width": side, "height": side})
    material = {"young": YOUNG * 1e6, "density": DENSITY * 1e12, "loss_factor": LOSS}
    description["substructures"]["bar"] = {"model": "timoshenko_beam", "material": material, "sections": sections}
    description["joints"]["layer"]["connect"]["a"]["at"] = [0.27, 0.3]
    description["response"]["position"] = 0.0
    beam = dovetail.load(description)
    planar = assembly.natural_frequencies(count=8)
    for expected in beam.natural_frequencies(count=2):
        assert np.min(np.abs(planar / expected - 1)) < 0.04


@pytest.mark.slow
def test_a_solid_of_five_thousand_dofs_has_the_frf_of_the_direct_solve(tmp_path):
    size = write_solid(tmp_path, 50, 5)
    assert size > 5000
    for tolerance, step, lines in ((1e-9, 2, slice(None, None, 75)), (0.0, 150, slice(None))):
        begin = time.perf_counter()
        assembly = load(tmp_path, step, tolerance)
        read = time.perf_counter()
        assembly.frf()
        first = time.perf_counter()
        for _ in range(5):
            assembly.frf()
        again = (time.perf_counter() - first) / 5
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
        begun = time.perf_counter()
        off = error(assembly, lines)
        a_line = (time.perf_counter() - begun) / len(assembly.frequency[lines])
        print(
            f"\n{size} DOFs, tolerance {tolerance:g}, {len(assembly.frequency)} lines: read {read - begin:.2f} s, "
            f"first FRF {first - read:.2f} s, the next {1e3 * again:.2f} ms, error {off:.1e}, direct solve "
            f"{1e3 * a_line:.0f} ms a line, {memory:.0f} MB at most"
        )
        assert off < 1e-6
    whole = assembly_matrices(assembly.graph, matrices_of(assembly))
    print(f"assembly: {whole.size} DOFs, {whole.K.nnz} entries")
