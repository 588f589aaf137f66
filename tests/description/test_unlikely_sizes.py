"""Sizes in space that contradict each other or that nothing has, as numbers in other units than SI do."""

from __future__ import annotations

from copy import deepcopy
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import dovetail

STEEL = {"young": 210e9, "density": 7850.0}
ARM = {"length": 0.25, "width": 0.04, "height": 0.02, "elements": 10}
CAMERA = {
    "model": "rigid_body",
    "mass": 0.4,
    "inertia": [3e-4, 2e-4, 3e-4],
    "center": [0.0, 0.0, 0.04],
    "nodes": {"foot": [0.0, 0.0, 0.0], "top": [0.0, 0.0, 0.08]},
    "place": {"origin": [0.0, -0.25, 0.0]},
}
WHOLE = {
    "dovetail": 1,
    "name": "camera",
    "frequency": {"start": 50.0, "stop": 1000.0, "lines": 20},
    "substructures": {
        "arm": {"model": "spatial_beam", "material": STEEL, "sections": [ARM], "place": {}},
        "camera": CAMERA,
        "wall": {"model": "ground"},
    },
    "joints": {
        "foot": {
            "model": "bushing",
            "connect": {"a": {"to": "arm", "at": 0.0}, "b": {"to": "wall", "at": 0.0}},
        },
        "screw": {
            "model": "rigid",
            "direction": "all",
            "connect": {"a": {"to": "arm", "at": 0.25}, "b": {"to": "camera", "at": "foot"}},
        },
    },
    "response": {"at": "camera", "position": "top", "direction": "x"},
}


def changed(path, value):
    whole = deepcopy(WHOLE)
    *steps, last = path
    place = whole
    for step in steps:
        place = place[step]
    place[last] = value
    return whole


def warnings(description):
    return list(dovetail.find_warnings(dovetail.load(description)))


def test_a_sound_description_has_none():
    assert warnings(WHOLE) == []


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("inertia", [300.0, 200.0, 300.0]),  # kg mm^2
        ("inertia", ["3e-4 kg mm^2", "2e-4 kg mm^2", "3e-4 kg mm^2"]),
        ("mass", 400.0),  # g
        ("center", [0.0, 0.0, 4.0]),
        ("nodes", {"foot": [0.0, 0.0, 0.0], "top": [0.0, 0.0, 8.0]}),
    ],
)
def test_a_mass_and_moments_that_do_not_belong_to_the_size_of_a_body_are_reported(key, value):
    (warning,) = warnings(changed(("substructures", "camera", key), value))
    assert warning.startswith("substructures.camera: its mass of")
    assert "Are the units right?" in warning


@pytest.mark.parametrize("inertia", [[0.0, 0.0, 0.0], [3e-3, 3e-3, 3e-3], [3e-6, 3e-6, 3e-6]])
def test_a_mass_at_a_point_and_one_far_from_its_nodes_are_accepted(inertia):
    assert warnings(changed(("substructures", "camera", "inertia"), inertia)) == []


def test_a_body_with_one_node_has_a_size_that_bodies_have():
    whole = changed(("substructures", "camera", "nodes"), {"foot": [0.0, 0.0, 0.0]})
    whole["substructures"]["camera"]["center"] = [0.0, 0.0, 0.0]
    whole["response"]["position"] = "foot"
    assert warnings(whole) == []
    whole["substructures"]["camera"]["inertia"] = [300.0, 200.0, 300.0]
    (warning,) = warnings(whole)
    assert "a radius of 27.4 m" in warning


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("height", 20.0, "sections.0.height is 20 m, and the whole beam 0.25 m long. Were 20 mm meant?"),
        ("width", 6.0, "sections.0.width is 6 m"),
        ("offset", [0.0, -5.0], "sections.0.offset is 5 m, and the section 0.04 m wide. Were 5 mm meant?"),
    ],
)
def test_a_section_out_of_proportion_is_reported(key, value, said):
    found = warnings(changed(("substructures", "arm", "sections", 0, key), value))
    assert [text for text in found if said in text]


def test_a_disc_is_not_out_of_proportion():
    disc = {"length": 0.02, "outer": 0.3}
    beam = {"model": "timoshenko_beam", "material": STEEL, "sections": [disc]}
    description = {
        "dovetail": 1,
        "name": "disc",
        "frequency": [100.0, 200.0],
        "substructures": {"disc": beam},
        "joints": {},
        "response": {"at": "disc", "position": 0.0},
    }
    assert warnings(description) == []


def test_a_place_that_is_far_away_is_reported():
    whole = changed(("substructures", "camera", "place", "origin"), [0.0, -250.0, 0.0])
    whole["joints"]["screw"]["model"] = "rigid_link"
    del whole["joints"]["screw"]["direction"]
    assert "substructures.camera.place.origin: -250 m is not within" in "\n".join(warnings(whole))


