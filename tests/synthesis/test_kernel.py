"""The compiled kernel against a plain elimination, and its edge cases: short axes, zeros, vanishing pivots."""

from __future__ import annotations

import json

import numpy as np
import pytest

import dovetail
from dovetail import JointModel, JointPort, Parameter
from dovetail.dataset import latin_hypercube
from dovetail.registry import Registry
from dovetail.synthesis import Attachment, Connection, Engine, Graph, direct_receptance
from dovetail.synthesis.codegen.compiler import WIDTH
from dovetail.synthesis.elimination import plan_elimination, run_elimination

FREQUENCY = np.linspace(20.0, 900.0, 61)


def obvious(engine: Engine, theta: dict) -> np.ndarray:
    """Drive-point receptance by `run`, from the system's own dynamic stiffness."""
    Z = engine.system.dynamic_stiffness(theta, slice(None))
    program = engine.program
    slots = np.ascontiguousarray(Z[:, program.rows, program.columns].T)
    run_elimination(program, slots)
    return 1.0 / slots[program.diagonal[-1], : len(engine.frequency)]


def test_the_kernel_agrees_with_a_plain_elimination(collet):
    theta = collet.by_joint(latin_hypercube(collet, 3, seed=5))
    found = collet.engine.frfs(theta)[:, 0]
    for sample in range(3):
        one = {name: values[sample : sample + 1] for name, values in theta.items()}
        np.testing.assert_allclose(found[sample], obvious(collet.engine, one), rtol=1e-9)


def test_the_program_of_the_collet_is_small(collet):
    assert len(collet.engine.program.order) == 23
    assert collet.engine.program.multiplications <= 320


