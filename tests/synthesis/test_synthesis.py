"""The engine against the direct solve of the whole assembly, the literal method, and the laws of physics."""

from __future__ import annotations

import numpy as np
import pytest

import dovetail
from dovetail.dataset import latin_hypercube
from dovetail.synthesis import LiteralSynthesis, direct_receptance


def direct(assembly, theta, lines=slice(None)):
    """Drive-point receptance by solving the whole assembly."""
    name, dof = assembly.description.response.point
    number = int(assembly.graph.substructure_dofs(name)[dof])
    frequency = assembly.frequency[lines]
    return direct_receptance(assembly.graph, frequency, assembly.by_joint(theta), [number], [number])[:, 0, 0]


def receptance(assembly, theta):
    return assembly.engine.frfs(assembly.by_joint(np.atleast_2d(theta)))[:, 0]


def relative(found, truth):
    return np.max(np.abs(found - truth) / np.abs(truth))


def test_the_collet_assembly_has_seventy_dofs(collet):
    assert collet.graph.size == 70


def test_engine_equals_the_direct_solve_at_every_line(collet):
    """Each vector at every tenth line, beginning at another, so that all of them are met."""
    theta = latin_hypercube(collet, 20, seed=1)
    found = receptance(collet, theta)
    assert found.shape == (20, 4451)
    for first, (h, vector) in enumerate(zip(found, theta, strict=True)):
        lines = slice(first % 10, None, 10)
        assert relative(h[lines], direct(collet, vector, lines)) < 1e-8


def test_literal_synthesis_equals_the_direct_solve(collet, torque_20):
    name, dof = collet.description.response.point
    literal = LiteralSynthesis(collet.graph, collet.frequency, name, dof).receptance(collet.by_joint(torque_20))
    assert relative(literal, direct(collet, torque_20)) < 1e-6
    assert relative(receptance(collet, torque_20)[0], literal) < 1e-6


def test_the_structure_takes_power_and_gives_none(collet, sdof):
    for assembly in (collet, sdof):
        assert np.all(receptance(assembly, latin_hypercube(assembly, 50, seed=2)).imag <= 0)


def test_reciprocity_between_substructures_and_directions(collet, torque_100):
    points = [("tool", 0.0, "x"), ("tool", 0.05, "rz"), ("holder", 0.1454, "x"), ("holder", 0.0, "rz")]
    H = collet.receptance(torque_100, points, points)
    assert H.shape == (4451, 4, 4)
    assert np.max(np.abs(H - np.swapaxes(H, 1, 2)) / np.sqrt(np.abs(H * np.swapaxes(H, 1, 2)))) < 1e-8


def test_receptance_at_the_drive_point_is_the_frf(collet, torque_20):
    point = ("tool", 0.01, "x")
    H = collet.receptance(torque_20, [point], [point])[:, 0, 0]
    omega = 2 * np.pi * collet.frequency
    np.testing.assert_allclose(collet.frf(torque_20), -(omega**2) * H, rtol=1e-8)


def test_transfer_receptance_equals_the_direct_solve(collet, torque_20):
    graph = collet.graph
    out, into = collet.point("holder", 0.1454, "x"), collet.point("tool", 0.0, "x")
    numbers = [int(graph.substructure_dofs(part)[dof]) for part, dof in (out, into)]
    truth = direct_receptance(graph, collet.frequency, collet.by_joint(torque_20), numbers[:1], numbers[1:])
    found = collet.receptance(torque_20, [("holder", 0.1454, "x")], [("tool", 0.0, "x")])
    assert relative(found, truth) < 1e-8


def test_natural_frequencies_at_both_torques_are_those_of_the_publication(collet, torque_20, torque_100):
    """Those of the publication are without the joint's dampers."""
    for torque, expected in ((torque_20, [1319.0, 6446.0, 8133.0]), (torque_100, [1339.0, 6734.0, 8311.0])):
        undamped = torque.copy()
        undamped[[6, 7, 10, 11]] = 0.0
        np.testing.assert_allclose(collet.natural_frequencies(undamped), expected, atol=0.5)


