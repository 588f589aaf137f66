"""Rigid bodies in space: joints, forces and sensors at nodes that the first node carries."""

import numpy as np
import pytest

import dovetail
from support.dense_space import DenseStructure

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
STEEL = {"young": 210e9, "density": 7850.0, "poisson": 0.3, "loss_factor": 0.01}


def values(prefix, numbers):
    return {f"{prefix}_{each}": {"value": float(v)} for each, v in zip(DIRECTIONS, numbers, strict=True)}


def body_on_mounts(seed):
    """Return a body on three mounts that carries a beam, and the dense solution with the DOFs of its first node."""
    rng = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    rotation *= np.sign(np.linalg.det(rotation))
    along, across = -rotation[:, 1], rotation[:, 0]
    origin, center = rng.uniform(-0.2, 0.2, 3), rng.uniform(-0.02, 0.02, 3)
    points = {f"c{number}": rng.uniform(-0.1, 0.1, 3) for number in range(5)}
    mass, lengths = 3.0, rng.uniform(0.02, 0.1, 3)
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    tensor = mass * axes @ np.diag(lengths @ lengths - lengths**2) @ axes.T
    there = {name: origin + rotation @ point for name, point in points.items()}
    parts = {
        "body": {
            "model": "rigid_body",
            "mass": mass,
            "inertia": np.diag(tensor).tolist(),
            "products": [tensor[0, 1], tensor[0, 2], tensor[1, 2]],
            "center": center.tolist(),
            "nodes": {name: point.tolist() for name, point in points.items()},
            "place": {"origin": origin.tolist(), "along": along.tolist(), "across": across.tolist()},
        },
        "beam": {
            "model": "spatial_beam",
            "material": STEEL,
            "sections": [{"length": 0.2, "height": 0.02, "width": 0.01, "elements": 2}],
            "place": {"origin": there["c4"].tolist(), "along": "z"},
        },
        "wall": {"model": "ground", "points": [there[f"c{number}"].tolist() for number in range(1, 4)]},
    }
    dense = DenseStructure(4, 2)
    first = points["c0"]
    dense.add_body(0, mass, rotation @ tensor @ rotation.T, rotation @ (center - first))
    material = tuple(STEEL[name] for name in ("young", "density", "poisson", "loss_factor"))
    dense.add_beam(1, 2, 0.2, (0, 0, 1), (1, 0, 0), material, (0.02, 0.01))
    joints = {}
    for number in range(1, 5):
        stiffness = 10.0 ** np.concatenate([rng.uniform(5, 7, 3), rng.uniform(2, 4, 3)])
        damping = 10.0 ** np.concatenate([rng.uniform(0, 2, 3), rng.uniform(-2, 0, 3)])
        ends = {"a": {"to": "body", "at": f"c{number}"}, "b": {"to": "wall", "at": f"g{number}"}}
        if number == 4:
            ends["b"] = {"to": "beam", "at": 0.0}
        joints[f"j{number}"] = {
            "model": "bushing",
            "connect": ends,
            "parameters": {**values("k", stiffness), **values("c", damping)},
        }
        way = there[f"c{number}"] - there["c0"]
        dense.add_bushing(0, 1 if number == 4 else None, stiffness, damping, ways=(way, (0, 0, 0)))
    description = {
        "dovetail": 1,
        "name": "body",
        "frequency": {"start": 5.0, "stop": 1000.0, "lines": 40},
        "substructures": parts,
        "joints": joints,
        "response": {"at": "body", "position": "c2", "direction": [1, 2, 2], "quantity": "receptance"},
    }
    return description, dense, {name: point - there["c0"] for name, point in there.items()}


def at_point(way, direction, size):
    """Return the DOFs (size,) that a motion or a force at a point of the body involves."""
    row = np.zeros(size)
    row[:3] = direction
    row[3:6] = np.cross(way, direction)
    return row


@pytest.mark.parametrize("seed", range(8))
def test_joints_forces_and_sensors_at_carried_nodes_act_at_their_points(seed):
    description, dense, ways = body_on_mounts(seed)
    description["response"]["force"] = {"position": "c1", "direction": "y"}
    assembly = dovetail.load(description)
    moved = at_point(ways["c2"], np.array([1, 2, 2]) / 3.0, len(dense.K))
    pushed = at_point(ways["c1"], np.array([0.0, 1.0, 0.0]), len(dense.K))
    expected = dense.receptance(assembly.frequency, moved, pushed)
    assert np.abs(assembly.frf() - expected).max() < 1e-9 * np.abs(expected).max()


def test_a_body_on_mounts_has_the_poles_of_the_dense_matrices():
    description, dense, _ = body_on_mounts(1)
    size, inverse = len(dense.K), np.linalg.inv(dense.M)
    companion = np.block([[np.zeros((size, size)), np.eye(size)], [-inverse @ dense.K, -inverse @ dense.C]])
    poles = np.linalg.eigvals(companion)
    expected = np.sort(np.abs(poles[poles.imag > 1.0]))[:6] / (2 * np.pi)
    np.testing.assert_allclose(dovetail.load(description).natural_frequencies(count=6), expected, rtol=1e-8)


def test_the_stiffness_at_a_carried_node_has_the_derivative_of_the_frf():
    description, _, _ = body_on_mounts(2)
    description["joints"]["j1"]["parameters"]["k_x"] = {"range": [1e5, 1e7], "scale": "log"}
    description["substructures"]["body"]["mass"] = {"range": [2.0, 4.0]}
    assembly = dovetail.load(description)
    theta = assembly.vector(None)
    _, jacobian = assembly.frf_jacobian(theta)
    for column in range(2):
        step = np.zeros(2)
        step[column] = 1e-5 * theta[column]
        slope = (assembly.frf(theta + step) - assembly.frf(theta - step)) / (2.0 * step[column])
        assert np.abs(jacobian[:, column] - slope).max() < 1e-6 * np.abs(slope).max()


def test_a_rigid_joint_at_a_carried_node_is_that_of_a_body_whose_first_node_it_is():
    description, _, _ = body_on_mounts(3)
    connect = description["joints"]["j4"]["connect"]
    description["joints"]["j4"] = {"model": "rigid", "direction": "all", "connect": connect}
    carried = dovetail.load(description).frf()
    nodes = description["substructures"]["body"]["nodes"]
    description["substructures"]["body"]["nodes"] = {"c4": nodes["c4"], **nodes}
    first = dovetail.load(description).frf()
    assert np.abs(carried - first).max() < 1e-9 * np.abs(first).max()
    stiff, _, _ = body_on_mounts(3)
    stiff["joints"]["j4"]["parameters"] = {**values("k", [1e12] * 3 + [1e9] * 3), **values("c", [0.0] * 6)}
    expected = dovetail.load(stiff).frf()
    assert np.abs(carried - expected).max() < 1e-3 * np.abs(expected).max()


@pytest.mark.parametrize("inertia", [[1.0, 1.0, 3.0], [0.0, 1.0, 2.0]])
def test_moments_that_no_body_has_are_refused(inertia):
    description, _, _ = body_on_mounts(0)
    description["substructures"]["body"] |= {"inertia": inertia, "products": [0.0, 0.0, 0.0]}
    with pytest.raises(dovetail.DovetailError, match="no body has the principal moments"):
        dovetail.load(description)
