"""Joints with a layer of nodes in space: the nodes lie along the joint's own axis, opposite to those that they face."""

from itertools import product

import numpy as np
import pytest

import dovetail

STEEL = {"young": 210e9, "density": 7850.0}
LAYERS = {
    "interference_fit": ({"length": 0.04, "nodes": 3}, ("shaft", "hub"), (0.0, 0.02, 0.04), 0.16),
    "collet": ({"material": STEEL}, ("tool", "holder"), (0.0, 0.01, 0.02), 0.18),  # the holder's c3 is the tool's
    "bolted": ({"nodes": 3}, ("a", "b"), (0.0, 0.02, 0.04), 0.16),
    "bolted in space": ({"nodes": 3, "motion": "space"}, ("a", "b"), (0.0, 0.02, 0.04), 0.16),
}
"""Options, ports, distances of the nodes and where the second part begins along the first [m]."""
ACROSS = {"x": "z", "y": "x", "z": "x"}


def origin(along, distance, **more):
    """Return a point at a distance [m] from the origin along an axis such as '-y', moved along others."""
    point = [0.0, 0.0, 0.0]
    point["xyz".index(along[-1])] = -distance if along[0] == "-" else distance
    for axis, shift in more.items():
        point["xyz".index(axis)] += shift
    return point


def layered(joint, along="-y", *, parts="spatial_beam", shift=None, **section):
    """Two stepped beams that lie along an axis of the assembly, joined over a layer."""
    options, ports, distances, begin = LAYERS[joint]
    bars = [{"length": 0.1, "outer": 0.02, "elements": 10}, {"length": 0.1, "outer": 0.03, "elements": 10}]
    across = ACROSS[along[-1]]
    beam = {"model": parts, "material": STEEL, "sections": bars}
    other = {**beam}
    if joint == "bolted in space":  # the nodes are on the faces
        lower, upper = ([{**bar, "offset": [side * bar["outer"] / 2, 0.0]} for bar in bars] for side in (-1.0, 1.0))
        beam, other = {**beam, "sections": lower}, {**beam, "sections": upper}
    places = [{"along": along, "across": across, "origin": origin(along, at)} for at in (0.0, begin)]
    places[1]["origin"] = origin(along, begin, **(shift or {}))
    return {
        "dovetail": 1,
        "name": "layer",
        "frequency": {"start": 100.0, "stop": 1000.0, "lines": 3},
        "substructures": {"left": {**beam, "place": places[0]}, "right": {**other, "place": places[1]}},
        "joints": {
            "layer": {
                "model": joint.split()[0],
                **options,
                **section,
                "connect": {
                    ports[0]: {
                        "to": "left",
                        "at": [begin + at - (0.02 if joint == "collet" else 0.0) for at in distances],
                    },
                    ports[1]: {"to": "right", "at": list(distances)},
                },
            }
        },
        "response": {"at": "left", "position": 0.0, "direction": across},
    }


def axes_for(along):
    """Return the axes of a joint whose nodes run along an axis of the assembly."""
    return {"x": ACROSS[along[-1]], "y": along[1:] if along[0] == "-" else f"-{along}"}


def problem_of(description):
    with pytest.raises(dovetail.DovetailError) as error:
        dovetail.load(description)
    return error.value.faults[0].problem


@pytest.mark.parametrize("along", ["x", "-x", "y", "z", "-z"])
@pytest.mark.parametrize("joint", LAYERS)
def test_nodes_that_do_not_lie_along_the_axis_of_their_joint_are_refused(joint, along):
    described = layered(joint, along)
    has_no_sense = along == "y" and joint != "collet"
    lies_on_the_faces = along[-1] == "z" and joint == "bolted in space"
    if has_no_sense or lies_on_the_faces:
        dovetail.load(described)
    else:
        problem = problem_of(described)
        assert "of the joint, as in the joint model" in problem or "against the axis" in problem


