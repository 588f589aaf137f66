"""The kernel of loops for large systems: against straight-line code, the direct solve and differences."""

from __future__ import annotations

import numpy as np

from dovetail import PartNode, StructuralMatrices, SubstructureModel
from dovetail.dataset import latin_hypercube
from dovetail.synthesis import Attachment, Connection, Engine, Graph, direct_receptance
from dovetail.synthesis import plan as plan_module
from dovetail.synthesis.plan import Settings
from support.masses_in_a_row import Viscoelastic, chain, spring

FREQUENCY = np.linspace(100.0, 9000.0, 43)
THETA = np.array([[1e6, 1e3, 0.5], [3e6, 5e2, 0.3], [2e5, 8e3, 0.7]])


class Block(SubstructureModel):
    """Everything is connected with everything; natural frequencies from 50 Hz to 12 kHz, loss factor 0.01."""

    name, summary = "block", "Test substructure"

    def __init__(self, nodes: int, seed: int) -> None:
        super().__init__()
        self.count, self.seed = nodes, seed

    @property
    def nodes(self):
        return tuple(PartNode(f"n{i}", float(i)) for i in range(self.count))

    def matrices(self):
        rng, size = np.random.default_rng(self.seed), 2 * self.count
        modes, _ = np.linalg.qr(rng.standard_normal((size, size)))
        K = modes @ np.diag((2 * np.pi * np.linspace(50, 12000, size)) ** 2) @ modes.T
        K = (K + K.T) / 2
        return StructuralMatrices(np.diag(rng.uniform(0.8, 1.2, size)), K, None, 0.01 * K)


def blocks(nodes: int) -> tuple[Graph, dict[str, np.ndarray]]:
    """Two blocks that a contact layer connects at all their nodes, and three parameter vectors."""
    layer = type(spring())
    at = tuple(range(nodes))
    ends = (Attachment("a", at), Attachment("b", at))
    parts = {"a": Block(nodes, 1), "b": Block(nodes, 2)}
    graph = Graph(parts, {"j": Connection(layer(layer.Config(nodes=nodes)), ends)})
    span = np.log([[1e6, 10.0, 1e4, 0.1], [1e9, 1e3, 1e6, 10.0]])
    return graph, {"j": np.exp(np.random.default_rng(0).uniform(*span, (3, 4)))}


def both(monkeypatch, make):
    """Return the engine of loops and that of straight-line code."""
    engines = []
    for limit in (0, 10**9):
        monkeypatch.setattr(plan_module, "SETTINGS", Settings(straight_line=limit))
        engine = make()
        _ = engine.plan.receptance_kernel, engine.plan.amplitude_kernel, engine.plan.jacobian_kernel
        engines.append(engine)
    assert engines[0].plan.receptance_kernel.scratch > 0 == engines[1].plan.receptance_kernel.scratch
    return engines


def assert_same(loops: Engine, straight: Engine, theta: dict[str, np.ndarray]) -> None:
    factor = 1j * loops.frequency
    expected, derived = (values[:, 0] for values in straight.frfs_jacobian(theta, factor))
    frf, jacobian = (values[:, 0] for values in loops.frfs_jacobian(theta, factor))
    np.testing.assert_allclose(frf, expected, rtol=1e-9)
    scale = np.abs(derived).max(axis=1, keepdims=True)
    assert (np.abs(jacobian - derived) / scale).max() < 1e-9
    np.testing.assert_allclose(loops.frfs(theta, factor)[:, 0], straight.frfs(theta, factor)[:, 0], rtol=1e-9)
    np.testing.assert_allclose(
        loops.amplitudes(theta, factor)[:, 0], straight.amplitudes(theta, factor)[:, 0], rtol=1e-6
    )


def test_loops_and_straight_line_code_give_the_same_for_the_collet(collet, monkeypatch):
    theta = collet.by_joint(latin_hypercube(collet, 9, seed=3))
    points, columns = [collet.description.response.point], {"collet": [11, 0, 4]}
    make = lambda: Engine(collet.graph, collet.frequency[::7], points, theta, columns)  # noqa: E731
    assert_same(*both(monkeypatch, make), theta)


def test_loops_and_straight_line_code_give_the_same_for_joints_that_depend_on_frequency(monkeypatch):
    graph, points = chain(spring(), Viscoelastic(), Viscoelastic())
    theta = {"j0": np.array([[2e6, 30.0]] * 3), "j1": THETA, "j2": THETA[::-1]}
    make = lambda: Engine(graph, FREQUENCY, points, theta, {"j0": [0], "j1": [2, 0], "j2": [1]})  # noqa: E731
    assert_same(*both(monkeypatch, make), theta)


def test_loops_note_a_vanishing_pivot_too(monkeypatch):
    graph, points = chain(Viscoelastic())
    frequency = np.sort(np.append(FREQUENCY, 1000 / (2 * np.pi) * (1 + 1e-13)))
    theta = {"j0": np.array([[1e6, 0.0, 0.5]])}
    make = lambda: Engine(graph, frequency, points, {"j0": THETA})  # noqa: E731
    loops, straight = both(monkeypatch, make)
    found, expected = loops.frfs_jacobian(theta), straight.frfs_jacobian(theta)
    assert loops.pivoted_lines == straight.pivoted_lines == 1
    np.testing.assert_allclose(found[0], expected[0], rtol=1e-9, atol=1e-18)
    np.testing.assert_allclose(found[1], expected[1], rtol=1e-9, atol=1e-18)


def test_sixty_boundary_dofs_equal_the_direct_solve():
    graph, theta = blocks(15)
    engine = Engine(graph, FREQUENCY, [("a", 0)], theta)
    assert engine.program.multiplications > plan_module.SETTINGS.straight_line
    found = engine.frfs(theta)[:, 0]
    for sample, vector in enumerate(theta["j"]):
        truth = direct_receptance(graph, FREQUENCY, {"j": vector}, [0], [0])[:, 0, 0]
        np.testing.assert_allclose(found[sample], truth, rtol=1e-8)


def test_the_jacobian_of_sixty_boundary_dofs_equals_central_differences():
    graph, theta = blocks(15)
    engine = Engine(graph, FREQUENCY, [("a", 0)], theta)
    jacobian = engine.frfs_jacobian(theta)[1][:, 0]
    for column in range(4):
        step = np.zeros(4)
        step[column] = 1.0
        width = 1e-3 * theta["j"][:, column]
        rows = [engine.frfs({"j": theta["j"] + turns * width[:, None] * step})[:, 0] for turns in (2, 1, -1, -2)]
        difference = (-rows[0] + 8 * rows[1] - 8 * rows[2] + rows[3]) / (12 * width[:, None])
        error = np.abs(jacobian[..., column] - difference).max(axis=1) / np.abs(difference).max(axis=1)
        assert error.max() < 1e-6, column
