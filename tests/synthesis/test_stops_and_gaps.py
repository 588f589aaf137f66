"""Joints with stops and gaps: entries that some parameters fill only, and derivatives that are zero almost everywhere.

Every expected value is worked out here from the equations of two or three rigid bodies, not from a joint's matrices.
"""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import dovetail
from dovetail import ComponentConfig, JointModel, JointPort, Parameter, StructuralMatrices
from dovetail.errors import DovetailError, PluginError
from dovetail.interfaces import SparseMatrices
from dovetail.interfaces.differentiation import Differentiation
from dovetail.registry import Registry
from dovetail.synthesis import Attachment, Connection, Engine, Graph
from support.masses_in_a_row import Viscoelastic, chain

FREQUENCY = np.linspace(20.0, 900.0, 41)
OMEGA = 2.0 * np.pi * FREQUENCY
MASS, INERTIA = 1.0, 1e-3
BELOW, ABOVE = [5e6, 20.0], [9.8e6, 20.0]
STOP = 9.7e6


class Spring(JointModel):
    """A spring and a damper along x; what a subclass adds is the stop."""

    name, summary = "spring_with_stop", "Test joint"
    parameters = (Parameter("k", "N/m", 1e5, 1e7), Parameter("c", "N s/m", 1.0, 100.0))
    ports = (JointPort("a", 1), JointPort("b", 1))

    class Config(ComponentConfig):
        """No options."""

    def matrices(self, theta):
        matrices = StructuralMatrices.zeros(len(theta), self.size)
        matrices.add_contact_layer([(0, 2)], theta[:, 0], theta[:, 1])
        self.add_stop(matrices, theta)
        return matrices

    def add_stop(self, matrices, theta):
        """Nothing."""


class RotationalStop(Spring):
    """Rotational stiffness that bears above 97 % of the range of k."""

    def add_stop(self, matrices, theta):
        matrices.add_contact_layer([(1, 3)], 10.0 * np.maximum(theta[:, 0] / STOP - 1.0, 0.0))


class RotationalDamper(Spring):
    """A constant rotational stiffness, and next to it a damper that bears above 97 % of the range of k."""

    def add_stop(self, matrices, theta):
        matrices.add_contact_layer([(1, 3)], 10.0 + 0.0 * theta[:, 0], np.where(theta[:, 0] > STOP, 1e-3, 0.0))


class Window(Spring):
    """The damping rises with k within 40.0 to 40.5 % of its range, where no probe lies, and is constant elsewhere."""

    low, high = 1e5 + 0.400 * 9.9e6, 1e5 + 0.405 * 9.9e6

    def add_stop(self, matrices, theta):
        inside = (np.clip(theta[:, 0], self.low, self.high) - self.low) * (
            self.high - np.clip(theta[:, 0], None, self.high)
        )
        matrices.add_contact_layer([(0, 2)], 0.0, 1e-7 * inside)


class Root(Spring):
    """A law that does not exist outside the ranges."""

    def add_stop(self, matrices, theta):
        matrices.K[:] *= np.sqrt(1e7 - theta[:, 0])[:, None, None] / 1e3


def bodies(joint: JointModel, *, direction: str = "x") -> tuple[Graph, list]:
    """Two bodies with mass and inertia and the joint between them; force and response at the first."""
    registry = Registry()
    registry.load_entry_points()
    lumped = registry.find("substructure", "lumped").component
    parts = {name: lumped(lumped.Config(masses=[{"mass": MASS, "inertia": INERTIA}])) for name in ("m0", "m1")}
    ends = (Attachment("m0", (0,)), Attachment("m1", (0,)))
    return Graph(parts, {"j": Connection(joint, ends)}), [("m0", ["x", "rz"].index(direction))]


def drive_point_of_two(spring: np.ndarray, inertia: float) -> np.ndarray:
    """Receptance of the first of two equal bodies with a spring of this complex stiffness between them."""
    return (spring - OMEGA**2 * inertia) / ((spring - OMEGA**2 * inertia) ** 2 - spring**2)