def test_frf_peaks_are_at_the_natural_frequencies_for_light_damping(collet, torque_20):
    light = torque_20.copy()
    light[[6, 7, 10, 11]] = [10, 0.01, 10, 0.01]
    amplitude = np.abs(collet.frf(light))
    for natural in collet.natural_frequencies(light):
        near = np.abs(collet.frequency - natural) < 60
        peak = collet.frequency[near][amplitude[near].argmax()]
        assert abs(peak - natural) <= 2


def test_a_single_mass_on_a_spring_is_the_textbook_formula(sdof):
    k, c = 2.5e6, 40.0
    omega = 2 * np.pi * sdof.frequency
    expected = -(omega**2) / (k - omega**2 + 1j * omega * c)
    np.testing.assert_allclose(sdof.frf([k, c]), expected, rtol=1e-12)
    assert sdof.natural_frequencies([k, c], count=1)[0] == pytest.approx(np.sqrt(k) / (2 * np.pi), rel=1e-12)


def test_a_batch_is_the_same_as_its_vectors_one_by_one(collet):
    theta = latin_hypercube(collet, 5, seed=3)
    batch = collet.frf(theta)
    for row, vector in zip(batch, theta, strict=True):
        np.testing.assert_array_equal(row, collet.frf(vector))
        names = [parameter.name for parameter in collet.parameters]
        np.testing.assert_array_equal(row, collet.frf(dict(zip(names, vector, strict=True))))


def central_difference(assembly, theta, column, relative_step):
    """Fourth-order difference of the FRF by one parameter."""
    step = np.zeros_like(theta)
    step[column] = relative_step * theta[column]
    rows = assembly.frf(np.stack([theta + 2 * step, theta + step, theta - step, theta - 2 * step]))
    return (-rows[0] + 8 * rows[1] - 8 * rows[2] + rows[3]) / (12 * step[column])


def test_jacobian_equals_central_differences(collet, sdof):
    """The best of several steps: a small one loses digits where a parameter hardly matters, a large one elsewhere."""
    for assembly in (collet, sdof):
        theta = latin_hypercube(assembly, 2, seed=4)[1]
        frf, jacobian = assembly.frf_jacobian(theta)
        np.testing.assert_allclose(frf, assembly.frf(theta), rtol=1e-8)
        for column, parameter in enumerate(assembly.parameters):
            errors = [
                np.abs(jacobian[:, column] - difference).max() / np.abs(jacobian[:, column]).max()
                for step in (1e-4, 1e-3, 1e-2, 1e-1)
                for difference in [central_difference(assembly, theta, column, step)]
            ]
            assert min(errors) < 1e-6, (parameter.name, errors)


def two_beams(joint: dict) -> dict:
    material = {"young": 210e9, "density": 7800, "poisson": 0.3, "loss_factor": 0.004}

    def beam(length: float, elements: int) -> dict:
        section = {"length": length, "outer": 0.02, "elements": elements}
        return {"model": "timoshenko_beam", "material": material, "sections": [section]}

    return {
        "dovetail": 1,
        "name": "two-beams",
        "frequency": {"start": 10, "stop": 4010, "step": 10},
        "substructures": {"left": beam(0.2, 4), "right": beam(0.3, 6)},
        "joints": {"link": {**joint, "connect": {"a": {"to": "left", "at": 0.2}, "b": {"to": "right", "at": 0}}}},
        "response": {"at": "left", "position": 0, "quantity": "receptance"},
    }


def one_beam() -> np.ndarray:
    description = two_beams({"model": "rigid"})
    left = description["substructures"]["left"]
    whole = {**left, "sections": [{"length": 0.5, "outer": 0.02, "elements": 10}]}
    description.update(substructures={"left": whole}, joints={})
    return dovetail.load(description).frf()