@pytest.mark.parametrize("along", ["x", "-x", "y", "-y", "z", "-z"])
@pytest.mark.parametrize("joint", LAYERS)
def test_a_joint_that_is_turned_to_its_nodes_is_accepted(joint, along):
    dovetail.load(layered(joint, along, axes=axes_for(along)))


@pytest.mark.parametrize("shift", [{"y": 0.02}, {"y": -160.0}, {"z": 0.01}, {"y": 0.02, "x": 0.01}])
@pytest.mark.parametrize(
    ("joint", "parts"), [*product(LAYERS, ["spatial_beam"]), *product(list(LAYERS)[:3], ["timoshenko_beam"])]
)
def test_facing_nodes_that_are_shifted_along_the_layer_are_refused(joint, parts, shift):
    assert "mm away" in problem_of(layered(joint, parts=parts, shift=shift))


def test_a_collet_is_shorter_than_its_two_layers_by_the_node_that_both_meet():
    """The tool meets c1 to c3, the holder c3 to c5."""
    described = layered("collet", shift={"y": 0.02})  # the holder's nodes at the tool's
    assert "20 mm away from where 'collet' has it, 20 mm further along" in problem_of(described)


def test_a_joint_that_places_the_parts_like_the_collet_next_to_it_is_not_reported():
    described = layered("collet", parts="timoshenko_beam")
    for part in described["substructures"].values():
        del part["place"]
    described["joints"]["stop"] = {
        "model": "spring_damper",
        "connect": {"a": {"to": "left", "at": 0.2}, "b": {"to": "right", "at": 0.02}},
    }
    assert not [text for text in dovetail.find_warnings(dovetail.load(described)) if "away along" in text]


def test_the_axes_of_bars_in_a_lap_may_be_apart_across_its_faces():
    dovetail.load(layered("bolted", shift={"x": 0.01}))
    assert "10 mm away" in problem_of(layered("interference_fit", shift={"x": 0.01}))


@pytest.mark.parametrize("joint", ["interference_fit", "collet"])
def test_a_turned_layer_has_the_frf_of_the_planar_one(joint):
    planar = dovetail.load(layered(joint)).frf()
    turned = dovetail.load(layered(joint, "z", axes=axes_for("z"))).frf()
    np.testing.assert_allclose(turned, planar, rtol=1e-9)


@pytest.mark.parametrize(("along", "warned"), [("z", True), ("-z", True), ("-y", False), ("x", False)])
def test_a_joint_that_holds_the_torsion_of_a_part_but_not_its_bending_is_reported(along, warned):
    description = layered("bolted", along)
    connect = {"a": {"to": "left", "at": 0.2}, "b": {"to": "right", "at": 0.04}}
    description["joints"] = {"layer": {"model": "rigid", "connect": connect}}
    found = "\n".join(dovetail.find_warnings(dovetail.load(description)))
    assert ("the torsion of that part" in found) == warned


@pytest.mark.parametrize(
    ("along", "axes", "warned"),
    [("-y", None, False), ("x", None, True), ([1, 1, 0], None, True), ("x", {"y": "x", "x": "z"}, False)],
)
def test_a_shaft_that_does_not_run_along_the_axis_of_its_bearing_is_reported(along, axes, warned):
    section = {"length": 0.4, "outer": 0.02, "elements": 4}
    material = {"young": 210e9, "density": 7850.0}
    place = {"along": along, "across": "z"}
    shaft = {"model": "spatial_beam", "material": material, "sections": [section], "place": place}
    bearing = {"model": "bearing", "motion": "space", "connect": {"shaft": {"to": "shaft", "at": 0.1}}}
    bearing["connect"]["housing"] = {"to": "base", "at": 0.0}
    description = {
        "dovetail": 1,
        "name": "shaft",
        "frequency": [100.0, 200.0],
        "substructures": {"shaft": shaft, "base": {"model": "ground"}},
        "joints": {"bearing": bearing | ({"axes": axes} if axes else {})},
        "response": {"at": "shaft", "position": 0.4, "direction": "z"},
    }
    found = "\n".join(dovetail.find_warnings(dovetail.load(description)))
    assert ("'shaft' does not run along y of the joint" in found) == warned
