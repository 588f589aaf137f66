"""Cross-sections of parts that contradict where their joint has them: overlaps, gaps, bores that are too small."""

from __future__ import annotations

import numpy as np
import pytest

import dovetail

pytestmark = pytest.mark.usefixtures("warnings_without_frfs")

STEEL = {"young": 210e9, "density": 7850.0}
RECTANGLE, ROUND = {"height": 0.006, "width": 0.02}, {"outer": 0.02}
LAYER = {"nodes": 3}
AT = {"first": [0.1, 0.12, 0.14], "second": [0.0, 0.02, 0.04]}
PLACE = {"along": "-y", "across": "x"}


def beam(section, origin=0.0, **place):
    bars = [{"length": 0.1, "elements": 5, **section}, {"length": 0.1, "elements": 5, **section}]
    return {
        "model": "spatial_beam",
        "material": STEEL,
        "sections": bars,
        "place": {**PLACE, "origin": [0.0, -origin, 0.0], **place},
    }


def described(joint, first, second, ports=("a", "b")):
    """Two beams along -y of which 40 mm face each other."""
    connect = {ports[0]: {"to": "first", "at": AT["first"]}, ports[1]: {"to": "second", "at": AT["second"]}}
    return {
        "dovetail": 1,
        "name": "two beams",
        "frequency": {"start": 100.0, "stop": 1000.0, "lines": 3},
        "substructures": {"first": beam(first), "second": beam(second, 0.1)},
        "joints": {"joint": {**joint, "connect": connect}},
        "response": {"at": "first", "position": 0.0},
    }


def lap(first, second, **more):
    bars = ({**RECTANGLE, "offset": [f"{mm} mm" for mm in offset]} for offset in (first, second))
    return described({"model": "bolted", "motion": "space", **LAYER, **more}, *bars)


def fault_of(description):
    with pytest.raises(dovetail.DescriptionError) as caught:
        dovetail.load(description)
    (fault,) = caught.value.faults
    assert fault.where.endswith("joints.joint")
    assert fault.remedy
    return fault.problem


def contact_warnings(description):
    return [text for text in dovetail.find_warnings(dovetail.load(description)) if text.startswith("joints.joint: ")]


@pytest.mark.parametrize(
    ("first", "second", "overlap"),
    [
        ((0, 0), (0, 0), "6 mm"),
        ((3, 0), (3, 0), "6 mm"),
        ((-3, 0), (-3, 0), "6 mm"),
        ((-2, 0), (3, 0), "1 mm"),
        ((-3, 0), (0, 0), "3 mm"),
    ],
)
def test_bars_that_overlap_across_the_faces_of_a_lap_are_refused(first, second, overlap):
    for bars in ((first, second), (second, first)):
        problem = fault_of(lap(*bars))
        assert problem.endswith(f"they overlap by {overlap}.")
        assert "'first' reaches from" in problem
        assert "'second' reaches from" in problem


@pytest.mark.parametrize(("first", "second"), [((-3, 0), (3, 0)), ((3, 5), (-3, 0)), ((-3.04, 0), (2.97, 0))])
def test_bars_on_both_sides_of_the_faces_are_accepted_without_a_warning(first, second):
    assert contact_warnings(lap(first, second)) == []


def test_a_lap_whose_joint_is_turned_counts_along_its_own_x():
    turned = {"axes": {"x": "z", "y": "y"}}
    assert "overlap by 20 mm" in fault_of(lap((-3, 0), (3, 0), **turned))
    assert contact_warnings(lap((0, -10), (0, 10), **turned)) == []


def test_a_part_that_is_turned_or_reversed_takes_its_section_along():
    description = lap((-3, 0), (-3, 0))
    description["substructures"]["second"]["place"]["across"] = "-x"
    assert contact_warnings(description) == []
    description["substructures"]["second"]["place"]["across"] = "z"
    assert "overlap by" in fault_of(description)


def test_the_bars_of_a_planar_lap_may_lie_on_one_line():
    section = {"height": 0.006, "width": 0.02}
    assert contact_warnings(described({"model": "bolted", **LAYER}, section, section)) == []


@pytest.mark.parametrize(
    ("first", "second", "said"),
    [
        ((-4, 0), (3, 0), "its nodes do not lie on the faces"),
        ((-3, 0), (9, 0), "its nodes do not lie on the faces"),
        ((0, 0), (6, 0), "its nodes do not lie on the faces"),
        ((-3, 0), (3, 20), "do not meet"),
    ],
)
def test_a_gap_between_faces_is_reported(first, second, said):
    (warning,) = contact_warnings(lap(first, second))
    assert said in warning


def test_an_unknown_height_with_which_bars_overlap_is_reported():
    description = lap((-3, 0), (3, 0))
    for section in description["substructures"]["second"]["sections"]:
        section["height"] = {"range": [0.004, 0.008]}
    (warning,) = [text for text in contact_warnings(description) if "with second.sections.0.height at 8 mm" in text]
    assert "overlap by 1 mm" in warning


