"""The engine on everything that ships, against a direct solve of the whole assembly, written independently here."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail.dataset import latin_hypercube
from dovetail.documents.fault_list import FaultList
from dovetail.documents.tree import plain_values
from dovetail.documents.yaml_reader import read_yaml
from dovetail.synthesis import LiteralSynthesis

SOME = 25
"""Parameter vectors by default; the slow tests take a hundred."""
LARGE = 100
"""DOFs above which fewer vectors and lines are solved directly, so that the tests stay quick."""
DAMPERS = ("N s/m", "N m s/rad", "N s/m^2", "N s")
FOLDER = Path(__file__).resolve().parents[2] / "assemblies"


@cache
def shipped() -> list[str]:
    """Every file under assemblies/ that describes an assembly, in subfolders too; lists of cases are none."""
    texts = {file: plain_values(read_yaml(str(file), 0, FaultList())) for file in sorted(FOLDER.rglob("*.yaml"))}
    return [
        file.relative_to(FOLDER).as_posix() for file, text in texts.items() if {"substructures", "extends"} & {*text}
    ]


@cache
def load(name: str) -> dovetail.Assembly:
    return dovetail.load(FOLDER / name)


def load_with_parameters(name: str) -> dovetail.Assembly:
    assembly = load(name)
    if not assembly.parameters:
        pytest.skip("it has no parameters")
    return assembly


def one_of_each(suits: Callable[[str], object] = bool) -> list[object]:
    """The assemblies that suit; of those that differ in the tool or the training alone, all but the first are slow."""
    seen, chosen = set[str](), list[object]()
    for name in filter(suits, shipped()):
        kind = re.sub(r"(t[0-3]|_quick)?\.yaml$", "", name)
        chosen.append(pytest.param(name, marks=[pytest.mark.slow] if kind in seen else []))
        seen.add(kind)
    return chosen


class WholeAssembly:
    """All parts over all DOFs; what is measured comes in by its receptance and the forces on it, not by an inverse."""

    def __init__(self, assembly) -> None:
        self.assembly, graph = assembly, assembly.graph
        parts = {name: (part, part.matrices()) for name, part in graph.substructures.items() if not part.grounded}
        self.measured = [(part, graph.substructure_dofs(name)) for name, (part, own) in parts.items() if own is None]
        self.forces = sum(len(dofs) for _, dofs in self.measured)
        self.parts = [(own, graph.substructure_dofs(name)) for name, (_, own) in parts.items() if own is not None]
        name, dof = assembly.description.response.point
        self.drive = int(graph.substructure_dofs(name)[dof])

    def drive_point(self, theta, lines) -> np.ndarray:
        graph, omega = self.assembly.graph, 2 * np.pi * self.assembly.frequency[lines][:, None, None]
        size = graph.size
        Z = np.zeros((len(omega), size + self.forces, size + self.forces), dtype=complex)

        def add(M, K, C, D, dofs) -> None:
            moving = np.flatnonzero(dofs >= 0)
            inside = np.ix_(moving, moving)
            stiffness = (K[inside] - omega**2 * M[inside]) + 1j * (D[inside] + omega * C[inside])
            for row, into in enumerate(dofs[moving]):
                for column, out in enumerate(dofs[moving]):
                    Z[:, into, out] += stiffness[:, row, column]

        for own, dofs in self.parts:
            add(own.M, own.K, own.C, own.D, dofs)
        for name, values in self.assembly.by_joint(theta).items():
            own = graph.connections[name].model.matrices(values[None, :])
            add(own.M[0], own.K[0], own.C[0], own.D[0], graph.joint_dofs(name))
        first = size
        for part, dofs in self.measured:
            force = range(first, first + len(dofs))
            Z[:, dofs, force] = Z[:, force, dofs] = 1.0
            H = part.receptance(self.assembly.frequency[lines], range(len(dofs)))
            Z[:, first : first + len(dofs), first : first + len(dofs)] = -H
            first += len(dofs)
        active = np.flatnonzero(Z.any(axis=(0, 1)))
        drive = int(np.searchsorted(active, self.drive))
        load = np.zeros((len(active), 1))
        load[drive] = 1.0
        return refined_solve(Z[:, active[:, None], active], load)[:, drive, 0]


def refined_solve(Z, load) -> np.ndarray:
    """Solve with residuals in extended precision: with 200 DOFs a plain solve is wrong by more than the bound."""
    found = np.linalg.solve(Z, np.broadcast_to(load, (len(Z), *load.shape)))
    if Z.shape[1] <= LARGE:
        return found
    for _ in range(2):
        residual = load - np.einsum("lij,ljk->lik", Z.astype(np.clongdouble), found.astype(np.clongdouble))
        found = found + np.linalg.solve(Z, residual.astype(complex))
    return found


def spread(receptance, generator, lines=12, extremes=8) -> np.ndarray:
    """Lines of one FRF: the first, the last, some at random, its highest peaks and deepest dips with a neighbour."""
    amplitude = np.abs(receptance)
    inner = amplitude[1:-1]
    peaks = 1 + np.flatnonzero((inner > amplitude[:-2]) & (inner > amplitude[2:]))
    dips = 1 + np.flatnonzero((inner < amplitude[:-2]) & (inner < amplitude[2:]))
    chosen = [
        *peaks[np.argsort(-amplitude[peaks])][: extremes // 2],
        *dips[np.argsort(amplitude[dips])][: extremes // 2],
    ]
    some = generator.choice(len(amplitude), min(lines, len(amplitude)), replace=False)
    return np.unique([0, len(amplitude) - 1, *chosen, *(index + 1 for index in chosen), *some])


def samples(assembly, count, seed):
    if assembly.graph.size > LARGE:
        count = max(1, count // (10 if assembly.graph.size < 2 * LARGE else 25))
    return latin_hypercube(assembly, count, seed) if assembly.parameters else np.empty((1, 0))


def largest_error(assembly, theta, lines_of) -> float:
    """Greatest relative error of the engine over the lines that `lines_of` picks for each vector."""
    whole = WholeAssembly(assembly)
    worst = 0.0
    for vector, found in zip(theta, assembly.engine.frfs(assembly.by_joint(theta))[:, 0], strict=True):
        lines = lines_of(vector, found)
        blocks = np.array_split(lines, -(-len(lines) // 100))
        truth = np.concatenate([whole.drive_point(vector, block) for block in blocks])
        worst = max(worst, float(np.max(np.abs(found[lines] - truth) / np.abs(truth))))
    return worst


def test_the_assemblies_that_ship_are_found():
    assert {"bt40_er32.yaml", "sdof.yaml", "campaign/h2_t1.yaml", "campaign/sf_h2_t1.yaml"} <= {*shipped()}
    assert not any("cases" in name for name in shipped())


@pytest.mark.parametrize("name", one_of_each())
def test_some_vectors_equal_the_direct_solve_with_resonances_and_dips(name):
    assembly, generator = load(name), np.random.default_rng(0)
    theta = samples(assembly, SOME, seed=11)
    assert largest_error(assembly, theta, lambda vector, found: spread(found, generator)) < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped())
def test_frfs_of_a_hundred_vectors_of_large_assemblies_are_exact(name):
    assembly, generator = load(name), np.random.default_rng(1)
    if assembly.graph.size <= LARGE:
        pytest.skip("it is not large")
    theta = latin_hypercube(assembly, 100, seed=11)
    assert largest_error(assembly, theta, lambda vector, found: spread(found, generator, lines=3, extremes=4)) < 1e-8


@pytest.mark.parametrize("name", one_of_each())
def test_interpolated_frfs_equal_the_direct_solve_as_well(name):
    assembly, generator = load_with_parameters(name).interpolated(1e-9), np.random.default_rng(2)
    theta = samples(assembly, SOME, seed=17)
    assert largest_error(assembly, theta, lambda vector, found: spread(found, generator, lines=40)) < 1e-8


@pytest.mark.parametrize("name", one_of_each())
def test_one_vector_equals_the_direct_solve_at_every_line(name):
    """Of a large one at every fourth line, or fewer."""
    assembly = load(name)
    everywhere = np.arange(len(assembly.frequency))[:: max(1, 2 * assembly.graph.size // LARGE) ** 2]
    assert largest_error(assembly, samples(assembly, 1, seed=12), lambda vector, found: everywhere) < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped())
def test_a_hundred_vectors_equal_the_direct_solve_at_every_line(name):
    assembly = load(name)
    everywhere = np.arange(len(assembly.frequency))[:: max(1, assembly.graph.size // LARGE) ** 2]
    assert largest_error(assembly, samples(assembly, 100, seed=13), lambda vector, found: everywhere) < 1e-8


def undamped(assembly) -> dovetail.Assembly:
    """The same description without loss factors and dampers; what is measured keeps its own."""

    def without(value):
        if isinstance(value, dict):
            return {key: 0 if key == "loss_factor" else without(below) for key, below in value.items()}
        return [without(below) for below in value] if isinstance(value, list) else value

    description = without(json.loads(assembly.description.text))
    for name, joint in assembly.description.joints.items():
        dampers = {p.name: {"value": 0} for p in joint.connection.model.parameters if p.unit in DAMPERS}
        description["joints"][name].setdefault("parameters", {}).update(dampers)
    return dovetail.load(description)


def is_damped_by_its_measurement(name: str) -> bool:
    """A measured flange has damping of its own; so has what was measured under an exponential window."""
    return "/sf_" in name or name == "hammer_test.yaml"


@pytest.mark.parametrize("name", one_of_each(lambda name: not is_damped_by_its_measurement(name)))
def test_without_any_damping_the_engine_is_exact_away_from_resonance(name):
    assembly, generator = undamped(load(name)), np.random.default_rng(1)
    theta = samples(assembly, SOME, seed=14)

    def away(vector, found):
        modes = assembly.natural_frequencies(vector, count=12)
        modes = modes[np.isfinite(modes)]
        assert np.all(found.imag == 0)
        distance = np.min(np.abs(assembly.frequency[:, None] / modes - 1), axis=1)
        regular = (distance > 0.01) & (
            np.abs(found) > 0.02 * np.median(np.abs(found))
        )  # nor is any route exact in a dip
        regular = np.flatnonzero(regular)
        return generator.choice(regular, min(20, len(regular)), replace=False)

    assert largest_error(assembly, theta, away) < 1e-8


def literal_exists(assembly) -> bool:
    """The published equations take joints with inertia only, between parts that merge and hold nothing."""
    graph = assembly.graph
    whole = sum(2 * len(part.nodes) for part in graph.substructures.values())
    internal = sum(connection.model.internal_dofs for connection in graph.connections.values())
    return bool(internal) and graph.size == whole + internal


@pytest.mark.parametrize("name", one_of_each())
def test_the_literal_method_gives_the_same_for_twenty_vectors(name):
    """To 1e-6 only: the literal method inverts receptances, which costs it the digits."""
    assembly = load(name)
    if not literal_exists(assembly):
        pytest.skip("the published equations do not take its joints")
    lines = np.linspace(0, len(assembly.frequency) - 1, 250).astype(int)
    literal = LiteralSynthesis(assembly.graph, assembly.frequency[lines], *assembly.description.response.point)
    theta = samples(assembly, 20, seed=15)
    for vector, found in zip(theta, assembly.engine.frfs(assembly.by_joint(theta))[:, 0], strict=True):
        np.testing.assert_allclose(literal.receptance(assembly.by_joint(vector)), found[lines], rtol=1e-6)


def differences(assembly, theta, column, relative_step) -> np.ndarray:
    """Eighth-order central differences by one parameter."""
    step = np.zeros_like(theta)
    step[column] = relative_step * theta[column]
    weights = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])
    ahead = assembly.frf(np.stack([theta + count * step for count in (1, 2, 3, 4)]))
    behind = assembly.frf(np.stack([theta - count * step for count in (1, 2, 3, 4)]))
    return weights @ (ahead - behind) / step[column]


@pytest.mark.parametrize("name", one_of_each())
def test_the_jacobian_equals_central_differences(name):
    """The best of several steps: a small one loses digits where a parameter hardly matters, a large one elsewhere.

    A damper may matter so little that only steps beyond its own value, to negative ones too, rise above the rounding.
    """
    assembly = load_with_parameters(name)
    for theta in samples(assembly, 2, seed=16):
        frf, jacobian = assembly.frf_jacobian(theta)
        np.testing.assert_allclose(frf, assembly.frf(theta), rtol=1e-8)
        for column, parameter in enumerate(assembly.parameters):
            exact = jacobian[:, column]
            steps = (3e-4, 1e-3, 1e-2, 5e-2, 0.2, *((1.0, 5.0) if parameter.unit in DAMPERS else ()))
            errors = [
                np.abs(exact - differences(assembly, theta, column, step)).max() / np.abs(exact).max() for step in steps
            ]
            assert min(errors) < 5e-7, (parameter.name, errors)
