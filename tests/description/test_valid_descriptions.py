"""The assembly that a valid description becomes."""

from __future__ import annotations

import json

import numpy as np
import pytest

from dovetail.description import read_description
from dovetail.errors import DescriptionError


def edited(sound, path, value):
    """Return the sound description as a dict with one value changed."""
    document = json.loads(sound)
    section = document
    for step in path[:-1]:
        section = section.setdefault(step, {})
    section[path[-1]] = value
    return document


@pytest.fixture
def document(read, sound) -> str:
    return read(sound).text


def test_each_value_of_a_file_is_in_its_description(read, sound):
    description = read(sound)
    assert description.name == "test"
    assert description.source == "test.yaml"
    np.testing.assert_array_equal(description.frequency, 100.0 + 2.0 * np.arange(51))
    assert list(description.substructures) == ["tool", "holder"]
    tool = description.substructures["tool"]
    assert tool.config.material.young == 580e9
    assert [node.position for node in tool.nodes] == pytest.approx(np.linspace(0, 0.1, 11))
    joint = description.joints["collet"]
    assert [(port.substructure, port.nodes) for port in joint.connection.attachments] == [
        ("tool", (9, 10)),
        ("holder", (0, 1)),
    ]
    assert [(p.name, p.lower, p.upper, p.scale) for p in joint.parameters] == [
        ("Dc", pytest.approx(0.026), 0.04, "linear"),
        ("mn1", 0.0, 0.2, "linear"),
        ("kr_tc", 2e3, 6e4, "log"),
    ]
    assert joint.fixed == {}
    response = description.response
    assert (response.substructure, response.node, response.direction) == ("tool", 1, "x")
    assert response.quantity == "accelerance"
    identification = description.identification
    assert (identification.samples, identification.seed, identification.test_fraction) == (100, 0, 0.2)
    assert identification.features == "log10p1"
    assert identification.reducer.config.n_components == 5
    assert identification.regressor.name == "mlp"


def test_the_reference_grid_is_exact(document, registry):
    frequency = {"start": "100 Hz", "stop": "9 kHz", "step": 2}
    lines = read_description(edited(document, ["frequency"], frequency), registry).frequency
    assert len(lines) == 4451
    np.testing.assert_array_equal(lines, np.arange(100.0, 9001.0, 2.0))
    assert not lines.flags.writeable


@pytest.mark.parametrize(
    ("section", "count"),
    [
        ({"start": 1, "stop": 600, "step": 1}, 600),
        ({"start": 1, "stop": 600, "lines": 600}, 600),
        ({"start": 0.1, "stop": 100, "step": 0.1}, 1000),
        ({"start": 100, "stop": 9000, "step": 1.5625}, 5697),
        ({"start": 1, "stop": 1_000_000, "step": 1}, 1_000_000),
    ],
)
def test_each_grid_has_its_lines_and_ends(section, count, document, registry):
    lines = read_description(edited(document, ["frequency"], section), registry).frequency
    assert (len(lines), lines[0], lines[-1]) == (count, section["start"], section["stop"])


def test_identification_has_defaults(document, registry):
    described = json.loads(document)
    del described["identification"]
    identification = read_description(described, registry).identification
    assert (identification.samples, identification.seed, identification.test_fraction) == (5000, 0, 0.2)
    assert (identification.reducer.name, identification.regressor.name) == ("umap", "mlp")


@pytest.mark.parametrize("known", [{"value": "80 g"}, "80 g", 0.08, {"value": 0.08}])
def test_a_known_parameter_is_fixed(known, document, registry):
    described = edited(document, ["joints", "collet", "parameters", "mn1"], known)
    assert read_description(described, registry).joints["collet"].fixed == {"mn1": 0.08}


def test_every_parameter_may_be_known(document, registry):
    known = {"Dc": "30 mm", "mn1": 0, "kr_tc": "5e3 N m/rad"}
    joint = read_description(edited(document, ["joints", "collet", "parameters"], known), registry).joints["collet"]
    assert joint.fixed == {"Dc": pytest.approx(0.03), "mn1": 0.0, "kr_tc": 5e3}


def test_a_scale_alone_keeps_the_models_range(document, registry):
    described = edited(document, ["joints", "collet", "parameters", "Dc"], {"scale": "log"})
    parameter = read_description(described, registry).joints["collet"].parameters[0]
    assert (parameter.lower, parameter.upper, parameter.scale) == (0.02, 0.05, "log")


@pytest.mark.parametrize(("position", "accepted"), [(0.0100000005, True), (0.01002, False), ("10.000005 mm", True)])
def test_a_position_may_be_rounded(position, accepted, document, registry):
    described = edited(document, ["response", "position"], position)
    if accepted:
        assert read_description(described, registry).response.node == 1
    else:
        with pytest.raises(DescriptionError, match=r"no node at 10\.02 mm"):
            read_description(described, registry)