FIT = {"model": "interference_fit", "length": 0.04, "nodes": 3}
SPATIAL = {**FIT, "motion": "space", "diameter": 0.02}
COLLET = {"model": "collet", "material": STEEL}
BORED = {"outer": 0.04, "inner": 0.02}
NESTED = {
    "a shaft thicker than the bore": (FIT, {"outer": 0.022}, BORED, "is thicker than the bore of 'second', of 20 mm"),
    "a hub without a bore": (FIT, ROUND, {"outer": 0.04}, "'second' has no bore"),
    "a diameter of the contact that is not that of the shaft": (
        {**SPATIAL, "diameter": 0.03},
        ROUND,
        BORED,
        "a diameter of 30 mm",
    ),
    "a diameter in metres": ({**SPATIAL, "diameter": 20.0}, ROUND, BORED, "a diameter of 20000 mm"),
    "a radius": ({**SPATIAL, "diameter": 0.01}, ROUND, BORED, "a diameter of 10 mm"),
    "a shaft off the axis": (SPATIAL, {**ROUND, "offset": [0.002, 0.0]}, BORED, "is 2 mm away from the nodes"),
    "parts exchanged": (FIT, BORED, ROUND, "'second' has no bore"),
}


@pytest.mark.parametrize("case", NESTED)
def test_a_shaft_that_cannot_lie_in_its_hub_is_reported(case):
    joint, shaft, hub, said = NESTED[case]
    (warning,) = contact_warnings(described(joint, shaft, hub, ("shaft", "hub")))
    assert said in warning


@pytest.mark.parametrize(
    ("joint", "shaft", "hub"),
    [
        (FIT, ROUND, BORED),
        (FIT, {"outer": 0.0201}, BORED),
        (FIT, {"outer": 0.015}, BORED),  # with a sleeve between them
        (FIT, {"outer": 0.03, "outer_end": 0.02}, {"outer": 0.05, "inner": 0.03}),
        (SPATIAL, ROUND, BORED),
        (FIT, RECTANGLE, {"outer": 0.04}),
    ],
)
def test_a_shaft_in_its_hub_is_accepted_without_a_warning(joint, shaft, hub):
    assert contact_warnings(described(joint, shaft, hub, ("shaft", "hub"))) == []


def test_a_tool_thicker_than_the_bore_of_its_holder_is_reported():
    description = described(COLLET, {"outer": 0.03}, BORED, ("tool", "holder"))
    for name, at in (("tool", [0.1, 0.11, 0.12]), ("holder", [0.0, 0.01, 0.02])):
        description["joints"]["joint"]["connect"][name]["at"] = at
    description["substructures"]["first"]["sections"][1]["elements"] = 10
    description["substructures"]["second"]["sections"][0]["elements"] = 10
    description["substructures"]["second"]["place"]["origin"] = [0.0, -0.12, 0.0]  # the last of the tool's nodes
    (warning,) = contact_warnings(description)
    assert "'first', of 30 mm, is thicker than the bore of 'second', of 20 mm" in warning


def test_a_cross_section_of_another_type_is_a_fault_of_its_plugin(monkeypatch):
    monkeypatch.setattr("dovetail_plugins.substructures.spatial_beam.SpatialBeam.section_at", lambda *_: (1.0, 2.0))
    with pytest.raises(dovetail.PluginError, match=r"section_at returns \(1.0, 2.0\)"):
        dovetail.load(lap((-3, 0), (3, 0)))


def test_a_shaft_thicker_than_the_bore_of_its_housing_is_reported():
    bearing = {"model": "bearing", "motion": "space"}
    description = described(bearing, {"outer": 0.03}, BORED, ("shaft", "housing"))
    for name, at in (("shaft", 0.1), ("housing", 0.0)):
        description["joints"]["joint"]["connect"][name]["at"] = at
    (warning,) = contact_warnings(description)
    assert "thicker than the bore of 'second'" in warning
    description["substructures"]["second"] = {"model": "ground"}
    assert contact_warnings(description) == []


@pytest.mark.parametrize(
    ("first", "second", "overlap"),
    [
        (RECTANGLE, RECTANGLE, True),
        ({**RECTANGLE, "offset": [-0.003, 0.0]}, {**RECTANGLE, "offset": [0.003, 0.0]}, False),
        ({**RECTANGLE, "offset": [0.0, -0.01]}, {**RECTANGLE, "offset": [0.0, 0.01]}, False),
        (ROUND, BORED, False),
        (BORED, ROUND, False),
        ({"outer": 0.025}, BORED, True),
    ],
)
def test_parts_that_are_welded_along_a_line_and_overlap_are_reported(first, second, overlap):
    weld = {"model": "rigid", "direction": "all", **LAYER}
    found = contact_warnings(described(weld, first, second))
    assert [("overlap in space" in warning) for warning in found] == [True] * overlap


def test_a_part_without_a_cross_section_is_not_compared():
    description = lap((0, 0), (0, 0))
    nodes = {f"n{number}": [0.0, -0.02 * number, 0.0] for number in range(3)}
    body = {"model": "rigid_body", "mass": 1.0, "inertia": [1e-3] * 3, "nodes": nodes}
    description["substructures"]["second"] = {**body, "place": {"origin": [0.0, -0.1, 0.0]}}
    description["joints"]["joint"]["connect"]["b"]["at"] = list(nodes)
    assert contact_warnings(description) == []
    assert np.isfinite(dovetail.load(description).frf()).all()