def test_two_rigidly_joined_beams_are_the_one_long_beam():
    assert relative(dovetail.load(two_beams({"model": "rigid"})).frf(), one_beam()) < 1e-8


def test_a_stiff_joint_tends_to_the_rigid_one_and_a_soft_one_to_none():
    assembly = dovetail.load(two_beams({"model": "spring_damper"}))
    errors = [relative(assembly.frf([k, 0.0, k * 1e-4, 0.0]), one_beam()) for k in (1e12, 1e13)]
    assert errors[1] < 2e-3
    assert errors[0] / errors[1] == pytest.approx(10, rel=0.1)
    alone = assembly.description.substructures["left"].receptance(assembly.frequency, [0])[:, 0, 0]
    assert relative(assembly.frf([1e-6, 0.0, 1e-8, 0.0]), alone) < 1e-8


def test_rigid_merges_what_the_joint_connects():
    assembly = dovetail.load(two_beams({"model": "spring_damper"}))
    assert relative(assembly.rigid().frf([1e5, 1.0, 1e3, 1.0]), one_beam()) < 1e-8


def test_rigid_contacts_are_the_limit_of_stiff_layers(collet, torque_100):
    stiff = torque_100.copy()
    stiff[[4, 5, 8, 9]] = 1e15
    rigid = collet.rigid()
    assert [p.name for p in rigid.parameters] == [p.name for p in collet.parameters]
    np.testing.assert_allclose(rigid.natural_frequencies(torque_100), collet.natural_frequencies(stiff), rtol=1e-5)
    assert rigid.graph.size == 70 - 12


def test_a_hinge_transmits_force_but_no_moment():
    hinged = dovetail.load(two_beams({"model": "rigid", "direction": "x"}))
    sprung = dovetail.load(two_beams({"model": "spring_damper", "direction": "x"}))
    np.testing.assert_allclose(hinged.natural_frequencies(), sprung.natural_frequencies([1e14, 1.0]), rtol=1e-5)


def chain(joints: int) -> dict:
    """Masses of 1 kg between springs, the first one at the wall."""
    parts: dict = {"wall": {"model": "ground"}}
    links = {}
    for index in range(joints):
        parts[f"m{index}"] = {"model": "lumped", "masses": [{"mass": 1.0}]}
        below = f"m{index - 1}" if index else "wall"
        links[f"j{index}"] = {
            "model": "spring_damper",
            "direction": "x",
            "connect": {"a": {"to": f"m{index}", "at": 0}, "b": {"to": below, "at": 0}},
            "parameters": {"c": {"value": 10.0}},
        }
    return {
        "dovetail": 1,
        "name": "chain",
        "frequency": {"start": 1, "stop": 600, "step": 1},
        "substructures": parts,
        "joints": links,
        "response": {"at": f"m{joints - 1}", "position": 0, "quantity": "mobility"},
    }


def test_several_joints_are_identified_together_under_their_full_names():
    assembly = dovetail.load(chain(4))
    assert [p.name for p in assembly.parameters] == ["j0.k", "j1.k", "j2.k", "j3.k"]
    k = np.array([1e6, 2e6, 3e6, 4e6])
    omega = 2 * np.pi * assembly.frequency
    B = np.array([[1, 0, 0, 0], [-1, 1, 0, 0], [0, -1, 1, 0], [0, 0, -1, 1]], dtype=float)
    Z = B.T @ np.diag(k) @ B + 1j * omega[:, None, None] * (B.T @ B * 10.0) - omega[:, None, None] ** 2 * np.eye(4)
    expected = 1j * omega * np.linalg.inv(Z)[:, 3, 3]
    np.testing.assert_allclose(assembly.frf(k), expected, rtol=1e-10)
    state = np.block([[np.zeros((4, 4)), np.eye(4)], [-B.T @ np.diag(k) @ B, -B.T @ B * 10.0]])
    modes = np.sort(np.abs(np.linalg.eigvals(state)))[::2] / (2 * np.pi)
    np.testing.assert_allclose(assembly.natural_frequencies(k, count=4), modes, rtol=1e-10)


