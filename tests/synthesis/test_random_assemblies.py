"""Whole assemblies at random against a dense solve that is written from the published formulas alone."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, seed, settings
from scipy.linalg import eigh

import dovetail
from support.dense_comparison import (
    QUICK,
    Tally,
    check_shares,
    compare,
    elastic_by_poles,
    hold_natural_frequencies,
    loaded,
)
from support.dense_solve import DenseAssembly
from support.random_assemblies import drawn_assemblies
from support.undamped_modes import elastic_frequencies


@pytest.mark.parametrize("count", [12, pytest.param(100, marks=pytest.mark.slow)])
def test_random_assemblies_equal_the_dense_solve(count):
    """In a process of its own, since Hypothesis draws constants of whatever modules are loaded: always the same.

    Poles, which take most of the time, are those of one in six assemblies if few are drawn.
    """
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    start = [sys.executable, "-c", f"import test_random_assemblies as t; t.hold({count})"]
    done = subprocess.run(start, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-10_000:]


def hold(count):
    tally = Tally()

    @settings(QUICK, max_examples=count)
    @given(drawn_assemblies())
    def hold_one(drawn):
        compare(drawn, tally, with_poles=count > 20 or tally.assemblies % 6 == 0)
        differences, tally.differences = tally.differences, []  # so that a failing case is shrunk by its own
        assert differences == []

    hold_one()
    assert tally.assemblies >= count
    check_shares(tally)


@pytest.mark.slow
def test_the_poles_of_three_hundred_random_assemblies_equal_the_dense_ones():
    tally, failing = Tally(), []

    @seed(300)
    @settings(QUICK, derandomize=False, max_examples=300)
    @given(drawn_assemblies())
    def hold(drawn):
        before = len(tally.differences)
        tally.assemblies += 1
        with loaded(drawn) as (assembly, dense, _):
            hold_natural_frequencies(drawn, assembly, dense, tally)
        if len(tally.differences) > before:
            failing.append((tally.differences[before:], drawn.description, drawn.theta))

    hold()
    assert (failing, tally.assemblies >= 300, tally.poles > 1000) == ([], True, True)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(20))
def test_two_thousand_random_assemblies_equal_the_dense_solve(part):
    """Twenty times a hundred others; all of a hundred are compared before one of them fails."""
    tally, failing = Tally(), []

    @seed(part)
    @settings(QUICK, derandomize=False)
    @given(drawn_assemblies())
    def hold(drawn):
        before = len(tally.differences)
        try:
            compare(drawn, tally)
        except Exception as error:  # a crash is a difference too
            tally.differences.append(repr(error))
        if len(tally.differences) > before:
            failing.append((tally.differences[before:], drawn.description, drawn.theta))

    hold()
    print(f"{tally.assemblies} assemblies, {tally.ill_posed} without a receptance; ", end="")
    print(f"{tally.entries} entries, {tally.loose} loose, {tally.blind} blind")
    for differences, description, theta in failing:
        print(*differences, description, theta.tolist(), sep="\n", end="\n\n")
    assert len(failing) == 0
    check_shares(tally)


def test_a_part_without_mass_on_a_bearing_moves_with_the_mass_of_the_ring():
    """Its condensed stiffness has no entry at all; x moves against the spring alone, with the mass of the ring."""
    assembly = dovetail.load(
        {
            "dovetail": 1,
            "name": "one mass",
            "frequency": {"start": 1.0, "stop": 601.0, "lines": 5},
            "substructures": {"part": {"model": "lumped", "masses": [{"mass": 0.0}]}, "base": {"model": "ground"}},
            "joints": {
                "bearing": {
                    "model": "bearing",
                    "connect": {"shaft": {"to": "part", "at": 0.0}, "housing": {"to": "base", "at": 0.0}},
                }
            },
            "response": {"at": "part", "position": 0.0, "quantity": "receptance"},
        }
    )
    theta = {"k": 1e7, "kr": 1e4, "c": 300.0, "cr": 1.0, "m": 0.2, "J": 1e-4}
    omega = 2 * np.pi * np.array([1.0, 151.0, 301.0, 451.0, 601.0])
    H = 1 / (1e7 + 300j * omega - 0.2 * omega**2)
    np.testing.assert_allclose(assembly.frf(theta), H, rtol=1e-12)
    np.testing.assert_allclose(assembly.frf_jacobian(theta)[1][:, 4], omega**2 * H**2, rtol=1e-12)
    np.testing.assert_allclose(assembly.natural_frequencies(theta, 2), np.sqrt([5e7, 1e8]) / (2 * np.pi), rtol=1e-12)


def test_free_masses_are_rigid_body_modes_despite_rounding():
    """Four digits of an assembly that was drawn: two pairs on springs, a free mass and a free inertia between them."""
    K, M = np.zeros((2, 6, 6))
    K[0, 0], K[4, 4], K[0, 4], K[4, 0] = 5.537e9, 5.520e9, -5.520e9, -5.520e9
    K[1:3, 1:3] = [[9.147e7, -1.981e7], [-1.981e7, 1.981e7]]
    M[np.diag_indices(6)] = [1.438, 2.228, 5.675e-2, 7.311e-4, 6.194e-2, 1e-6]
    M[1, 2] = M[2, 1] = 0.2201
    pairs = [eigh(K[np.ix_(pair, pair)], M[np.ix_(pair, pair)], eigvals_only=True) for pair in ([0, 4], [1, 2])]
    expected = np.sqrt(np.sort(np.concatenate(pairs))) / (2 * np.pi)
    np.testing.assert_allclose(elastic_frequencies(dovetail.StructuralMatrices(M, K), 6), expected, rtol=1e-8)


@pytest.mark.parametrize("stiffness", [1.06e6, 1e10, 1e14])
def test_a_rigid_contact_leaves_no_rounding_however_stiff_it_was(stiffness):
    """An assembly that was drawn had a free beam with a first elastic mode at 0.0016 Hz: kr - kr in a sum with 12.8."""
    section = {"elements": 2, "length": 0.01, "outer": 0.006}
    contact = {"kr": {"value": stiffness}, "cr": {"value": 0.0}, "k": {"range": [1e2, 1e14]}, "c": {"value": 0.0}}
    description = {
        "dovetail": 1,
        "name": "a mass on a free beam",
        "frequency": {"start": 1000.0, "stop": 5000.0, "lines": 5},
        "substructures": {
            "mass": {"model": "lumped", "masses": [{"position": 0.0, "mass": 0.01, "inertia": 1e-6}]},
            "beam": {
                "model": "timoshenko_beam",
                "material": {"young": 1e9, "density": 900.0, "poisson": 0.0, "loss_factor": 0.01},
                "sections": [section],
            },
        },
        "joints": {
            "contact": {
                "model": "spring_damper",
                "nodes": 1,
                "direction": "both",
                "connect": {"a": {"to": "mass", "at": ["m1"]}, "b": {"to": "beam", "at": ["n1"]}},
                "parameters": contact,
            }
        },
        "response": {"at": "beam", "position": "n3", "direction": "x", "quantity": "receptance"},
    }
    assembly, tip = dovetail.load(description).rigid(), [("beam", 0.01, "x")]
    dense = DenseAssembly(description, {})
    expected = elastic_by_poles(dense, [stiffness])
    np.testing.assert_allclose(assembly.natural_frequencies([stiffness], 3), expected[:3], rtol=1e-7)
    receptance = assembly.receptance([stiffness], tip, tip)[:, 0, 0]
    np.testing.assert_allclose(receptance, assembly.frf([stiffness]), rtol=1e-9)


def test_a_batch_for_an_assembly_without_joints_has_a_row_for_each_vector():
    part = {"model": "lumped", "masses": [{"mass": 2.0}]}
    assembly = dovetail.load(
        {
            "dovetail": 1,
            "name": "no joint",
            "frequency": {"start": 1.0, "stop": 3.0, "lines": 3},
            "substructures": {"part": part},
            "response": {"at": "part", "position": 0.0},
        }
    )
    np.testing.assert_allclose(assembly.frf(np.empty((2, 0))), np.full((2, 3), 0.5), rtol=1e-12)
    frf, jacobian = assembly.frf_jacobian(np.empty((2, 0)))
    assert (frf.shape, jacobian.shape) == ((2, 3), (2, 3, 0))
    assert assembly.accelerance_amplitude(np.empty((2, 0))).shape == (2, 3)


def test_stiffness_between_dofs_that_become_one_leaves_no_spring_to_the_ground():
    """All displacements of a beam are one: it moves freely, whatever rounding leaves of the springs in between."""
    material = {"young": 19e9, "density": 2e4, "poisson": 0.02, "loss_factor": 0.05}
    pairs = {"a": {"to": "beam", "at": ["n1", "n4"]}, "b": {"to": "beam", "at": ["n2", "n3"]}}
    between = {"a": {"to": "beam", "at": ["n2"]}, "b": {"to": "beam", "at": ["n4"]}}
    known = {"c": {"value": 1.0}}
    description = {
        "dovetail": 1,
        "name": "beam on itself",
        "frequency": {"start": 10.0, "stop": 7000.0, "lines": 3},
        "substructures": {
            "beam": {
                "model": "timoshenko_beam",
                "material": material,
                "sections": [{"length": 0.05, "outer": 0.03, "elements": 3}],
            }
        },
        "joints": {
            "springs": {"model": "spring_damper", "nodes": 2, "direction": "x", "connect": pairs, "parameters": known},
            "spring": {"model": "spring_damper", "direction": "x", "connect": between, "parameters": known},
        },
        "response": {"at": "beam", "position": "n1", "direction": "x"},
    }
    theta = [2.355e10, 7.1e9]
    expected = elastic_by_poles(DenseAssembly(description, {}), theta)
    computed = dovetail.load(description).rigid().natural_frequencies(theta, count=4)
    np.testing.assert_allclose(computed, expected[:4], rtol=1e-8)


TWO_UNITS = """
import numpy as np

