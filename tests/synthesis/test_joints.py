"""Joints in their limiting cases: stiff is rigid, soft is disconnected, distributed layers equal their integrals."""

from __future__ import annotations

import numpy as np
import pytest

import dovetail
from dovetail import StructuralMatrices
from dovetail.registry import components

STEEL = {"young": 210e9, "density": 7800, "loss_factor": 0.003}


def joint(model, **options):
    component = components().find("joint", model).component
    return component(component.Config(**options))


def beams(model, values, *, count=3, spacing=0.02, ports=("a", "b"), **options):
    """Two bars that overlap over the contact nodes, joined with the given parameter values."""
    bar = {"model": "timoshenko_beam", "material": STEEL}
    lap = spacing * (count - 1)
    first = [{"length": 0.2, "outer": 0.02, "elements": 10}]
    if lap:
        first.append({"length": lap, "outer": 0.02, "elements": count - 1})
    second = [{"length": 0.3, "outer": 0.03, "elements": round(0.3 / spacing)}]
    at_second = [spacing * node for node in range(count)]
    return dovetail.load(
        {
            "dovetail": 1,
            "name": model,
            "frequency": {"start": 20, "stop": 6000, "step": 20},
            "substructures": {"one": {**bar, "sections": first}, "two": {**bar, "sections": second}},
            "joints": {
                "joint": {
                    "model": model,
                    "connect": {
                        ports[0]: {"to": "one", "at": [0.2 + spacing * node for node in range(count)]},
                        ports[1]: {"to": "two", "at": at_second},
                    },
                    "parameters": {name: {"value": value} for name, value in values.items()},
                    **options,
                }
            },
            "response": {"at": "one", "position": 0.0},
        }
    )


MODELS = {
    "bolted": ({"nodes": 3}, {"kt": 1, "kr": 1, "ct": 0, "cr": 0}, ("a", "b"), 3),
    "interference_fit": (
        {"nodes": 3, "length": 0.04},
        {"k": 1, "kr": 1, "c": 0, "cr": 0},
        ("shaft", "hub"),
        3,
    ),
    "bearing": ({}, {"k": 1, "kr": 1, "c": 0, "cr": 0, "m": 0, "J": 0}, ("shaft", "housing"), 1),
    "spring_damper": ({"nodes": 3}, {"k": 1, "kr": 1, "c": 0, "cr": 0}, ("a", "b"), 3),
}


def with_stiffness(model, stiffness):
    options, values, ports, nodes = MODELS[model]
    scaled = {name: value * stiffness for name, value in values.items()}
    return beams(model, scaled, count=nodes, ports=ports, **options)


@pytest.mark.parametrize("model", MODELS)
def test_a_very_stiff_joint_is_a_rigid_one(model):
    """The error falls with the stiffness: the rest is compliance, not another structure."""
    nodes = MODELS[model][3]
    rigid = beams("rigid", {}, count=nodes, nodes=nodes).natural_frequencies(count=4)
    errors = [np.abs(with_stiffness(model, k).natural_frequencies(count=4) / rigid - 1).max() for k in (1e11, 1e12)]
    assert errors[1] < 1e-3
    assert errors[1] < 0.15 * errors[0]


@pytest.mark.parametrize("model", MODELS)
def test_a_very_soft_joint_decouples_the_parts(model):
    bar = {"model": "timoshenko_beam", "material": STEEL}
    nodes = MODELS[model][3]
    lap = 0.02 * (nodes - 1)
    sections = [{"length": 0.2, "outer": 0.02, "elements": 10}]
    sections += [{"length": lap, "outer": 0.02, "elements": nodes - 1}] if lap else []
    alone = dovetail.load(
        {
            "dovetail": 1,
            "name": "alone",
            "frequency": {"start": 20, "stop": 6000, "step": 20},
            "substructures": {"one": {**bar, "sections": sections}},
            "response": {"at": "one", "position": 0.0},
        }
    )
    np.testing.assert_allclose(with_stiffness(model, 1e-6).frf(), alone.frf(), rtol=1e-6)


def test_a_bolts_mass_is_on_the_lap_once():
    """Rigid-body translation carries the bolt's mass, whatever the number of nodes."""
    for nodes in (1, 2, 3, 4):
        bolted = joint("bolted", nodes=nodes, bolt_mass=True)
        mass = bolted.matrices(np.array([[1e8, 1e4, 1.0, 1.0, 0.12]])).M[0]
        shift = np.tile([1.0, 0.0], 2 * nodes)
        assert shift @ mass @ shift == pytest.approx(0.12)
        positions = np.tile(np.arange(nodes) - (nodes - 1) / 2, 2)
        assert (np.diag(mass)[0::2] * positions).sum() == pytest.approx(0.0, abs=1e-15)