def slope_of_two(spring: np.ndarray, inertia: float) -> np.ndarray:
    """Its derivative by the spring's stiffness: -(x0 - x1)^2 with the receptances x0 and x1 of both bodies."""
    x0 = drive_point_of_two(spring, inertia)
    x1 = spring / ((spring - OMEGA**2 * inertia) ** 2 - spring**2)
    return -((x0 - x1) ** 2)


def engine_of(joint: JointModel, direction: str = "x", probes=(BELOW,)) -> Engine:
    graph, points = bodies(joint, direction=direction)
    return Engine(graph, FREQUENCY, points, {"j": np.array(probes)})


def rotational_stop(k: float) -> np.ndarray:
    return 10.0 * max(k / STOP - 1.0, 0.0) + 0j * OMEGA


def rotational_damper(k: float) -> np.ndarray:
    return 10.0 + 1j * OMEGA * (1e-3 if k > STOP else 0.0)


@pytest.mark.parametrize(("joint", "law"), [(RotationalStop, rotational_stop), (RotationalDamper, rotational_damper)])
def test_contacts_outside_the_probes_are_in_the_frf(joint, law):
    engine = engine_of(joint(joint.Config()), "rz")
    theta = np.array([BELOW, ABOVE, [9.99e6, 20.0], BELOW])
    frf = engine.frfs({"j": theta})[:, 0]
    for row, (k, _) in zip(frf, theta, strict=True):
        np.testing.assert_allclose(row, drive_point_of_two(law(k), INERTIA), rtol=1e-8)
    amplitude = engine_of(joint(joint.Config()), "rz").amplitudes({"j": theta}, np.ones(len(FREQUENCY), dtype=complex))[
        :, 0
    ]
    np.testing.assert_allclose(amplitude, np.abs(frf), rtol=1e-6)


def test_the_stop_is_in_the_jacobian():
    engine = engine_of(RotationalStop(RotationalStop.Config()), "rz")
    frf, jacobian = (values[:, 0] for values in engine.frfs_jacobian({"j": np.array([BELOW, ABOVE])}))
    np.testing.assert_allclose(frf[1], drive_point_of_two(rotational_stop(ABOVE[0]), INERTIA), rtol=1e-8)
    expected = slope_of_two(rotational_stop(ABOVE[0]), INERTIA) * 10.0 / STOP
    np.testing.assert_allclose(jacobian[1, :, 0], expected, rtol=1e-6)
    assert not jacobian[0].any()
    assert not jacobian[1, :, 1].any()


@pytest.mark.parametrize("distance", [1e-2, 1e-3, 1e-4, 1e-5])
def test_close_to_the_stop_the_derivative_is_that_of_its_side(distance):
    engine = engine_of(RotationalStop(RotationalStop.Config()), "rz")
    above, below = STOP * (1.0 + distance), STOP * (1.0 - distance)
    jacobian = engine.frfs_jacobian({"j": np.array([[above, 20.0], [below, 20.0]])})[1][:, 0]
    expected = slope_of_two(rotational_stop(above), INERTIA) * 10.0 / STOP
    np.testing.assert_allclose(jacobian[0, :, 0], expected, rtol=1e-6)
    assert not jacobian[1].any()


def test_a_derivative_that_is_zero_at_all_probes_is_found():
    joint = Window(Window.Config())
    engine = engine_of(joint, probes=[BELOW, [1e5, 1.0], [1e7, 100.0]])
    k = (joint.low + joint.high) / 2.0 - 1e4
    jacobian = engine.frfs_jacobian({"j": np.array([[k, 20.0], BELOW])})[1][:, 0]
    damping, slope = 20.0 + 1e-7 * (k - joint.low) * (joint.high - k), 1e-7 * (joint.low + joint.high - 2.0 * k)
    spring = k + 1j * OMEGA * damping
    np.testing.assert_allclose(jacobian[0, :, 0], slope_of_two(spring, MASS) * (1.0 + 1j * OMEGA * slope), rtol=1e-6)
    spring = BELOW[0] + 1j * OMEGA * BELOW[1]
    np.testing.assert_allclose(jacobian[1, :, 0], slope_of_two(spring, MASS), rtol=1e-6)


