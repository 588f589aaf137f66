"""Every joint in space whose nodes are placed wrongly is one clear error with both points, measured parts included."""

from __future__ import annotations

import numpy as np
import pytest

import dovetail

STEEL = {"young": 210e9, "density": 7850.0}
LENGTH, NODES = 0.04, 3
JOINTS = {
    "bushing": {"model": "bushing"},
    "ball_joint": {"model": "ball_joint"},
    "hinge": {"model": "hinge"},
    "weld": {"model": "rigid", "direction": "all"},
    "several welds": {"model": "rigid", "direction": "all", "nodes": NODES},
    "bearing": {"model": "bearing", "motion": "space"},
    "lap": {"model": "bolted", "motion": "space", "nodes": NODES},
    "fit": {"model": "interference_fit", "motion": "space", "diameter": 0.01, "length": LENGTH, "nodes": NODES},
}
FACES = {"lap": 0.005}
"""Distance of the centroids of both bars from the faces at which they meet [m]."""
PORTS = {"bearing": ("shaft", "housing"), "fit": ("shaft", "hub")}
PLACES = {
    "moved along": {"origin": [0.0, 0.013, 0.0]},
    "moved across": {"origin": [0.013, 0.0, 0.0]},
    "moved aside": {"origin": [0.0, 0.0, -0.013]},
    "turned about its axis and moved": {"origin": [0.0, 0.0, 0.002], "rotate": [{"about": "y", "angle": "30 deg"}]},
    "turned": {"origin": [0.0, 0.013, 0.0], "rotate": [{"about": "z", "angle": "20 deg"}]},
    "in metres instead of millimetres": {"origin": [0.0, 13.0, 0.0]},
}


def bar(place, offset=0.0):
    section = {"length": LENGTH, "outer": 0.01, "elements": NODES - 1, "offset": [offset, 0.0]}
    return {"model": "spatial_beam", "material": STEEL, "sections": [section], "place": place}


def measured(folder, place):
    """Return a measured part with six directions at each of the bar's nodes: springs to the ground."""
    frequency, dofs = np.arange(10.0, 110.0, 10.0), 6 * NODES
    receptance = np.zeros((len(frequency), dofs, dofs), dtype=np.complex128)
    receptance[:, range(dofs), range(dofs)] = 1.0 / (1e6 * (1.0 + 0.02j))
    at = np.linspace(0.0, LENGTH, NODES)
    table = {"point_x": np.zeros(dofs), "point_y": -np.repeat(at, 6), "point_z": np.zeros(dofs)}
    names = [f"n{number + 1}" for number in range(NODES)]
    np.savez(
        folder / "bar.npz",
        frequency=frequency,
        receptance=receptance,
        nodes=np.repeat(names, 6),
        directions=list(dovetail.DIRECTIONS) * NODES,
        **table,
    )
    return {"model": "measured", "file": str(folder / "bar.npz"), "place": place}


def described(joint, second):
    labels = [f"n{number + 1}" for number in range(NODES)]
    at = labels if JOINTS[joint].get("nodes", 1) > 1 else labels[:1]
    first, other = PORTS.get(joint, ("a", "b"))
    connect = {first: {"to": "first", "at": at}, other: {"to": "second", "at": at}}
    return {
        "dovetail": 1,
        "name": "two bars",
        "frequency": [20.0, 100.0],
        "substructures": {"first": bar({}, -FACES.get(joint, 0.0)), "second": second},
        "joints": {"joint": {**JOINTS[joint], "connect": connect}},
        "response": {"at": "first", "position": "n1"},
    }


@pytest.mark.parametrize("joint", JOINTS)
def test_a_joint_whose_nodes_meet_is_accepted(joint, tmp_path):
    for second in (bar({}, FACES.get(joint, 0.0)), measured(tmp_path, {})):
        assert np.isfinite(dovetail.load(described(joint, second)).frf()).all()


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize("kind", ["beam", "measured"])
def test_a_part_at_another_place_is_one_error_with_both_points(kind, joint, place, tmp_path):
    second = bar(PLACES[place]) if kind == "beam" else measured(tmp_path, PLACES[place])
    with pytest.raises(dovetail.DescriptionError) as caught:
        dovetail.load(described(joint, second))
    (fault,) = caught.value.faults
    assert fault.where.rpartition("  ")[2].startswith("joints.joint.connect.")
    assert fault.problem.count(") mm") + fault.problem.count(") m ") >= 1 or " mm" in fault.problem
    assert "'second'" in fault.problem or "'first'" in fault.problem
    assert fault.remedy