def test_stiffness_follows_the_preload_and_damping_does_not():
    theta = np.array([[1e8, 1e4, 7.0, 0.5]])
    loose = joint("bolted", nodes=2, preload={"force": "5 kN", "reference": "20 kN", "exponent": 0.5}).matrices(theta)
    given = joint("bolted", nodes=2).matrices(theta)
    np.testing.assert_allclose(loose.K, 0.5 * given.K)
    np.testing.assert_allclose(loose.C, given.C)


def test_the_distributed_layer_has_the_integrals_of_its_length():
    """Shift a rigid shaft by 1, or tilt it by 1 about the middle: forces k L and moments k L^3/12 + kr L."""
    length, k, kr = 0.08, 3e9, 2e6
    errors = []
    for nodes in (5, 9, 17):
        K = joint("interference_fit", length=length, nodes=nodes).matrices(np.array([[k, kr, 0.0, 0.0]])).K[0]
        shift, tilt = np.zeros(4 * nodes), np.zeros(4 * nodes)
        shift[0 : 2 * nodes : 2] = 1.0
        tilt[0 : 2 * nodes : 2] = np.linspace(-length / 2, length / 2, nodes)
        tilt[1 : 2 * nodes : 2] = 1.0
        assert shift @ K @ shift == pytest.approx(k * length, rel=1e-12)
        errors.append(tilt @ K @ tilt / (k * length**3 / 12 + kr * length) - 1)
    np.testing.assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 2, atol=0.01)


def test_a_linear_pressure_moves_the_stiffness_and_keeps_its_sum():
    length, k, g = 0.06, 2e9, 0.4
    nodes = 33
    K = (
        joint("interference_fit", length=length, nodes=nodes, pressure="linear")
        .matrices(np.array([[k, 1e6, 5.0, 1.0, g]]))
        .K[0]
    )
    shift, position = np.zeros(4 * nodes), np.zeros(4 * nodes)
    shift[0 : 2 * nodes : 2] = 1.0
    position[0 : 2 * nodes : 2] = np.linspace(-length / 2, length / 2, nodes)
    assert shift @ K @ shift == pytest.approx(k * length, rel=1e-12)
    assert position @ K @ shift == pytest.approx(k * g * length**2 / 6, rel=2e-3)


@pytest.mark.parametrize(("ends", "said"), [((-0.9, 1.2), "g is -0.9 to 1.2"), ((-1.5, -1.5), "g is -1.5")])
def test_a_gradient_that_makes_the_stiffness_of_an_end_negative_is_objected_to(ends, said):
    model = joint("interference_fit", length=0.04, pressure="linear")
    lower, upper = ({p.name: getattr(p, end) for p in model.parameters} for end in ("lower", "upper"))
    assert model.range_objections(lower, upper) == {}
    assert model.range_objections({**lower, "g": -1.0}, {**upper, "g": 1.0}) == {}
    (objection,) = model.range_objections({**lower, "g": ends[0]}, {**upper, "g": ends[1]}).items()
    assert objection[0] == "g"
    assert said in objection[1]


def test_a_bearings_inertia_is_that_of_a_lump_on_the_shaft():
    stiff = {"k": 1e8, "kr": 1e5, "c": 10, "cr": 0.1}
    with_ring = beams("bearing", {**stiff, "m": 0.3, "J": 2e-4}, count=1, ports=("shaft", "housing"))
    ring = joint("bearing").matrices(np.array([[0.0, 0.0, 0.0, 0.0, 0.3, 2e-4]])).M[0]
    np.testing.assert_allclose(np.diag(ring), [0.3, 2e-4, 0.0, 0.0])
    bare = beams("bearing", {**stiff, "m": 0.0, "J": 0.0}, count=1, ports=("shaft", "housing"))
    assert with_ring.natural_frequencies(count=1)[0] < bare.natural_frequencies(count=1)[0]