@pytest.mark.parametrize("k", [1e5, 9.999e6])
def test_a_joint_that_does_not_exist_outside_its_ranges_has_a_jacobian_at_their_ends(k):
    joint = Root(Root.Config())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        jacobian = engine_of(joint).frfs_jacobian({"j": np.array([[k, 100.0]])})[1][:, 0]
    root = np.sqrt(1e7 - k) / 1e3
    spring = k * root + 100j * OMEGA
    slope = root - k / (2e3 * np.sqrt(1e7 - k))
    np.testing.assert_allclose(jacobian[0, :, 0], slope_of_two(spring, MASS) * slope, rtol=1e-6)


class Stray(Viscoelastic):
    """It depends on frequency, and is held to the ground at its second end for k above 2 MN/m."""

    def dynamic_stiffness(self, frequency, theta):
        Z = super().dynamic_stiffness(frequency, theta)
        Z[:, :, 3, 3] = 0.0
        Z[:, :, 3, 3] += np.where(theta[:, 0] > 2e6, 1e-3 * theta[:, 0], 0.0)[:, None]
        return Z


def test_a_joint_that_depends_on_frequency_may_have_a_stop_too():
    joint = Stray(Stray.Config())
    graph, points = bodies(joint, direction="rz")
    low, high = [1e6, 1e3, 0.5], [4e6, 1e3, 0.5]
    engine = Engine(graph, FREQUENCY, [("m1", 1), *points], {"j": np.array([low])})
    frf, jacobian = (values[:, 0] for values in engine.frfs_jacobian({"j": np.array([low, high])}))
    np.testing.assert_allclose(frf[0], -1.0 / (OMEGA**2 * INERTIA), rtol=1e-8)
    np.testing.assert_allclose(frf[1], 1.0 / (4e3 - OMEGA**2 * INERTIA), rtol=1e-8)
    np.testing.assert_allclose(jacobian[1, :, 0], -1e-3 * frf[1] ** 2, rtol=1e-6)
    assert not jacobian[0].any()


def test_a_stop_is_in_a_receptance_that_is_requested_first():
    graph, points = bodies(Stray(Stray.Config()), direction="rz")
    engine = Engine(graph, FREQUENCY, [("m1", 1), *points], {"j": np.array([[1e6, 1e3, 0.5]])})
    between = engine.receptance({"j": np.array([[4e6, 1e3, 0.5]])}, [("m1", 1)], [("m1", 1)])
    np.testing.assert_allclose(between[:, 0, 0], 1.0 / (4e3 - OMEGA**2 * INERTIA), rtol=1e-8)


class Bridge(Spring):
    """The second end hangs on an internal DOF that carries something only above 97 % of the range of k."""

    internal_dofs = 1

    def matrices(self, theta):
        matrices = StructuralMatrices.zeros(len(theta), self.size)
        matrices.add_contact_layer([(0, 4), (4, 2)], np.where(theta[:, 0] > STOP, theta[:, 0], 0.0))
        return matrices


def test_a_part_that_only_the_stop_connects_moves_with_the_stop_and_not_before():
    joint = Bridge(Bridge.Config())
    theta = {"j": np.array([BELOW, ABOVE, BELOW])}
    engine = engine_of(joint)
    for _ in range(2):
        frf = engine.frfs(theta)[:, 0]
        np.testing.assert_allclose(frf[[0, 2]], [-1.0 / (MASS * OMEGA**2)] * 2, rtol=1e-8)
        np.testing.assert_allclose(frf[1], drive_point_of_two(ABOVE[0] / 2.0, MASS), rtol=1e-8)
    other = engine_of(joint)
    between = other.receptance({"j": np.array([ABOVE])}, [("m0", 0)], [("m0", 0)])
    np.testing.assert_allclose(between[:, 0, 0], frf[1], rtol=1e-8)


