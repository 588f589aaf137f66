"""Whole assemblies at random against a dense solve that is written from the published formulas alone.

An entry is held to 1e-8, unless rounding in the elements themselves moves it further: a line next to a resonance
without damping, a drive point at an antiresonance, a free structure at 1 Hz, whose stiffness hides its mass. How far it
moves is computed for each entry (`System.receptance`), and the tolerance is the larger of the two. No case is left out.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from dense_poles import damped_poles
from dense_solve import DenseAssembly, System
from hypothesis import HealthCheck, Phase, given, seed, settings
from random_assemblies import Drawn, drawn_assemblies
from scipy.linalg import eigh

import dovetail
from dovetail.synthesis.natural_frequencies import elastic_frequencies

EPS = float(np.finfo(float).eps)
UNUSUAL_JOINTS = str(Path(__file__).with_name("unusual_joints.py"))
QUICK = settings(
    max_examples=100,
    derandomize=True,
    database=None,
    deadline=None,
    suppress_health_check=list(HealthCheck),
    phases=[Phase.generate],  # to shrink a failing case takes more than five minutes
)
POWER = {"receptance": 0, "mobility": 1, "accelerance": 2}


@dataclass(frozen=True)
class Settings:
    """How far an answer may be from the dense one.

    Attributes
    ----------
    relative : float
        Of the entry. What the project promises.
    rounding : float
        Of the change by a relative change of eps in all elements' entries. For sums over a hundred DOFs and some growth
        in an elimination without pivoting, in both solves.
    difference : float
        Of an entry of a joint's matrices over its parameter: what the contract of joints says of differences.
    law_difference : float
        Of the derivative of a dynamic stiffness that a joint gives itself: what the contract says of it.
    useless : float
        A tolerance that holds nothing.
    ill_posed, loose, blind : float
        Largest share of assemblies without a receptance at the response, of entries with a tolerance beyond `relative`,
        and of those with a useless one.
    """

    relative: float = 1e-8
    rounding: float = 10.0
    difference: float = 1e-12
    law_difference: float = 1e-9
    useless: float = 1e-3
    ill_posed: float = 0.2
    loose: float = 0.2
    blind: float = 0.02


SETTINGS = Settings()


@dataclass
class Tally:
    """How many assemblies and entries were compared, and how many of them under which of the settings' exceptions."""

    assemblies: int = 0
    ill_posed: int = 0
    entries: int = 0
    loose: int = 0
    blind: int = 0
    poles: int = 0
    differences: list[str] = field(default_factory=list)

    def hold(self, what: str, computed: np.ndarray, dense: np.ndarray, moved: np.ndarray, size: Any = 0.0) -> None:
        """Note an array that is not the dense one; `moved` is how far rounding may move it.

        `size` is what an entry is small against: a derivative against the FRF over the parameter.
        """
        strict = SETTINGS.relative * abs(dense)
        allowed = np.maximum(strict, moved)
        self.entries += dense.size
        size = np.maximum(abs(dense), size)
        self.loose += int(np.count_nonzero(allowed > SETTINGS.relative * size))
        self.blind += int(np.count_nonzero(allowed > SETTINGS.useless * size))
        if computed.shape != dense.shape or not np.all(abs(computed - dense) <= allowed):
            self.differences.append(f"{what}: {computed} is not {dense} within {allowed}")

    def refused(self, what: str, objection: str, ask) -> bool:
        """Return whether there is an objection; note it if Dovetail does not refuse then."""
        if objection:
            with suppress(dovetail.DovetailError):
                self.differences.append(f"{what}: {objection}, but the answer is {ask()}")
        return bool(objection)


@contextmanager
def loaded(drawn: Drawn):
    """Yield the assembly, its dense counterpart and the positions of nodes, while the description's files are there."""
    dense = DenseAssembly(drawn.description, drawn.archives)
    with tempfile.TemporaryDirectory() as folder:
        position = {
            (part, label): dense.parts[part].positions[label] for part in drawn.nodes for label in drawn.nodes[part]
        }
        description = drawn.written(Path(folder), dense.frequency, position)
        with patch("dovetail.description.reader.check_facing"):  # nets of DOFs, whose nodes lie anywhere
            assembly = dovetail.load(description, plugins=UNUSUAL_JOINTS)
        yield assembly, dense, position


