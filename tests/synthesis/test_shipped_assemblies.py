"""Every assembly that ships, for a hundred random parameter vectors: the engine against the direct solve."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail.dataset import latin_hypercube
from dovetail.synthesis import Engine, direct_receptance

ASSEMBLIES = Path(__file__).resolve().parents[2] / "assemblies"
FILES = sorted([*ASSEMBLIES.glob("*.yaml"), *ASSEMBLIES.glob("campaign/*.yaml")])


def worst_error(assembly: dovetail.Assembly, samples: int, every: int) -> float:
    """Return the largest relative error over samples and every n-th line, each sample beginning at another line."""
    theta = latin_hypercube(assembly, samples, seed=0) if assembly.parameters else np.empty((1, 0))
    by_joint = assembly.by_joint(theta)
    name, dof = assembly.description.response.point
    number = int(assembly.graph.substructure_dofs(name)[dof])
    found = assembly.engine.frfs(by_joint)[:, 0]
    errors = []
    for sample, frf in enumerate(found):
        lines = np.arange(sample % every, len(frf), every)
        one = {joint: values[sample] for joint, values in by_joint.items()}
        truth = direct_receptance(assembly.graph, assembly.frequency[lines], one, [number], [number])[:, 0, 0]
        errors.append(np.max(np.abs(frf[lines] - truth) / np.abs(truth)))
    return max(errors)


@pytest.mark.slow
@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_hundred_random_vectors_equal_the_direct_solve(file):
    """Twenty lines' distance; the lines shift from sample to sample, so that all of them are met."""
    assembly = dovetail.load(file)
    if any(part.name == "measured" for part in assembly.graph.substructures.values()):
        pytest.skip("a part that is known by its FRFs has no matrices to solve directly")
    assert worst_error(assembly, 100, 20) < 1e-8


@pytest.mark.slow
def test_a_hundred_random_vectors_of_the_reference_assembly_equal_the_direct_solve_at_every_line(collet):
    assert worst_error(collet, 100, 1) < 1e-8


def test_every_shipped_assembly_is_tested():
    assert {"bt40_er32", "sdof", "h0_t0", "spindle", "sf_h2_t1"} <= {file.stem for file in FILES}
    assert isinstance(dovetail.load(FILES[0]).engine, Engine)
