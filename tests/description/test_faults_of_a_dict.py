"""Faults of a description given as a dict: a path in place of a position."""

from __future__ import annotations

import json

import pytest

from dovetail.description import read_description
from dovetail.errors import DescriptionError


@pytest.fixture
def document(read, sound) -> dict:
    return json.loads(read(sound).text)


@pytest.fixture
def faults(registry):
    def message_of(document: dict) -> str:
        with pytest.raises(DescriptionError) as caught:
            read_description(document, registry)
        return str(caught.value)

    return message_of


def test_faults_are_listed_by_path_in_the_order_of_the_dict(document, faults):
    document["response"]["position"] = "10 kg"
    document["frequency"]["stopp"] = 1
    document["substructures"]["holder"]["sections"][0]["outer"] = 0
    assert faults(document) == (
        "<dict>  frequency.stopp\n"
        "  'stopp' is not a key of 'frequency'.\n"
        "  Did you mean 'stop'?  Accepted: start [Hz], stop [Hz], step [Hz], lines, bands [Hz], without [Hz]\n"
        "<dict>  substructures.holder.sections[0].outer\n"
        "  0 must be greater than 0.\n"
        "<dict>  response.position\n"
        "  '10 kg' is not in m, or in a unit that can be converted to it."
    )


def test_an_empty_dict_lacks_format_and_name(faults):
    assert faults({}) == (
        "<dict>  dovetail\n"
        "  the description does not say which format it has.\n"
        "  Begin it with 'dovetail: 1'.\n"
        "<dict>  name\n  the description lacks 'name'.\n  Add, for example: name: my-assembly\n"
        "<dict>  frequency\n  the description lacks 'frequency'.\n"
        "  Add, for example: frequency: {start: 100 Hz, stop: 5000 Hz, step: 2 Hz}\n"
        "<dict>  substructures\n  the description lacks 'substructures'.\n"
        "  Add, for example: substructures: {NAME: {model: MODEL, ...}, NAME: {model: MODEL, ...}}\n"
        "<dict>  response\n  the description lacks 'response'."
        "\n  Add, for example: response: {at: NAME, position: 0 mm, direction: x, quantity: accelerance}"
    )


@pytest.mark.parametrize(
    ("value", "found"),
    [
        (object(), "an object of the type 'object' is not allowed in a description.\n"
                   "  Accepted: a dict, a list, a text, a number, true or false"),
        (1j, "an object of the type 'complex' is not allowed in a description.\n"
             "  Accepted: a dict, a list, a text, a number, true or false"),
        (float("nan"), "nan is not a finite number."),
        (10**400, "this is too large a whole number."),
        ("a\x1b[2Jb", "the character U+001B is not allowed in a description."),
        ("\ud800", "the character U+D800 is not allowed in a description."),
    ],
)  # fmt: skip
def test_values_that_yaml_cannot_hold_are_refused(value, found, document, faults):
    document["name"] = value
    assert faults(document) == f"<dict>  name\n  {found}"


def test_keys_that_are_not_strings_are_refused(document, faults):
    document["joints"]["collet"]["parameters"][5] = 1
    document["joints"]["collet"]["parameters"]["a\x07"] = 1
    assert faults(document) == (
        "<dict>  joints.collet.parameters\n  the key is 5.\n  Accepted: a text\n"
        "<dict>  joints.collet.parameters\n  a key contains the character U+0007."
    )


def test_a_dict_inside_itself_is_refused(document, faults):
    document["joints"]["collet"]["parameters"] = document
    assert faults(document).endswith("joints.collet.parameters\n  the description has more than 32 levels.")


def test_a_dict_of_too_many_values_is_refused(document, faults):
    laugh = ["ha"]
    for _ in range(20):
        laugh = [laugh] * 10
    document["name"] = laugh
    assert faults(document) == "<dict>  name[0][0]\n  the description has more than 50000 values."