def test_other_parameters_keep_their_frf_bit_for_bit_when_the_plan_is_widened():
    joint = RotationalStop(RotationalStop.Config())
    graph, points = chain(joint, joint, joint)
    vectors = np.random.default_rng(0).uniform([1e5, 1.0], [9e6, 100.0], (9, 2))
    narrow = {f"j{i}": vectors[i : 7 + i] for i in range(3)}
    engine = Engine(graph, FREQUENCY, points, narrow)
    before = engine.frfs_jacobian(narrow)
    plan = engine.plan
    engine.frfs_jacobian({name: np.array([ABOVE]) for name in narrow})
    assert engine.plan is not plan
    for now, then in zip(engine.frfs_jacobian(narrow), before, strict=True):
        np.testing.assert_array_equal(now, then)


def test_points_that_nothing_connects_have_no_transfer_frf():
    """x and rz of a mass on springs in x and in rz."""
    graph, points = bodies(RotationalStop(RotationalStop.Config()))
    engine = Engine(graph, FREQUENCY, [*points, ("m1", 1)], {"j": np.array([ABOVE])}, pairs=[(0, 0), (1, 0), (1, 1)])
    frfs, jacobian = engine.frfs_jacobian({"j": np.array([ABOVE])})
    assert not frfs[:, 1].any()
    assert not jacobian[:, 1].any()
    assert np.all(engine.amplitudes({"j": np.array([ABOVE])}, 1.0 + 0j * OMEGA)[:, 1] == 0.0)
    assert frfs[:, [0, 2]].all()


def test_a_stop_beyond_the_probes_is_in_the_transfer_frfs_and_others_stay_the_same():
    joint = RotationalStop(RotationalStop.Config())
    graph, _ = bodies(joint)
    points, pairs = [("m0", 0), ("m1", 0), ("m0", 1), ("m1", 1)], [(1, 0), (2, 2), (3, 2), (3, 0)]
    engine = Engine(graph, FREQUENCY, points, {"j": np.array([BELOW])}, pairs=pairs)
    below = {"j": np.array([BELOW, [3e6, 50.0]])}
    before, plan = engine.frfs_jacobian(below), engine.plan
    frfs, jacobian = engine.frfs_jacobian({"j": np.array([ABOVE])})
    assert engine.plan is not plan
    spring, turned, law = ABOVE[0] + 1j * OMEGA * ABOVE[1], rotational_stop(ABOVE[0]), 10.0 / STOP
    H, slope = turned / ((turned - OMEGA**2 * INERTIA) ** 2 - turned**2), slope_of_two(turned, INERTIA)
    np.testing.assert_allclose(frfs[0, 2], H, rtol=1e-8)
    np.testing.assert_allclose(jacobian[0, 2, :, 0], -slope * law, rtol=1e-6)
    np.testing.assert_allclose(jacobian[0, 1, :, 0], slope * law, rtol=1e-6)
    np.testing.assert_allclose(frfs[0, 0], spring / ((spring - OMEGA**2) ** 2 - spring**2), rtol=1e-8)
    for now, then in zip(engine.frfs_jacobian(below), before, strict=True):
        np.testing.assert_array_equal(now, then)


class CrossedStop(Spring):
    """Above 97 % of the range of k the displacement of either end bears on the rotation of the other."""

    def add_stop(self, matrices, theta):
        matrices.add_contact_layer([(0, 3), (1, 2)], 10.0 * np.maximum(theta[:, 0] / STOP - 1.0, 0.0))