def compare(drawn: Drawn, tally: Tally) -> None:
    """Hold everything that an assembly computes against the dense solve."""
    tally.assemblies += 1
    with loaded(drawn) as answers:
        assembly, dense, position = answers
    if [parameter.name for parameter in assembly.parameters] != dense.parameters:
        tally.differences.append(f"parameters {assembly.parameters}, not {dense.parameters}")
        return
    objection = dense.objection([drawn.response], drawn.theta[0])
    if tally.refused("frf", objection, lambda: assembly.frf(drawn.theta)):
        tally.ill_posed += 1
    else:
        hold_frf_and_jacobian(drawn, assembly, dense, tally)
    hold_rigid(drawn, assembly, dense, tally)
    hold_receptance(drawn, assembly, dense, position, tally)
    hold_natural_frequencies(drawn, assembly, dense, tally)


def hold_frf_and_jacobian(drawn: Drawn, assembly: dovetail.Assembly, dense: DenseAssembly, tally: Tally) -> None:
    """All vectors at once, as a batch."""
    factor = (2j * np.pi * dense.frequency) ** POWER[drawn.description["response"]["quantity"]]
    point = int(dense.numbering()[dense.dof(drawn.response)])
    frfs, (with_jacobian, jacobians) = assembly.frf(drawn.theta), assembly.frf_jacobian(drawn.theta)
    for theta, frf, again, jacobian in zip(drawn.theta, frfs, with_jacobian, jacobians, strict=True):
        system = dense.system(theta, [drawn.response])
        for computed in (frf, again):
            hold_entry("frf", computed, system, point, point, factor, tally)
        slopes = dense.slopes(theta, system)
        for column, (slope, moved, by_difference) in enumerate(system.derivatives(point, point, slopes)):
            parameter = assembly.parameters[column]
            step = max(abs(theta[column]), 1e-3 * (parameter.upper - parameter.lower))
            moved = SETTINGS.rounding * EPS * moved + SETTINGS.difference * by_difference[1] / step
            if dense.gives_its_own_law(column):
                moved += SETTINGS.law_difference * by_difference[0]
            computed, dense_slope = jacobian[:, column], slope * factor
            tally.hold(f"jacobian by {parameter.name}", computed, dense_slope, moved * abs(factor), abs(frf) / step)


def hold_entry(what: str, computed, system: System, row: int, column: int, factor, tally: Tally) -> None:
    """One receptance between two reduced DOFs, times a factor."""
    H, moved = system.receptance(row, column)
    tally.hold(what, computed, H * factor, SETTINGS.rounding * EPS * moved * abs(factor))


def hold_rigid(drawn: Drawn, assembly: dovetail.Assembly, dense: DenseAssembly, tally: Tally) -> None:
    """The same with all contacts of joints with unknowns rigid; their stiffness then is between DOFs that are one."""
    theta, rigid = drawn.theta[0], assembly.rigid()
    if not tally.refused("rigid frf", dense.objection([drawn.response], theta, rigid=True), lambda: rigid.frf(theta)):
        factor = (2j * np.pi * dense.frequency) ** POWER[drawn.description["response"]["quantity"]]
        point = int(dense.numbering(rigid=True)[dense.dof(drawn.response)])
        system = dense.system(theta, [drawn.response], rigid=True)
        hold_entry("rigid frf", rigid.frf(theta), system, point, point, factor, tally)


def hold_receptance(drawn: Drawn, assembly: dovetail.Assembly, dense: DenseAssembly, position, tally: Tally) -> None:
    """Between any points."""
    theta, numbers = drawn.theta[0], dense.numbering()
    outputs, inputs = (
        [(part, position[part, label], direction) for part, label, direction in points]
        for points in (drawn.outputs, drawn.inputs)
    )
    objection = dense.objection([*drawn.outputs, *drawn.inputs], theta)
    try:
        computed = assembly.receptance(theta, outputs, inputs)
    except dovetail.DovetailError as error:
        if not objection:
            tally.differences.append(f"receptance: {error}")
        return
    for row, output in enumerate(drawn.outputs):
        for column, force in enumerate(drawn.inputs):
            what, between = f"receptance {output} {force}", [int(numbers[dense.dof(end)]) for end in (output, force)]
            if not dense.coupled(output, force, theta):
                tally.hold(what, computed[:, row, column], np.zeros(len(dense.frequency)), 0.0)
            elif objection := dense.objection([output, force], theta):
                tally.differences.append(f"{what}: {objection}, but the answer is {computed[:, row, column]}")
            else:
                system = dense.system(theta, [output, force])
                hold_entry(what, computed[:, row, column], system, *between, 1.0, tally)