@pytest.mark.parametrize(
    ("model", "options", "count"),
    [
        ("bolted", {"nodes": 3, "bolt_mass": True}, 5),
        ("interference_fit", {"length": 0.04, "pressure": "linear"}, 5),
        ("bearing", {}, 6),
    ],
)
def test_matrices_are_symmetric_and_cost_nothing_in_rigid_motion(model, options, count):
    made = joint(model, **options)
    unit = np.random.default_rng(0).random((5, count))
    theta = np.column_stack([p.from_unit(unit[:, i]) for i, p in enumerate(made.parameters)])
    matrices = made.matrices(theta)
    for part in (matrices.M, matrices.K, matrices.C, matrices.D):
        np.testing.assert_array_equal(part, part.transpose(0, 2, 1))
        assert np.linalg.eigvalsh(part).min() > -1e-9 * max(np.abs(part).max(), 1.0)
    nodes = made.ports[0].nodes
    positions = 0.02 * np.arange(nodes)
    motion = np.column_stack([np.tile([1.0, 0.0], 2 * nodes), np.tile(np.c_[positions, np.ones(nodes)].ravel(), 2)])
    assert np.abs(matrices.K @ motion).max() < 1e-9 * np.abs(matrices.K).max()


class Spring(dovetail.JointModel):
    """A spring whose stiffness is linear in k, not in the exponent p, and grows no more beyond the range of k."""

    name, summary = "spring", "Test joint"
    parameters = (dovetail.Parameter("k", "N/m", 1e3, 1e6, "log"), dovetail.Parameter("p", "1", 0.5, 2.0))
    ports = (dovetail.JointPort("a", 1), dovetail.JointPort("b", 1))

    def stiffness(self, k, p):
        return np.minimum(k, 2e6) + 1e5 * p**3

    def matrices(self, theta):
        made = dovetail.StructuralMatrices.zeros(len(theta), 4)
        made.K[:] = self.stiffness(*theta.T)[:, None, None] * np.outer([1, 0, -1, 0], [1, 0, -1, 0])
        return made


class Kinked(Spring):
    """The same with a stiffness that bends inside the range of k."""

    def stiffness(self, k, p):
        return k + np.maximum(k - 9.9e5, 0.0) + 1e5 * p**3


class Product(Spring):
    """Linear in k, with a slope that depends on p."""

    def stiffness(self, k, p):
        return k * p**3


THETA = np.array([[2e3, 0.7], [5e5, 1.0], [9.95e5, 1.9], [1.5e6, 1.2], [3e6, 1.0], [0.0, 0.0]])
K, P = THETA.T


@pytest.mark.parametrize(
    ("model", "by_k", "by_p"),
    [
        (Spring, K < 2e6, 3e5 * P**2),
        (Kinked, 1.0 + (K > 9.9e5), 3e5 * P**2),
        (Product, P**3, 3 * K * P**2),
    ],
)
def test_derivatives_are_exact_where_linear_and_accurate_elsewhere(model, by_k, by_p):
    derivatives = model().matrices_jacobian(THETA)
    np.testing.assert_allclose(derivatives[0].K[:, 0, 0], by_k, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(derivatives[1].K[:, 0, 0], by_p, rtol=1e-10, atol=1e-3)
    for row in range(len(THETA)):
        for alone, together in zip(model().matrices_jacobian(THETA[row : row + 1]), derivatives, strict=True):
            np.testing.assert_array_equal(alone.K[0], together.K[row])
    assert all(
        np.array_equal(derivative.K[0], derivative.K[0].T) and not derivative.M.any() for derivative in derivatives
    )


def test_a_joint_without_parameters_has_no_derivatives():
    assert joint("rigid").matrices_jacobian(np.empty((3, 0))) == []


def test_a_contact_layer_couples_each_pair_with_the_stiffness_of_its_vector():
    """By hand: two springs from DOFs 0 and 2 to DOF 4, of 3 N/m and of 5 N/m in a batch of two; no damper."""
    joint = StructuralMatrices.zeros(2, 5)
    joint.add_contact_layer([(0, 4), (2, 4)], np.array([3.0, 5.0]))
    ones = np.array([[1, 0, 0, 0, -1], [0, 0, 0, 0, 0], [0, 0, 1, 0, -1], [0, 0, 0, 0, 0], [-1, 0, -1, 0, 2]])
    np.testing.assert_array_equal(joint.K, [3.0 * ones, 5.0 * ones])
    assert not joint.C.any()
    joint.add_contact_layer([(0, 4)], 0.0, 7.0)
    assert joint.C[:, 0, 4].tolist() == [-7.0, -7.0]
