"""Faults of the file, each with its exact message."""

from __future__ import annotations

import pytest

CASES = {
    "format_unknown": (
        {"dovetail: 1": "dovetail: 2"},
        "test.yaml:1:11  dovetail\n  2 is not a format that this version of dovetail reads.\n  Accepted: 1",
    ),
    "format_missing": (
        {"dovetail: 1\n": ""},
        "test.yaml:1:1  dovetail\n  the description does not say which format it has.\n  Begin it with 'dovetail: 1'.",
    ),
    "name_missing": (
        {"name: test\n": ""},
        "test.yaml:1:1  name\n  the description lacks 'name'.\n  Add, for example: name: my-assembly",
    ),
    "name_not_a_text": ({"name: test": "name: 12"}, "test.yaml:2:7  name\n  12 is not a text."),
    "name_with_odd_characters": (
        {"name: test": "name: a/b"},
        "test.yaml:2:7  name\n"
        "  a name has up to 100 letters, digits, spaces and '.+-_', and begins with a letter or digit.",
    ),
    "unknown_section": (
        {"response: {": "responce: {"},
        "test.yaml:23:1  responce\n"
        "  'responce' is not a key of the description.\n"
        "  Did you mean 'response'?  Accepted: dovetail, name, frequency, substructures, joints, "
        "response, responses, calibration, identification, study",
    ),
    "section_missing": (
        {"response: {at: tool, position: 10 mm}\n": ""},
        "test.yaml:1:1  response\n  the description lacks 'response'."
        "\n  Add, for example: response: {at: NAME, position: 0 mm, direction: x, quantity: accelerance}",
    ),
    "section_is_empty": (
        {"  samples: 100\n  reducer: {model: squeeze, n_components: 5}\n  regressor: {model: mlp}\n": ""},
        "test.yaml:24:1  identification\n  an empty value is not a section of keys and values.",
    ),
    "section_is_a_text": (
        {"response: {at: tool, position: 10 mm}": "response: tool"},
        "test.yaml:23:11  response\n  'tool' is not a section of keys and values.",
    ),
    "no_substructures": (
        {
            (
                "substructures:\n"
                "  tool:\n"
                "    model: rod\n"
                "    material: {young: 580 GPa, density: 14450 kg/m^3}\n"
                "    sections: [{length: 100 mm, outer: 10 mm, elements: 10}]\n"
                "  holder:\n"
                "    model: rod\n"
                "    material: {young: 200 GPa, density: 7800 kg/m^3}\n"
                "    sections:\n"
                "      - {length: 40 mm, outer: 50 mm, elements: 4}\n"
            ): "substructures: {}\n"
        },
        "test.yaml:4:1  substructures\n  there are no substructures.",
    ),
    "substructures_is_a_list": (
        {
            (
                "substructures:\n"
                "  tool:\n"
                "    model: rod\n"
                "    material: {young: 580 GPa, density: 14450 kg/m^3}\n"
                "    sections: [{length: 100 mm, outer: 10 mm, elements: 10}]\n"
                "  holder:\n"
                "    model: rod\n"
                "    material: {young: 200 GPa, density: 7800 kg/m^3}\n"
                "    sections:\n"
                "      - {length: 40 mm, outer: 50 mm, elements: 4}\n"
            ): "substructures: [tool]\n"
        },
        "test.yaml:4:1  substructures\n  a list is not a section of keys and values.",
    ),
    "name_too_long": (
        {
            "name: test": (
                "name: "
                "nnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnnn"
            )
        },
        "test.yaml:2:7  name\n"
        "  a name has up to 100 letters, digits, spaces and '.+-_', and begins with a letter or digit.",
    ),
    "joints_is_empty": (
        {
            (
                "joints:\n"
                "  collet:\n"
                "    model: clamp\n"
                "    connect:\n"
                "      tool: {to: tool, at: [90 mm, 100 mm]}\n"
                "      holder: {to: holder, at: [0 mm, 10 mm]}\n"
                "    parameters:\n"
                "      Dc: {range: [26 mm, 40 mm]}\n"
                "      kr_tc: {range: [2e3 N m/rad, 6e4 N m/rad], scale: log}\n"
            ): "joints:\n"
        },
        "test.yaml:14:1  joints\n  an empty value is not a section of keys and values.",
    ),
    "section_of_another_program": (
        {"name: test": "name: test\nunits: SI"},
        "test.yaml:3:1  units\n"
        "  'units' is not a key of the description.\n"
        "  Did you mean 'joints'?  Accepted: dovetail, name, frequency, substructures, joints, "
        "response, responses, calibration, identification, study",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_each_fault_has_its_message(case, message, broken):
    edits, expected = CASES[case]
    assert message(broken(edits)) == expected