def hold_natural_frequencies(drawn: Drawn, assembly: dovetail.Assembly, dense: DenseAssembly, tally: Tally) -> None:
    """The lowest six elastic poles, with the contacts as they are and rigid."""
    theta = drawn.theta[0]
    no_matrices = "a part has no matrices" if drawn.tested else ""
    if tally.refused("natural frequencies", no_matrices, lambda: assembly.natural_frequencies(theta)):
        return
    for model, rigid in ((assembly, False), (assembly.rigid(), True)):
        poles, moved = damped_poles(dense, theta, rigid=rigid)
        moved = SETTINGS.rounding * EPS * moved
        known = moved <= SETTINGS.useless * abs(poles)  # others may be of rigid-body modes as well as elastic ones
        modes = model.modes(theta, count=6)
        computed = np.array([pole_of(mode) for mode in modes], dtype=complex)
        computed = computed[abs(computed) > 2 * abs(poles[~known]).max(initial=0.0)]
        poles, moved = (values[known][: max(len(computed), 6 - np.sum(~known))] for values in (poles, moved))
        tally.hold("poles", computed, poles, moved)
        tally.poles += len(poles)
        frequencies = model.natural_frequencies(theta, count=6)
        same = np.array([mode.natural_frequency for mode in modes])
        tally.hold("natural frequencies", frequencies[: len(modes)], same, 0.0)


def pole_of(mode) -> complex:
    zeta = mode.damping_ratio
    return 2 * np.pi * mode.natural_frequency * (-zeta + 1j * np.sqrt(1 - zeta**2))


def elastic_by_poles(dense: DenseAssembly, theta: list[float]) -> np.ndarray:
    """Natural frequencies [Hz] with rigid contacts, without those of which rounding leaves nothing."""
    poles, moved = damped_poles(dense, theta, rigid=True)
    return abs(poles[EPS * moved < SETTINGS.useless * abs(poles)]) / (2 * np.pi)


def check_shares(tally: Tally) -> None:
    assert tally.ill_posed <= SETTINGS.ill_posed * tally.assemblies
    assert tally.loose <= SETTINGS.loose * tally.entries
    assert tally.blind <= SETTINGS.blind * tally.entries


@pytest.mark.parametrize("count", [40, pytest.param(100, marks=pytest.mark.slow)])
def test_random_assemblies_against_the_dense_solve(count):
    """In a process of its own, since Hypothesis draws constants of whatever modules are loaded: always the same."""
    folders = [str(Path(__file__).parent), *sys.path]
    start = f"import sys; sys.path[:0] = sys.argv[1:]; import test_random_assemblies as t; t.hold({count})"
    done = subprocess.run([sys.executable, "-c", start, *folders], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-10_000:]


def hold(count):
    tally = Tally()

    @settings(QUICK, max_examples=count)
    @given(drawn_assemblies())
    def hold_one(drawn):
        compare(drawn, tally)
        differences, tally.differences = tally.differences, []  # so that a failing case is shrunk by its own
        assert differences == []

    hold_one()
    assert tally.assemblies >= count
    check_shares(tally)


@pytest.mark.slow
def test_the_poles_of_three_hundred_random_assemblies():
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
def test_two_thousand_random_assemblies_against_the_dense_solve(part):
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


def test_a_part_without_any_mass_of_its_own_on_a_bearing():
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


def test_masses_that_nothing_holds_are_rigid_body_modes_whatever_rounding_makes_of_them():
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

from dovetail import Node, StructuralMatrices, SubstructureModel, hookimpl


class TwoUnits(SubstructureModel):
    name = "two_units"
    summary = "a part that no imported matrices may be, since it is not positive semidefinite"
    nodes = (Node("n", 0.0),)

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