def test_joints_to_the_ground_and_without_parameters(document, registry):
    described = json.loads(document)
    described["substructures"]["base"] = {"model": "wall"}
    described["joints"]["floor"] = {
        "model": "weld",
        "connect": {"a": {"to": "base", "at": 0}, "b": {"to": "holder", "at": ["40 mm"]}},
    }
    joint = read_description(described, registry).joints["floor"]
    assert joint.parameters == ()
    assert [port.nodes for port in joint.connection.attachments] == [(0,), (4,)]


def test_a_single_part_needs_no_joint(document, registry):
    described = json.loads(document)
    del described["joints"], described["substructures"]["holder"]
    assert read_description(described, registry).joints == {}


def test_motion_does_not_pass_through_the_ground(document, registry):
    described = json.loads(document)
    described["substructures"]["base"] = {"model": "wall"}
    described["joints"] = {
        name: {"model": "weld", "connect": {"a": {"to": "base", "at": 0}, "b": {"to": name, "at": 0}}}
        for name in ("tool", "holder")
    }
    with pytest.raises(DescriptionError) as caught:
        read_description(described, registry)
    assert str(caught.value) == (
        "<dict>  substructures.holder\n"
        "  no joint connects 'holder' with 'tool', where the response is.\n"
        "  Connect it or remove it."
    )


def test_numbers_are_read_as_in_yaml_1_2(read, sound):
    text = sound.replace("samples: 100", "samples: 1e2\n  seed: 0x10").replace("580 GPa", "5.8e11")
    description = read(text)
    assert (description.identification.samples, description.identification.seed) == (100, 16)
    assert description.substructures["tool"].config.material.young == 5.8e11
    assert read(sound.replace("samples: 100", "samples: 0100")).identification.samples == 100
    assert read(sound.replace("name: test", "name: no")).name == "no"
    assert read(sound.replace("name: test", "name: 2001-01-01")).name == "2001-01-01"


def test_aliases_tags_quotes_and_a_byte_order_mark_are_read(read, sound):
    text = sound.replace("young: 580 GPa", "young: &young !!str 580 GPa").replace("young: 200 GPa", "'young': *young")
    text = text.replace("name: test", 'name: !!str "1"').replace("elements: 4", "elements: !!int 4")
    description = read(b"\xef\xbb\xbf%YAML 1.2\n---\n" + text.encode() + b"...\n")
    assert description.name == "1"
    assert description.substructures["holder"].config.material.young == 580e9


def test_the_text_is_the_whole_description_as_it_was_written(read, sound):
    description = read("extends: base.yaml\nname: other", base=sound)
    document = json.loads(description.text)
    assert list(document) == ["dovetail", "name", "frequency", "substructures", "joints", "response", "identification"]
    assert document["name"] == "other"
    assert document["frequency"] == {"start": "100 Hz", "stop": "200 Hz", "step": "2 Hz"}
    assert document["joints"]["collet"]["parameters"]["kr_tc"]["range"] == ["2e3 N m/rad", "6e4 N m/rad"]


def test_reading_the_text_again_gives_the_same(read, sound, registry):
    first = read(sound)
    again = [read_description(json.loads(first.text), registry), read(first.text)]
    for second in again:
        assert second.text == first.text
        np.testing.assert_array_equal(second.frequency, first.frequency)
        assert second.response == first.response
        assert second.name == first.name
        for name, part in first.substructures.items():
            assert second.substructures[name].config == part.config
        for name, joint in first.joints.items():
            assert second.joints[name].parameters == joint.parameters
            assert second.joints[name].fixed == joint.fixed
            assert second.joints[name].connection.attachments == joint.connection.attachments
        assert second.identification.reducer.config == first.identification.reducer.config
    assert again[0].source == "<dict>"


def test_the_values_of_a_description_cannot_be_changed(read, sound):
    description = read(sound)
    with pytest.raises(TypeError):
        description.substructures["tool"] = None
    with pytest.raises(TypeError):
        description.joints["collet"].fixed["Dc"] = 1.0


def test_numpy_numbers_and_tuples_in_a_dict_are_read(document, registry):
    described = edited(document, ["identification", "samples"], np.int64(50))
    described["joints"]["collet"]["parameters"]["Dc"] = {"range": (np.float32(0.025), np.float64(0.04))}
    description = read_description(described, registry)
    assert description.identification.samples == 50
    assert description.joints["collet"].parameters[0].lower == pytest.approx(0.025)
    assert read_description(json.loads(description.text), registry).text == description.text


def test_the_source_is_not_changed(document, registry):
    described = json.loads(document)
    read_description(described, registry)
    assert described == json.loads(document)