@pytest.mark.parametrize("pairs", [[(0, 0)], [(1, 1), (0, 1), (1, 0)]])
def test_a_wider_plan_keeps_the_order_of_elimination(pairs):
    """Entries between x and rz would have another order of fewest neighbours, and so another rounding."""
    joint = CrossedStop(CrossedStop.Config())
    part = bodies(joint)[0].substructures["m0"]
    ends = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (2, 5)]
    connections = {
        f"j{i}": Connection(joint, (Attachment(f"m{one}", (0,)), Attachment(f"m{other}", (0,))))
        for i, (one, other) in enumerate(ends)
    }
    graph = Graph({f"m{i}": part for i in range(6)}, connections)
    vectors = np.random.default_rng(0).uniform([1e5, 1.0], [9e6, 100.0], (11, 2))
    below = {f"j{i}": vectors[i : 6 + i] for i in range(6)}
    engine = Engine(graph, FREQUENCY, [("m0", 0), ("m3", 0)], below, pairs=pairs)
    before, plan = engine.frfs_jacobian(below), engine.plan
    engine.frfs_jacobian({name: np.array([ABOVE]) for name in below})
    assert engine.plan is not plan
    for now, then in zip(engine.frfs_jacobian(below), before, strict=True):
        np.testing.assert_array_equal(now, then)


class Lopsided(Spring):
    """Its stiffness obeys Newton's third law below 97 % of the range of k only."""

    def add_stop(self, matrices, theta):
        matrices.K[:, 1, 1] = matrices.K[:, 3, 3] = 1.0
        matrices.K[:, 1, 3] = np.where(theta[:, 0] > STOP, 1e-3, 0.0)


class Vague(Spring):
    """Its derivatives do not exist above 97 % of the range of k."""

    def matrices_jacobian(self, theta):
        for derivative in super().matrices_jacobian(theta):
            yield StructuralMatrices(
                np.where(theta[:, :1, None] > STOP, np.nan, derivative.K), derivative.K, derivative.C
            )


def test_faults_outside_the_probes_are_refused():
    engine = engine_of(Lopsided(Lopsided.Config()))
    engine.frfs({"j": np.array([BELOW])})
    with pytest.raises(PluginError, match=r"joint 'j' \(spring_with_stop\) returns a matrix K that is not symmetric"):
        engine.frfs({"j": np.array([BELOW, ABOVE])})
    engine = engine_of(Vague(Vague.Config()))
    with pytest.raises(PluginError, match=r"joint 'j' \(spring_with_stop\) returns a matrix M that is not finite"):
        engine.frfs_jacobian({"j": np.array([ABOVE])})


class Complex(Spring):
    """Its loss factor is written into the stiffness."""

    def add_stop(self, matrices, theta):
        matrices.K[:, 1, 1] = theta[:, 0] * (1.0 + 0.01j)


@pytest.mark.parametrize("make", [StructuralMatrices, SparseMatrices])
@pytest.mark.parametrize("name", "MKCD")
def test_complex_matrices_are_refused_by_name(make, name):
    matrices = {**dict.fromkeys("MKCD", np.eye(2)), name: np.eye(2) * (1.0 + 0.02j)}
    with pytest.raises(ValueError, match=rf"^{name} is complex; M, K, C and D are real: .*D"):
        make(**matrices)


def test_a_complex_stiffness_written_into_a_real_matrix_is_refused():
    with pytest.raises(DovetailError, match="ComplexWarning: Casting complex values to real"):
        engine_of(Complex(Complex.Config()))


PLUGIN = '''
import numpy as np
import dovetail


class Pad(dovetail.JointModel):
    name, summary = "pad", "A pad whose rotational stop bears above 97 % of the range of k"
    ports = (dovetail.JointPort("a", 1), dovetail.JointPort("b", 1))
    parameters = (dovetail.Parameter("k", "N/m", 1e5, 1e7), dovetail.Parameter("c", "N s/m", 1.0, 100.0))

    class Config(dovetail.ComponentConfig):
        """No options."""

    def matrices(self, theta):
        matrices = dovetail.StructuralMatrices.zeros(len(theta), self.size)
        matrices.add_contact_layer([(0, 2)], theta[:, 0], theta[:, 1])
        matrices.add_contact_layer([(1, 3)], 1e5 * np.maximum(theta[:, 0] / 9.7e6 - 1.0, 0.0))
        return matrices


@dovetail.hookimpl
def dovetail_components():
    return [Pad]
'''