def test_options_and_values_of_joints_are_looked_at_as_those_of_parts():
    beam = {"model": "timoshenko_beam", "material": STEEL}
    tool = [{"length": 0.1, "outer": 0.01, "elements": 10}]
    holder = [{"length": 0.1, "outer": 0.05, "inner": 0.03, "elements": 10}]
    ends = {"tool": {"to": "tool", "at": [0.08, 0.09, 0.1]}, "holder": {"to": "holder", "at": [0.0, 0.01, 0.02]}}
    collet = {
        "model": "collet",
        "material": {"young": 200.0, "density": 7850.0},
        "connect": ends,
        "parameters": {"Dc": {"value": 30.0}, "dc": {"range": [10.0, 18.0]}},
    }
    description = {
        "dovetail": 1,
        "name": "collet",
        "frequency": {"start": 100.0, "stop": 1000.0, "lines": 5},
        "substructures": {"tool": {**beam, "sections": tool}, "holder": {**beam, "sections": holder}},
        "joints": {"collet": collet},
        "response": {"at": "tool", "position": 0.0},
    }
    found = "\n".join(warnings(description))
    assert "joints.collet.material.young: 200 Pa is not within 1e+06 to 1.3e+12 Pa. Was 200 GPa or 200 MPa" in found
    assert "joints.collet.parameters.Dc: 30 m is not within 1e-06 to 20 m. Was 30 mm meant?" in found


@pytest.mark.parametrize("turn", [{"about": "z", "angle": 90}, {"about": "z", "angle": "-400 deg"}])
def test_an_angle_of_more_than_a_turn_is_refused(turn):
    """It is in degrees: 90 rad are 117 degrees and 14 turns."""
    for path in (("substructures", "camera", "place"), ("joints", "foot", "axes")):
        with pytest.raises(dovetail.DescriptionError, match="is more than a whole turn") as caught:
            dovetail.load(changed(path, {"rotate": [turn]}))
        (fault,) = caught.value.faults
        assert "rotate[0].angle" in fault.where


@pytest.mark.parametrize("angle", ["360 deg", -2.0 * np.pi, 6.28, "0 deg"])
def test_an_angle_up_to_a_turn_is_accepted(angle):
    dovetail.load(changed(("joints", "foot", "axes"), {"rotate": [{"about": "z", "angle": angle}]}))


def test_digits_of_an_frf_that_is_zero_are_not_counted():
    """The plane of y and z is one of symmetry, so that a moment about y does not move the camera along z."""
    whole = changed(("response", "direction"), "z")
    whole["response"]["force"] = {"position": "foot", "direction": "ry"}
    assert (dovetail.load(whole).frf(dovetail.load(whole).from_unit(np.full(12, 0.5))) == 0.0).all()
    assert warnings(whole) == []


def test_an_frf_that_is_zero_is_not_identified():
    """Its fit once ended with 'the value of line 1 is not finite'."""
    described = dovetail.load(WHOLE)
    middle = described.from_unit(np.full(12, 0.5))
    measured = described.simulate(middle)
    whole = changed(("response", "direction"), "z")
    whole["response"]["force"] = {"position": "foot", "direction": "ry"}
    with pytest.raises(dovetail.ParameterError, match="the model's FRF at camera, node top, z"):
        dovetail.identify(dovetail.load(whole), measured, "refined")


def _turned(turn):
    """Return a whole turned at random whose force does not move the point of its response, and another that does."""
    rotation = Rotation.random(random_state=turn)
    steps = [{"about": rotation.as_rotvec().tolist(), "angle": rotation.magnitude()}]
    across, along = (rotation.apply(axis).tolist() for axis in ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]))
    whole = deepcopy(WHOLE)
    whole["substructures"]["arm"]["place"] = {"rotate": steps}
    whole["substructures"]["camera"]["place"] = {"rotate": steps, "origin": rotation.apply([0.0, -0.25, 0.0]).tolist()}
    whole["joints"]["foot"]["axes"] = {"rotate": steps}
    whole["response"] |= {"direction": along, "force": {"position": "foot", "direction": across}}
    other = deepcopy(whole)
    other["response"]["force"]["direction"] = along
    return whole, other


@pytest.mark.parametrize("turn", range(6))
def test_an_frf_that_is_zero_but_for_rounding_is_not_identified(turn):
    """By symmetry it is 1e-16 of others, and only in a structure along the axes exactly zero."""
    whole, other = map(dovetail.load, _turned(turn))
    theta = whole.from_unit(np.full(12, 0.5))
    share = np.abs(whole.frf(theta) / other.frf(theta))
    assert np.all(share > 0.0)
    assert np.median(share) < 1e-10
    with pytest.raises(dovetail.ParameterError, match="the force does not move this point so"):
        dovetail.identify(whole, whole.simulate(theta), "refined")


def test_an_frf_that_is_small_but_not_by_rounding_is_identified():
    """A point behind two soft mounts moves a millionth as much as that of the force."""
    soft = {"model": "spring_damper", "parameters": {"c": {"value": 0.0}, "kr": {"value": 1.0}, "cr": {"value": 0.0}}}
    names = ["first", "second", "third"]
    whole = {
        "dovetail": 1,
        "name": "mounts",
        "frequency": {"start": "500 Hz", "stop": "1000 Hz", "lines": 20},
        "substructures": {
            name: {"model": "lumped", "masses": [{"mass": "10 kg", "inertia": "1 kg m^2"}]} for name in names
        },
        "joints": {
            f"mount_{number}": soft
            | {
                "parameters": soft["parameters"] | {"k": {"range": ["1e4 N/m", "1e6 N/m"], "scale": "log"}},
                "connect": {"a": {"to": one, "at": "0 mm"}, "b": {"to": other, "at": "0 mm"}},
            }
            for number, (one, other) in enumerate(pairwise(names))
        },
        "response": {"at": "third", "position": "0 mm", "force": {"at": "first", "position": "0 mm"}},
    }
    assembly = dovetail.load(whole)
    middle = assembly.simulate(assembly.from_unit(np.full(2, 0.5)))
    assert dovetail.identify(assembly, middle, "refined", seconds=5.0).fit is not None