def test_missing_elastic_modes_are_nan(sdof):
    assert np.isnan(sdof.natural_frequencies(count=3)[1:]).all()


def test_a_negative_stiffness_has_an_frf_but_no_natural_frequencies(sdof):
    omega = 2 * np.pi * sdof.frequency
    np.testing.assert_allclose(sdof.frf([-5.0, 1.0]), -(omega**2) / (-5.0 - omega**2 + 1j * omega), rtol=1e-12)
    with pytest.raises(dovetail.DovetailError, match="a stiffness or a mass is negative"):
        sdof.natural_frequencies([-5.0, 1.0])


def direct_error(description: dict) -> float:
    assembly = dovetail.load(description)
    return relative(receptance(assembly, assembly.vector(None))[0], direct(assembly, assembly.vector(None)))


def test_massless_rotations_that_nothing_holds_take_no_part():
    description = {
        "dovetail": 1,
        "name": "pair",
        "frequency": {"start": 1, "stop": 600, "step": 1},
        "substructures": {n: {"model": "lumped", "masses": [{"mass": m}]} for n, m in (("a", 1.0), ("b", 2.0))},
        "joints": {"s": {"model": "spring_damper", "connect": {p: {"to": p, "at": 0} for p in "ab"}}},
        "response": {"at": "a", "position": 0, "quantity": "receptance"},
    }
    assembly = dovetail.load(description)
    k, c = 1e6, 10.0
    omega = 2 * np.pi * assembly.frequency
    spring = k + 1j * omega * c
    expected = (spring - 2 * omega**2) / ((spring - omega**2) * (spring - 2 * omega**2) - spring**2)
    np.testing.assert_allclose(assembly.frf([k, c, 1e3, 1.0]), expected, rtol=1e-10)
    natural = assembly.natural_frequencies([k, c, 1e3, 1.0], count=1)[0]
    assert natural == pytest.approx(np.sqrt(k * 1.5) / (2 * np.pi), rel=1e-9)


def test_one_body_on_two_nodes_of_a_beam_equals_the_direct_solve():
    description = two_beams({"model": "rigid"})
    beam = description["substructures"]["left"]
    parts = {"left": beam, "body": {"model": "lumped", "masses": [{"mass": 0.2, "inertia": 1e-5}]}}
    ends = {f"r{i}": {"a": {"to": "left", "at": at}, "b": {"to": "body", "at": 0}} for i, at in enumerate((0.15, 0.2))}
    joints = {name: {"model": "rigid", "connect": connect} for name, connect in ends.items()}
    assert direct_error({**description, "substructures": parts, "joints": joints}) < 1e-8


@pytest.mark.parametrize(
    ("broken", "message"),
    [
        (lambda joint: joint.K[:, 0, 2].__imul__(2), "a matrix K that is not symmetric"),
        (lambda joint: joint.C[:, 0, 0].__imul__(np.nan), "a matrix C that is not finite"),
    ],
)
def test_a_joint_with_unfit_matrices_is_refused(monkeypatch, broken, message):
    assembly = dovetail.load(two_beams({"model": "spring_damper"}))
    model = type(assembly.graph.connections["link"].model)
    real = model.matrices

    def matrices(self, theta):
        joint = real(self, theta)
        broken(joint)
        return joint

    monkeypatch.setattr(model, "matrices", matrices)
    with pytest.raises(dovetail.DovetailError, match=message):
        assembly.frf()
    monkeypatch.setattr(model, "matrices", lambda self, theta: real(self, theta[:1]))
    with pytest.raises(dovetail.DovetailError, match="of shape"):
        dovetail.load(two_beams({"model": "spring_damper"})).frf()