def test_a_plugin_with_a_stop_gives_the_same_by_every_route(tmp_path):
    plugin = tmp_path / "pad.py"
    plugin.write_text(PLUGIN)
    material = {"young": "206 GPa", "density": "7850 kg/m^3", "poisson": 0.3, "loss_factor": 0.002}
    section = {"length": "200 mm", "outer": "20 mm", "elements": 4}
    beam = {"model": "timoshenko_beam", "material": material, "sections": [section]}
    ends = {"a": {"to": "left", "at": "200 mm"}, "b": {"to": "right", "at": "0 mm"}}
    description = {
        "dovetail": 1,
        "name": "two beams and a pad",
        "frequency": {"start": "20 Hz", "stop": "2000 Hz", "step": "33 Hz"},
        "substructures": {"left": beam, "right": beam},
        "joints": {"pad": {"model": "pad", "connect": ends}},
        "response": {"at": "left", "position": "0 mm", "direction": "x", "quantity": "accelerance"},
    }
    assembly = dovetail.load(description, plugins=plugin)
    for k in (5e6, 9.9e6):
        theta = {"pad.k": k, "pad.c": 20.0}
        frf, jacobian = assembly.frf_jacobian(theta)
        exact = assembly.receptance(theta, [("left", 0.0, "x")], [("left", 0.0, "x")])[:, 0, 0]
        np.testing.assert_allclose(frf, -((2 * np.pi * assembly.frequency) ** 2) * exact, rtol=1e-8)
        near = [assembly.frf({**theta, "pad.k": k * (1 + 1e-5 * step)}) for step in (-2, -1, 1, 2)]
        difference = np.tensordot([1, -8, 8, -1], near, 1) / (12e-5 * k)
        assert np.abs(jacobian[:, 0] - difference).max() < 1e-6 * np.abs(difference).max()


def test_the_derivative_at_a_vanishing_pivot_is_that_of_the_pivoted_solve():
    """At the natural frequency of the second mass on the spring alone the first stands still, and x1 = -1/k."""
    k = 4e6
    graph, points = bodies(Spring(Spring.Config()))
    frequency = np.append(FREQUENCY, np.sqrt(k / MASS) / (2.0 * np.pi) * (1.0 + 1e-13))
    engine = Engine(graph, np.sort(frequency), points, {"j": np.array([BELOW])}, {"j": [0]})
    jacobian = engine.frfs_jacobian({"j": np.array([[k, 0.0]])})[1][:, 0]
    assert engine.pivoted_lines == 1
    line = int(np.argmin(np.abs(engine.frequency - frequency[-1])))
    np.testing.assert_allclose(jacobian[0, line, 0], -1.0 / k**2, rtol=1e-8)


def test_an_entry_that_is_filled_in_a_small_part_of_a_range_only_is_differentiated_there():
    """The probes, from which it is known which entries are filled at all, do not meet this part."""

    def matrices(theta):
        made = StructuralMatrices.zeros(len(theta), 2)
        made.K[:, 0, 0] = theta[:, 0] ** 2
        made.K[:, 1, 1] = np.maximum(0.0, 1e-4 - (theta[:, 0] - 0.5) ** 2)
        return made

    differentiation = Differentiation(matrices, 2, np.array([0.0]), np.array([1.0]))
    (derivative,) = differentiation.jacobian(np.array([[0.3], [0.495]]))
    np.testing.assert_allclose(derivative.K[:, 0, 0], [0.6, 0.99], rtol=1e-9)
    np.testing.assert_allclose(derivative.K[:, 1, 1], [0.0, 0.01], rtol=1e-9)