from dovetail import PartNode, StructuralMatrices, SubstructureModel, hookimpl


class TwoUnits(SubstructureModel):
    name = "two_units"
    summary = "a part that no imported matrices may be, since it is not positive semidefinite"
    nodes = (PartNode("n", 0.0),)

    def matrices(self):
        return StructuralMatrices(np.zeros((2, 2)), np.array([[1e14, 1e12], [1e12, 1.0]]))


@hookimpl
def dovetail_components():
    return [TwoUnits]
"""


def test_the_units_of_rows_do_not_choose_the_pivots(tmp_path):
    """A displacement that nearly nothing resists alone, in a unit that makes it the largest entry of the matrix."""
    unit, soft = 1e12, 1e-10
    (tmp_path / "two_units.py").write_text(TWO_UNITS)
    assembly = dovetail.load(
        {
            "dovetail": 1,
            "name": "two units",
            "frequency": {"start": 1.0, "stop": 2.0, "lines": 2},
            "substructures": {"part": {"model": "two_units"}},
            "response": {"at": "part", "position": "n", "quantity": "receptance"},
        },
        plugins=[tmp_path / "two_units.py"],
    )
    computed = assembly.receptance([], [("part", 0.0, "x"), ("part", 0.0, "rz")], [("part", 0.0, "x")])[:, :, 0]
    inverse = np.array([1.0 / unit**2, -1.0 / unit]) / (soft - 1.0)
    np.testing.assert_allclose(computed, np.tile(inverse, (2, 1)), rtol=1e-13)
