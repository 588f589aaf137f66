"""Joints that give their own dynamic stiffness: FRF, derivatives, memory, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import dovetail
from dovetail.errors import PluginError
from dovetail.synthesis import Engine, assembly_matrices
from support.masses_in_a_row import SIGN, Viscoelastic, chain, spring

FREQUENCY = np.linspace(20.0, 900.0, 61)
THETA = np.array([[1e6, 1e3, 0.5], [3e6, 5e2, 0.3], [2e5, 8e3, 0.7]])


class Differentiated(Viscoelastic):
    """The same, with its own derivatives."""

    def dynamic_stiffness_jacobian(self, frequency, theta):
        _, c, alpha = (column[:, None] for column in theta.T)
        power = (2j * np.pi * frequency) ** alpha
        for derivative in (np.ones_like(power), power, c * power * np.log(2j * np.pi * frequency)):
            yield derivative[..., None, None] * np.outer(SIGN, SIGN)


class Faulty(Viscoelastic):
    """One derivative too few."""

    def dynamic_stiffness_jacobian(self, frequency, theta):
        return list(super().dynamic_stiffness_jacobian(frequency, theta))[:-1]


def exact(theta: np.ndarray) -> np.ndarray:
    omega = 2 * np.pi * FREQUENCY
    k, c, alpha = theta
    s = k + c * (1j * omega) ** alpha
    return (s - omega**2) / ((s - omega**2) ** 2 - s**2)


def test_a_joint_with_a_fractional_derivative_runs_through_the_same_elimination():
    graph, points = chain(Viscoelastic())
    engine = Engine(graph, FREQUENCY, points, {"j0": THETA})
    for found, vector in zip(engine.frfs({"j0": THETA})[:, 0], THETA, strict=True):
        np.testing.assert_allclose(found, exact(vector), rtol=1e-10)
    with pytest.raises(dovetail.DovetailError, match="joint 'j0' depends on frequency"):
        assembly_matrices(graph, {"j0": THETA[0]})


@pytest.mark.parametrize("model", [Viscoelastic, Differentiated])
def test_its_jacobian_equals_central_differences(model):
    graph, points = chain(model())
    engine = Engine(graph, FREQUENCY, points, {"j0": THETA})
    factor = -((2 * np.pi * FREQUENCY) ** 2) + 0j
    frf, jacobian = (values[:, 0] for values in engine.frfs_jacobian({"j0": THETA}, factor))
    assert jacobian.shape == (3, 61, 3)
    np.testing.assert_allclose(frf, engine.frfs({"j0": THETA}, factor)[:, 0], rtol=1e-12)
    for sample, vector in enumerate(THETA):
        for column in range(3):
            step = np.zeros(3)
            step[column] = 1e-4 * vector[column]
            rows = [exact(vector + turns * step) * factor for turns in (2, 1, -1, -2)]
            difference = (-rows[0] + 8 * rows[1] - 8 * rows[2] + rows[3]) / (12 * step[column])
            error = np.abs(jacobian[sample, :, column] - difference).max()
            assert error < 1e-6 * np.abs(difference).max(), (sample, column)


def test_the_differences_of_the_contract_are_good_to_nine_digits():
    exactly = Differentiated().dynamic_stiffness_jacobian(FREQUENCY, THETA)
    found = list(Viscoelastic().dynamic_stiffness_jacobian(FREQUENCY, THETA))
    assert len(found) == 3
    for own, difference in zip(exactly, found, strict=True):
        for sample in range(len(THETA)):
            assert np.abs(difference[sample] - own[sample]).max() < 1e-9 * np.abs(own[sample]).max()


def test_a_joint_of_matrices_offers_the_same_derivatives():
    model, theta = spring(), np.array([[2e6, 30.0]])
    derivatives = list(model.dynamic_stiffness_jacobian(FREQUENCY, theta))
    stiffness = np.outer(SIGN, SIGN)
    np.testing.assert_allclose(derivatives[0][0], np.broadcast_to(stiffness, (61, 4, 4)), atol=1e-9)
    omega = 2 * np.pi * FREQUENCY[:, None, None]
    np.testing.assert_allclose(derivatives[1][0], 1j * omega * stiffness, atol=1e-6)


def test_both_kinds_of_joints_in_one_assembly_have_derivatives_by_chosen_parameters():
    graph, points = chain(spring(), Viscoelastic())
    theta = {"j0": np.array([[2e6, 30.0]] * 3), "j1": THETA}
    whole = Engine(graph, FREQUENCY, points, theta)
    jacobian = whole.frfs_jacobian(theta)[1][:, 0]
    assert jacobian.shape == (3, 61, 5)
    for column in range(5):
        name, place = ("j0", column) if column < 2 else ("j1", column - 2)
        step = 1e-4 * theta[name][:, place]
        rows = []
        for turns in (2, 1, -1, -2):
            moved = {joint: values.copy() for joint, values in theta.items()}
            moved[name][:, place] += turns * step
            rows.append(whole.frfs(moved)[:, 0])
        difference = (-rows[0] + 8 * rows[1] - 8 * rows[2] + rows[3]) / (12 * step[:, None])
        error = np.abs(jacobian[..., column] - difference).max(axis=1) / np.abs(difference).max(axis=1)
        assert error.max() < 1e-6, column
    chosen = Engine(graph, FREQUENCY, points, theta, {"j0": [1], "j1": [2, 0]})
    np.testing.assert_allclose(chosen.frfs_jacobian(theta)[1][:, 0], jacobian[..., [1, 4, 2]], rtol=1e-9)


def test_derivatives_at_a_vanishing_pivot_are_solved_with_pivoting():
    """An undamped layer: the far mass alone resonates on it at 1000 rad/s."""
    graph, points = chain(Differentiated())
    frequency = np.sort(np.append(FREQUENCY, 1000 / (2 * np.pi)))
    line = int(np.argmin(np.abs(frequency - 1000 / (2 * np.pi))))
    theta = {"j0": np.array([[1e6, 0.0, 0.5]])}
    engine = Engine(graph, frequency, points, {"j0": THETA})
    frf, jacobian = (values[:, 0] for values in engine.frfs_jacobian(theta))
    assert engine.pivoted_lines == 1
    omega = 2 * np.pi * frequency[line]
    s, far = 1e6, 1e6 - omega**2
    assert frf[0, line] == pytest.approx(far / (far**2 - s**2), abs=1e-12)
    # with H = (s - w^2) / (w^4 - 2 s w^2): dH/ds = 1 / (w^4 - 2 s w^2) + 2 w^2 (s - w^2) / (w^4 - 2 s w^2)^2
    divisor = omega**4 - 2 * s * omega**2
    slope = 1 / divisor + 2 * omega**2 * far / divisor**2
    assert jacobian[0, line, 0] == pytest.approx(slope, rel=1e-8)
    assert jacobian[0, line, 1] == pytest.approx(slope * (1j * omega) ** 0.5, rel=1e-8)
    assert jacobian[0, line, 2] == 0


@pytest.mark.parametrize(("samples", "lines"), [(50_000, 16), (200, 4451)])
def test_memory_is_bounded_for_many_samples_and_many_lines(samples, lines, peak_of):
    graph, points = chain(Viscoelastic())
    engine = Engine(graph, np.linspace(20.0, 900.0, lines), points, {"j0": THETA})
    engine.threads = 2
    factor = np.ones(lines, dtype=complex)
    engine.amplitudes({"j0": THETA}, factor)
    engine.frfs_jacobian({"j0": THETA}, factor)
    many = {"j0": np.repeat(THETA[:1], samples, axis=0)}
    assert peak_of(lambda: engine.amplitudes(many, factor)[:, 0]) < samples * lines * 4 / 1e6 + 40
    few = {"j0": many["j0"][: samples // 5]}
    assert peak_of(lambda: engine.frfs_jacobian(few, factor)) < len(few["j0"]) * lines * 16 * (1 + 3) / 1e6 + 60


def test_a_joint_with_too_few_derivatives_is_refused():
    graph, points = chain(Faulty())
    engine = Engine(graph, FREQUENCY, points, {"j0": THETA})
    with pytest.raises(PluginError, match="returns 2 derivatives of its dynamic stiffness, not one for each"):
        engine.frfs_jacobian({"j0": THETA})