@pytest.mark.parametrize("size", [1, 2, 7, 20])
@pytest.mark.parametrize("kept", [1, 3])
def test_elimination_leaves_the_schur_complement(size, kept):
    kept = min(size, kept)
    rng = np.random.default_rng(size)
    pattern = rng.random((size, size)) < 0.2
    pattern = pattern | pattern.T | np.eye(size, dtype=bool)
    matrix = np.where(pattern, rng.standard_normal((size, size)) + 1j * rng.standard_normal((size, size)), 0)
    matrix = matrix + matrix.T + 4 * np.eye(size)
    keep = rng.permutation(size)[:kept]
    program = plan_elimination(pattern, keep.tolist())
    slots = matrix[program.rows, program.columns][:, None]
    run_elimination(program, slots)
    left = np.zeros((size, size), dtype=complex)
    left[program.rows, program.columns] = left[program.columns, program.rows] = slots[:, 0]
    inner = np.setdiff1d(np.arange(size), keep)
    coupling = matrix[np.ix_(inner, keep)]
    schur = matrix[np.ix_(keep, keep)] - coupling.T @ np.linalg.solve(matrix[np.ix_(inner, inner)], coupling)
    np.testing.assert_allclose(left[np.ix_(keep, keep)], schur, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("lines", [1, WIDTH - 1, WIDTH, WIDTH + 1, 3 * WIDTH, 3 * WIDTH + 5])
def test_frfs_of_any_number_of_lines_are_computed(sdof, lines):
    description = json.loads(sdof.description.text)
    description["frequency"] = {"start": 10, "stop": 10 + 7 * (lines - 1) + 1e-3, "lines": lines} if lines > 1 else None
    theta = [2.5e6, 40.0]
    if lines == 1:
        engine = Engine(
            sdof.graph, np.array([50.0]), [sdof.description.response.point], sdof.by_joint(np.array([theta]))
        )
        frequency, found = np.array([50.0]), engine.frfs(sdof.by_joint(np.array([theta])))[0, 0]
    else:
        assembly = dovetail.load(description)
        frequency = assembly.frequency
        found = -assembly.frf(theta) / (2 * np.pi * frequency) ** 2
    omega = 2 * np.pi * frequency
    np.testing.assert_allclose(found, 1 / (2.5e6 - omega**2 + 40j * omega), rtol=1e-12)


def test_amplitude_is_the_magnitude_in_single_precision(collet):
    theta = latin_hypercube(collet, 70, seed=6)
    amplitude = collet.accelerance_amplitude(theta)
    assert amplitude.dtype == np.float32
    np.testing.assert_allclose(amplitude, np.abs(collet.frf(theta)), rtol=3e-7)


def test_the_collets_derivatives_are_the_differences_of_its_matrices(collet):
    model = collet.graph.connections["collet"].model
    theta = latin_hypercube(collet, 4, seed=9)
    for column, derivative in enumerate(model.matrices_jacobian(theta)):
        step = 1e-5 * theta * np.eye(theta.shape[1])[column]
        above, below = model.matrices(theta + step), model.matrices(theta - step)
        for part in "MKCD":
            expected = (getattr(above, part) - getattr(below, part)) / (2 * step[:, column, None, None])
            np.testing.assert_allclose(
                getattr(derivative, part), expected, rtol=1e-6, atol=1e-7 * np.abs(expected).max()
            )


def test_no_samples_give_no_frfs(collet):
    theta = collet.by_joint(np.empty((0, 12)))
    assert collet.engine.frfs(theta)[:, 0].shape == (0, 4451)
    assert collet.engine.frfs_jacobian(theta)[1][:, 0].shape == (0, 4451, 12)


def test_threads_change_nothing(collet):
    theta = collet.by_joint(latin_hypercube(collet, 200, seed=7))
    engine = collet.engine
    before = engine.threads
    try:
        engine.threads = 1
        alone = engine.frfs(theta)[:, 0]
        engine.threads = 3
        np.testing.assert_array_equal(engine.frfs(theta)[:, 0], alone)
    finally:
        engine.threads = before


def undamped(collet):
    description = json.loads(collet.description.text)
    for part in [*description["substructures"].values(), description["joints"]["collet"]]:
        part["material"]["loss_factor"] = 0
    names = ("ct_tc", "cr_tc", "ct_hc", "cr_hc")
    description["joints"]["collet"]["parameters"].update({name: {"value": 0} for name in names})
    return dovetail.load(description)


def test_without_damping_the_frf_is_real_and_exact_away_from_resonance(collet):
    """Each vector at every tenth line, beginning at another."""
    assembly = undamped(collet)
    theta = latin_hypercube(assembly, 10, seed=8)
    found = assembly.engine.frfs(assembly.by_joint(theta))[:, 0]
    assert np.all(found.imag == 0)
    name, dof = assembly.description.response.point
    number = int(assembly.graph.substructure_dofs(name)[dof])
    for first, (vector, receptance) in enumerate(zip(theta, found, strict=True)):
        by_joint, frequency = assembly.by_joint(vector), assembly.frequency[first::10]
        truth = direct_receptance(assembly.graph, frequency, by_joint, [number], [number])[:, 0, 0]
        modes = assembly.natural_frequencies(vector, count=8)
        away = np.min(np.abs(frequency[:, None] / modes - 1), axis=1) > 0.01
        zeros = np.abs(truth) < 0.02 * np.median(np.abs(truth))  # no route is exact next to an antiresonance
        error = np.abs(receptance[first::10] - truth)[away & ~zeros] / np.abs(truth)[away & ~zeros]
        assert error.max() < 1e-8


class Bar(JointModel):
    """A mass between two springs, undamped, so that a pivot can vanish."""

    name, summary = "bar", "Test joint"
    parameters = (Parameter("k", "N/m", 1e3, 1e7, "log"), Parameter("m", "kg", 0.1, 10.0))
    ports = (JointPort("a", 1), JointPort("b", 1))
    internal_dofs = 1

    def matrices(self, theta):
        k, m = theta.T
        joint = dovetail.StructuralMatrices.zeros(len(theta), 5)
        for port in (0, 2):
            joint.K[:, port, port] += k
            joint.K[:, 4, 4] += k
            joint.K[:, port, 4] -= k
            joint.K[:, 4, port] -= k
        joint.M[:, 4, 4] = m
        return joint


def two_masses(joint: JointModel, left: float = 1.0) -> tuple[Graph, list]:
    registry = Registry()
    registry.load_entry_points()
    lumped = registry.find("substructure", "lumped").component
    parts = {name: lumped(lumped.Config(masses=[{"mass": m}])) for name, m in (("left", left), ("right", 1.0))}
    graph = Graph(parts, {"j": Connection(joint, (Attachment("left", (0,)), Attachment("right", (0,))))})
    return graph, [("left", 0)]


def test_a_vanishing_pivot_is_solved_with_pivoting_and_counted():
    graph, points = two_masses(Bar())
    frequency = np.sort(np.append(FREQUENCY, 1000 / (2 * np.pi) * (1 + 1e-13)))
    theta = {"j": np.array([[1e6, 0.7]])}  # the right mass of 1 kg alone resonates on its spring at 1000 rad/s
    engine = Engine(graph, frequency, points, theta)
    found = engine.frfs(theta)[0, 0]
    truth = direct_receptance(graph, frequency, {"j": theta["j"][0]}, [0], [0])[:, 0, 0]
    assert engine.pivoted_lines == 1
    np.testing.assert_allclose(found, truth, rtol=1e-8)
    amplitude = engine.amplitudes(theta, np.ones(len(frequency), dtype=complex))[0, 0]
    np.testing.assert_allclose(amplitude, np.abs(truth), rtol=1e-6)
    assert engine.pivoted_lines == 2


def test_the_derivatives_at_a_vanishing_pivot_are_solved_with_pivoting():
    graph, points = two_masses(Bar(), left=2.0)
    frequency = np.sort(np.append(FREQUENCY, 1000 / (2 * np.pi)))
    line = int(np.argmin(np.abs(frequency - 1000 / (2 * np.pi))))
    theta = np.array([1e6, 0.7])
    engine = Engine(graph, frequency, points, {"j": theta[None, :]})
    factor = 1j * frequency
    frf, jacobian = (values[:, 0] for values in engine.frfs_jacobian({"j": theta[None, :]}, factor))
    assert engine.pivoted_lines == 1
    assert np.isfinite(jacobian).all()
    for column in range(2):
        step = np.zeros(2)
        step[column] = 1e-4 * theta[column]
        rows = [
            direct_receptance(graph, frequency, {"j": theta + turns * step}, [0], [0])[:, 0, 0] * factor
            for turns in (2, 1, -1, -2)
        ]
        difference = (-rows[0] + 8 * rows[1] - 8 * rows[2] + rows[3]) / (12 * step[column])
        error = np.abs(jacobian[0, :, column] - difference)
        largest = np.abs(jacobian[0, :, column]).max()
        assert error.max() < 1e-6 * largest
        assert error[line] < 1e-6 * np.abs(difference[line]) + 1e-12 * largest  # by the mass it is zero there
    np.testing.assert_allclose(frf[0], engine.frfs({"j": theta[None, :]}, factor)[0, 0], rtol=1e-8)


def test_a_line_on_an_undamped_resonance_is_refused(sdof):
    at_resonance = Engine(
        sdof.graph, np.array([50.0]), [sdof.description.response.point], sdof.by_joint(np.array([[1e6, 10.0]]))
    )
    theta = sdof.by_joint(np.array([[(2 * np.pi * 50.0) ** 2, 0.0]]))
    for compute in (at_resonance.frfs, at_resonance.frfs_jacobian):
        with pytest.raises(dovetail.DovetailError, match="no FRF at 50 Hz: it resonates without damping, or a part"):
            compute(theta)
