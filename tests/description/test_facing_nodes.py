"""Facing nodes of a joint: wrong orders, senses and spacings are refused, for every joint with several nodes a port."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail.description import description_schema
from dovetail.errors import DescriptionError
from dovetail.registry import components

pytestmark = pytest.mark.usefixtures("warnings_without_frfs")

STEEL = {"young": "200 GPa", "density": "7850 kg/m^3"}
PLUGIN = '''
"""Joints of a stranger: one with elements of its own, one without declarations, and one whose ports do not face."""

import numpy as np

from dovetail import JointModel, JointPort, Parameter, StructuralMatrices, hookimpl


K = (Parameter("k", "N/m", 1e6, 1e9, "log", "stiffness, per node"),)


class Sleeve(JointModel):
    name = "sleeve"
    summary = "a layer whose nodes are 5 and 15 mm apart"
    parameters = K
    ports = (JointPort("a", 3, (0.0, 0.005, 0.020)), JointPort("b", 3, (0.0, 0.005, 0.020)))
    internal_dofs = 2

    def matrices(self, theta):
        joint = StructuralMatrices.zeros(len(theta), self.size)
        joint.add_contact_layer(self.contact_dofs, theta[:, 0])
        joint.add_contact_layer([(0, 12), (1, 13)], theta[:, 0])
        return joint


class Glue(JointModel):
    name = "glue"
    summary = "a layer of four nodes that declares nothing"
    parameters = K
    ports = (JointPort("a", 4), JointPort("b", 4))

    def matrices(self, theta):
        joint = StructuralMatrices.zeros(len(theta), self.size)
        joint.add_contact_layer(self.contact_dofs, theta[:, 0])
        return joint


class Truss(Glue):
    name = "truss"
    summary = "bars from four nodes to four others that do not face them"
    facing_ports = ()


@hookimpl
def dovetail_components():
    return [Sleeve, Glue, Truss]
'''
NODES = {
    "collet": ({"model": "collet", "material": STEEL}, ("tool", "holder"), (0, 10, 20)),
    "fine collet": (
        {"model": "collet", "material": STEEL, "segment": "5 mm", "elements_per_segment": 2},
        ("tool", "holder"),
        (0, 5, 10),
    ),
    "bolted": ({"model": "bolted", "nodes": 5}, ("a", "b"), (0, 10, 20, 30, 40)),
    "bolt with mass": ({"model": "bolted", "bolt_mass": True}, ("a", "b"), (0, 20, 40)),
    "interference_fit": (
        {"model": "interference_fit", "length": "40 mm", "nodes": 5},
        ("shaft", "hub"),
        (0, 10, 20, 30, 40),
    ),
    "linear pressure": (
        {"model": "interference_fit", "length": "40 mm", "pressure": "linear"},
        ("shaft", "hub"),
        (0, 20, 40),
    ),
    "spring_damper": ({"model": "spring_damper", "nodes": 4}, ("a", "b"), (0, 15, 30, 45)),
    "springs in x": ({"model": "spring_damper", "nodes": 3, "direction": "x"}, ("a", "b"), (0, 20, 40)),
    "springs in rz": ({"model": "spring_damper", "nodes": 3, "direction": "rz"}, ("a", "b"), (0, 20, 40)),
    "rigid": ({"model": "rigid", "nodes": 3}, ("a", "b"), (0, 10, 20)),
    "hinges": ({"model": "rigid", "nodes": 3, "direction": "x"}, ("a", "b"), (0, 10, 20)),
    "sleeve of a plugin": ({"model": "sleeve"}, ("a", "b"), (0, 5, 20)),
    "glue of a plugin": ({"model": "glue"}, ("a", "b"), (0, 10, 20, 30)),
}
"""Joints with several nodes a port: their section, their ports, and the sound distances of nodes [mm]."""


def unsorted(at):
    return [at[0], at[2], at[1], *at[3:]]


WRONG = {
    "reversed": lambda at: at[::-1],
    "unsorted": unsorted,
    "unsorted from the end": lambda at: unsorted(at[::-1]),
    "first and last exchanged": lambda at: [at[-1], *at[1:-1], at[0]] if len(at) > 3 else unsorted(at),
    "unequal": lambda at: [at[0], at[1] + 5, *at[2:]] if at[2] - at[1] > 5 else [at[0], at[1], at[2] + 5, *at[3:]],
    "too close": lambda at: [at[0] + (place - at[0]) / 2 for place in at],
    "too far": lambda at: [at[0] + 2 * (place - at[0]) for place in at],
    "last too far": lambda at: [*at[:-1], at[-1] + 5],
}


@pytest.fixture(scope="module")
def plugin(tmp_path_factory) -> Path:
    file = tmp_path_factory.mktemp("plugin") / "stranger.py"
    file.write_text(PLUGIN)
    return file


def beam(**orientation) -> dict:
    """A bar of 200 mm with a node each 2.5 mm."""
    section = {"length": "200 mm", "outer": "20 mm", "elements": 80}
    return {"model": "timoshenko_beam", "material": STEEL, "sections": [section], **orientation}


def joined(joint, first, second, parts=None):
    """Two bars and a joint at positions [mm] of both."""
    section, ports, _ = NODES[joint] if isinstance(joint, str) else joint
    parts = parts or {"left": beam(), "right": beam()}
    connect = {
        port: {"to": part, "at": [f"{place} mm" if isinstance(place, (int, float)) else place for place in at]}
        for port, part, at in zip(ports, parts, (first, second), strict=True)
    }
    return {
        "dovetail": 1,
        "name": "facing",
        "frequency": {"start": 100.0, "stop": 1000.0, "lines": 3},
        "substructures": parts,
        "joints": {"joint": {**section, "connect": connect}},
        "response": {"at": "left", "position": "0 mm"},
    }


def at_ends(joint):
    """Positions at the end of the left bar and at the start of the right one."""
    distances = NODES[joint][2]
    return [200 - distances[-1] + place for place in distances], list(distances)


@pytest.mark.parametrize("joint", NODES)
def test_nodes_at_the_same_places_are_accepted(joint, plugin):
    assert dovetail.load(joined(joint, *at_ends(joint)), plugins=[plugin]).frf().shape == (3,)


@pytest.mark.sweep
@pytest.mark.parametrize("side", [0, 1], ids=["first port", "second port"])
@pytest.mark.parametrize("fault", WRONG)
@pytest.mark.parametrize("joint", NODES)
def test_wrong_nodes_are_refused_with_both_positions(joint, fault, side, plugin):
    places = at_ends(joint)
    shifted = [100 + place for place in NODES[joint][2]]  # with room on both sides
    wrong = WRONG[fault](shifted)
    assert wrong != shifted
    places = (wrong, places[1]) if side == 0 else (places[0], wrong)
    with pytest.raises(DescriptionError) as raised:
        dovetail.load(joined(joint, *places), plugins=[plugin])
    (error,) = raised.value.faults
    assert "joints.joint.connect" in error.where
    assert sum(f"{place:g} mm" in error.problem for place in {*wrong}) >= 2, error.problem
    assert error.remedy


@pytest.mark.parametrize(
    "joint", [name for name, (section, _, _) in NODES.items() if section["model"] not in ("collet", "sleeve")]
)
def test_both_ports_may_run_against_the_axis_of_a_joint_without_nodes_of_its_own(joint, plugin):
    left, right = at_ends(joint)
    assert dovetail.load(joined(joint, left[::-1], right[::-1]), plugins=[plugin]).frf().shape == (3,)


@pytest.mark.parametrize("joint", ["collet", "fine collet", "sleeve of a plugin"])
def test_both_ports_against_the_axis_of_a_joint_with_nodes_of_its_own_are_refused(joint, plugin):
    left, right = at_ends(joint)
    with pytest.raises(DescriptionError, match="against the axis of the joint model"):
        dovetail.load(joined(joint, left[::-1], right[::-1]), plugins=[plugin])


@pytest.mark.parametrize("joint", NODES)
def test_a_reversed_part_has_its_nodes_in_decreasing_positions(joint, plugin):
    left, distances = at_ends(joint)
    parts = {"left": beam(), "right": beam(reversed=True)}
    from_its_end = [200 - place for place in distances]
    dovetail.load(joined(joint, left, from_its_end, parts), plugins=[plugin])
    with pytest.raises(DescriptionError, match="'right' is reversed"):
        dovetail.load(joined(joint, left, from_its_end[::-1], parts), plugins=[plugin])


@pytest.mark.parametrize("joint", NODES)
def test_nodes_that_are_named_by_labels_are_compared_too(joint, plugin):
    left, right = at_ends(joint)
    labels = [f"node n{place * 2 // 5 + 1}" for place in right]
    dovetail.load(joined(joint, left, labels), plugins=[plugin])
    with pytest.raises(DescriptionError, match=r"the other way|against the axis"):
        dovetail.load(joined(joint, left, labels[::-1]), plugins=[plugin])


def test_ports_of_a_plugin_that_do_not_face_each_other_take_any_nodes(plugin):
    truss = {"model": "truss"}, ("a", "b"), ()
    description = joined(truss, [160, 0, 40, 45], [0, 200, 10, 5])
    assert dovetail.load(description, plugins=[plugin]).frf().shape == (3,)


def test_positions_rounded_to_three_digits_are_accepted():
    """The third node of the right bar is 0.01 mm off, as in a table of rounded numbers."""
    right = beam()
    sections = [{"length": "20 mm", "outer": "20 mm", "elements": 2}, {"length": "9.99 mm", "outer": "20 mm"}]
    right["sections"] = [*sections, {"length": "170.01 mm", "outer": "20 mm", "elements": 10}]
    joint = {"model": "bolted", "nodes": 3}, ("a", "b"), ()
    parts = {"left": beam(), "right": right}
    assert dovetail.load(joined(joint, [170, 180, 200], [0, 10, 29.99], parts)).frf().shape == (3,)


def test_the_ground_may_be_given_as_one_point_for_all_nodes():
    joint = {"model": "spring_damper", "nodes": 3}, ("a", "b"), ()
    parts = {"left": beam(), "base": {"model": "ground"}}
    assert dovetail.load(joined(joint, [0, 90, 200], [0, 0, 0], parts)).frf().shape == (3,)
    with pytest.raises(DescriptionError, match="90 mm comes after 200 mm"):
        dovetail.load(joined(joint, [0, 200, 90], [0, 0, 0], parts))


def test_the_remedy_names_the_key_for_a_part_that_is_described_from_its_other_end():
    left, right = at_ends("bolted")
    with pytest.raises(DescriptionError, match="If 'right' is described from its other end, write 'reversed: true'"):
        dovetail.load(joined("bolted", left, right[::-1]))


def test_a_wrong_length_is_reported_once():
    section = {"model": "interference_fit", "length": "10 mm"}, ("shaft", "hub"), ()
    with pytest.raises(DescriptionError) as raised:
        dovetail.load(joined(section, [160, 180, 200], [0, 20, 40]))
    (error,) = raised.value.faults
    assert "at 200 mm is 40 mm from the first one, at 160 mm" in error.problem
    assert "it is 10 mm from it" in error.problem


@pytest.mark.parametrize("value", ["yes please", 1, "true", {"range": [0, 1]}, None])
def test_reversed_is_true_or_false(value):
    left, right = at_ends("bolted")
    parts = {"left": beam(), "right": beam(reversed=value)}
    with pytest.raises(DescriptionError) as raised:
        dovetail.load(joined("bolted", left, right, parts))
    (error,) = raised.value.faults
    assert "substructures.right.reversed" in error.where


def warnings(description) -> str:
    return "\n".join(dovetail.find_warnings(dovetail.load(description)))


WELD = {"model": "rigid"}, ("a", "b"), ()


@pytest.mark.parametrize(
    ("joint", "left", "right", "warned"),
    [
        (WELD, [200], [0], False),
        (WELD, [200], [200], True),
        (WELD, [0], [0], True),
        (WELD, [100], [100], False),
        (WELD, [200], [100], False),
        ("bolted", [160, 170, 180, 190, 200], [160, 170, 180, 190, 200], True),
        ("collet", [180, 190, 200], [180, 190, 200], True),
        (({"model": "spring_damper", "direction": "x"}, ("a", "b"), ()), [200], [200], False),
        (({"model": "spring_damper"}, ("a", "b"), ()), [200], [200], True),
    ],
)
def test_parts_that_extend_to_the_same_side_of_their_joint_are_reported(joint, left, right, warned):
    assert ("extend from it to the same side" in warnings(joined(joint, left, right))) == warned


def test_a_reversed_part_extends_to_the_other_side():
    parts = {"left": beam(), "right": beam(reversed=True)}
    assert "same side" not in warnings(joined(WELD, [200], [200], parts))
    assert "same side" in warnings(joined(WELD, [200], [0], parts))


def test_two_joints_that_place_a_part_differently_are_reported():
    description = joined(WELD, [100], [0])
    spring = {"model": "spring_damper", "direction": "x"}
    for place, warned in ((50, False), (60, True)):
        connect = {"a": {"to": "left", "at": "150 mm"}, "b": {"to": "right", "at": f"{place} mm"}}
        joints = {**description["joints"], "spring": {**spring, "connect": connect}}
        assert ("10 mm away along 'left'" in warnings({**description, "joints": joints})) == warned


@pytest.mark.parametrize("reverse", [False, True])
def test_an_unknown_length_that_separates_facing_nodes_is_reported(reverse):
    outside = {"length": {"range": ["150 mm", "170 mm"]}, "outer": "20 mm", "elements": 8}
    inside = {"length": "40 mm", "outer": "20 mm", "elements": 4}
    unknown = {**inside, "length": {"range": ["38 mm", "42 mm"]}}
    labels = [f"n{node}" for node in ((5, 4, 3, 2, 1) if reverse else (9, 10, 11, 12, 13))]
    for lap, warned in ((inside, False), (unknown, True)):
        left = beam(reversed=reverse)
        left["sections"] = [lap, outside] if reverse else [outside, lap]
        description = joined("bolted", labels, [0, 10, 20, 30, 40], {"left": left, "right": beam()})
        description["response"]["position"] = "n1"
        found = warnings(description)
        assert ("a section of its own that is known" in found) == warned, found
        assert ("left.sections." in found) == warned


def test_tied_lengths_of_both_sides_move_together():
    unknown = {"length": {"range": ["38 mm", "42 mm"]}, "outer": "20 mm", "elements": 4}
    tied = {**unknown, "length": {"same_as": "left.sections.1.length"}}
    outside = {"length": "160 mm", "outer": "20 mm", "elements": 8}
    left, right = beam(), beam()
    left["sections"], right["sections"] = [outside, unknown], [tied, outside]
    labels = [f"n{node}" for node in range(1, 14)]
    assert "a section of its own" not in warnings(
        joined("bolted", labels[8:], labels[:5], {"left": left, "right": right})
    )


@pytest.mark.parametrize(
    "positions", [(0.0,), (0.0, 0.0), (0.02, 0.0), (0.0, float("nan")), [0.0, 0.1], (0.0, "1"), (False, True), 0.1]
)
def test_positions_of_a_port_are_increasing_numbers_one_for_each_node(positions):
    with pytest.raises(dovetail.PluginError, match="its positions are"):
        dovetail.JointPort("a", 2, positions)


@pytest.mark.parametrize(
    "pairs", ["(('a', 'c'),)", "(('a',),)", "(('a', 'a'),)", "'ab'", "None", "((1, 2),)", "1 / 0", "(('a', 'single'),)"]
)
def test_facing_ports_that_a_plugin_does_not_have_are_its_fault(pairs, tmp_path):
    text = PLUGIN.replace(
        "    facing_ports = ()", f"    @property\n    def facing_ports(self):\n        return {pairs}"
    )
    text = text.replace("[Sleeve, Glue, Truss]", "[Truss]")
    (tmp_path / "wrong.py").write_text(text)
    truss = {"model": "truss"}, ("a", "b"), ()
    with pytest.raises(DescriptionError, match="facing_ports") as raised:
        dovetail.load(joined(truss, [0, 10, 20, 30], [0, 10, 20, 30]), plugins=[tmp_path / "wrong.py"])
    assert "wrong.py" in str(raised.value)


ASSEMBLIES = Path(__file__).resolve().parents[2] / "assemblies"
TURNED = """
substructures:
  right:
    {key}sections:
      - {{length: 110 mm, width: 40 mm, height: 8 mm, elements: 22}}
      - {{length: 40 mm, width: 40 mm, height: 8 mm, elements: 8}}
joints: {{lap: {{connect: {{b: {{to: right, at: [150 mm, 140 mm, 130 mm, 120 mm, 110 mm]}}}}}}}}
"""


def extended(tmp_path, base, text):
    file = tmp_path / "over.yaml"
    file.write_text(f"extends: {ASSEMBLIES / base}\n{text}")
    return dovetail.load(file)


def test_the_shipped_lap_with_a_bar_from_its_other_end_is_refused_or_the_same_when_reversed(tmp_path):
    with pytest.raises(
        DescriptionError, match="run from 150 mm to 110 mm, and those of 'left' that they face from 150 mm"
    ):
        extended(tmp_path, "bolted_lap_beam.yaml", TURNED.format(key=""))
    reversed_bar = extended(tmp_path, "bolted_lap_beam.yaml", TURNED.format(key="reversed: true\n    "))
    shipped = dovetail.load(ASSEMBLIES / "bolted_lap_beam.yaml")
    np.testing.assert_allclose(reversed_bar.frf(), shipped.frf(), rtol=1e-9)
    np.testing.assert_allclose(reversed_bar.natural_frequencies(count=2), [448.1, 1247.8], rtol=1e-4)


@pytest.mark.parametrize(
    ("base", "text", "said"),
    [
        ("shaft_hub.yaml", "joints: {fit: {length: 10 mm}}", "is 40 mm from the first one"),
        (
            "bt40_er32.yaml",
            "joints: {collet: {connect: {tool: {at: [100 mm, 90 mm, 80 mm]}}}}",
            "run from 100 mm to 80 mm, against the axis of the joint model 'collet', on which they lie from 0",
        ),
        (
            "bolted_lap_beam.yaml",
            "joints: {lap: {connect: {b: {at: [0 mm, 20 mm, 10 mm, 30 mm, 40 mm]}}}}",
            "10 mm comes after 20 mm",
        ),
        (
            "bolted_lap_beam.yaml",
            "joints: {lap: {connect: {b: {at: [0 mm, 5 mm, 10 mm, 15 mm, 20 mm]}}}}",
            "at 20 mm is 20 mm from the first one, at 0 mm; the node of 'left' that it faces, at 190 mm, is 40 mm",
        ),
    ],
)
def test_wrong_nodes_of_shipped_assemblies_are_refused(base, text, said, tmp_path):
    with pytest.raises(DescriptionError) as raised:
        extended(tmp_path, base, text)
    assert said in raised.value.faults[0].problem


def test_an_editor_knows_the_key_reversed():
    import jsonschema

    validator = jsonschema.Draft202012Validator(description_schema(components(())))
    left, right = at_ends("bolted")
    for value, sound in ((True, True), (False, True), (1, False), ("yes", False)):
        description = joined("bolted", left, right, {"left": beam(), "right": beam(reversed=value)})
        assert validator.is_valid(description) == sound


@pytest.mark.parametrize("positions", [False, True])
def test_nodes_without_positions_are_not_compared_but_reported(positions, tmp_path):
    part = dovetail.load(joined(WELD, [200], [0])).description.substructures["right"]
    matrices, labels = part.matrices(), [node.label for node in part.nodes for _ in "xr"]
    table = {"nodes": labels, "directions": ["x", "rz"] * len(part.nodes)}
    if positions:
        table["positions"] = [node.position for node in part.nodes for _ in "xr"]
    np.savez(tmp_path / "part.npz", M=matrices.M, K=matrices.K, **table)
    parts = {"left": beam(), "right": {"model": "matrices", "file": str(tmp_path / "part.npz")}}
    right = ["node n1", "node n5", "node n9"]
    description = joined("rigid", [180, 190, 200], right, parts)
    said = "joints.joint: the nodes of 'right' have no positions that differ"
    assert (said in warnings(description)) == (not positions)
    wrong = joined("rigid", [180, 190, 200], right[::-1], parts)
    if positions:
        with pytest.raises(DescriptionError, match="the other way"):
            dovetail.load(wrong)
    else:
        assert said in warnings(wrong)
    single = joined(WELD, [200], right[:1], parts)
    assert said not in warnings(single)
