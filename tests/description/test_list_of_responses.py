"""`responses`: a list of the form of `response`."""

from __future__ import annotations

import json

import pytest

import dovetail
from dovetail.description import read_description

ONE = "response: {at: tool, position: 10 mm}\n"
SEVERAL = """\
responses:
  - {at: tool, position: 10 mm}
  - {at: holder, position: 40 mm, quantity: receptance}
"""


@pytest.fixture
def several(sound) -> str:
    return sound.replace(ONE, SEVERAL)


def test_the_order_is_kept_and_the_first_is_the_main_one(read, several):
    description = read(several)
    assert [(one.substructure, one.node, one.quantity) for one in description.responses] == [
        ("tool", 1, "accelerance"),
        ("holder", 4, "receptance"),
    ]
    assert description.response == description.responses[0]
    assert description.response_labels == ("tool, 10 mm", "holder, 40 mm")


def test_the_text_reads_back_the_same(read, several, registry):
    description = read(several)
    again = read_description(json.loads(description.text), registry)
    assert again.responses == description.responses
    assert again.text == description.text
    assert again.fingerprint == description.fingerprint


def test_a_description_of_one_response_of_several_equals_that_with_this_response(read, several, sound, registry):
    alone = read(several).at(1)
    assert alone.responses == (read(several).responses[1],)
    again = read_description(json.loads(alone.text), registry)
    assert again.responses == alone.responses
    assert read(several).at(0).fingerprint == read(sound).fingerprint


def test_the_fingerprint_knows_every_response(read, several, sound):
    moved = several.replace("position: 40 mm", "position: 30 mm")
    assert len({read(text).fingerprint for text in (sound, several, moved)}) == 3


@pytest.mark.parametrize(("base", "over", "count"), [(ONE, SEVERAL, 2), (SEVERAL, ONE, 1)])
def test_extending_replaces_one_by_the_other(read, sound, base, over, count):
    description = read(f"extends: base.yaml\n{over}", base=sound.replace(ONE, base))
    assert len(description.responses) == count


@pytest.mark.parametrize(
    ("section", "expected"),
    [
        (
            ONE + SEVERAL,
            "test.yaml:23:1  response\n"
            "  the description has 'response' and 'responses'.\n"
            "  Keep one of them: a single response, or the list of all.",
        ),
        (
            "responses: {at: tool, position: 10 mm}\n",
            "test.yaml:23:1  responses\n"
            "  a section of keys and values is not a list of responses.\n"
            "  Begin each entry with '- at:'.",
        ),
        ("responses: []\n", "test.yaml:23:1  responses\n  there are no responses."),
        (
            "responses:\n  - {at: tool, position: 10 mm}\n  - {at: tool}\n",
            "test.yaml:25:5  responses[1].position\n  'responses[1]' lacks 'position'.\n  Accepted: a quantity in m",
        ),
        (
            "responses:\n  - {at: tool, position: 10 mm}\n  - {at: tol, position: 10 mm}\n",
            "test.yaml:25:10  responses[1].at\n"
            "  there is no substructure 'tol'.\n"
            "  Did you mean 'tool'?  Accepted: tool, holder",
        ),
        (
            "responses:\n  - {at: tool, position: 10 mm}\n  - {at: tool, position: 1 cm, quantity: mobility}\n",
            "test.yaml:25:5  responses[1]\n"
            "  this is the same point as responses[0].\n"
            "  Average measurements of the same point, or give this one a 'name', as another level of the force.",
        ),
        (
            "",
            "test.yaml:1:1  response\n  the description lacks 'response'."
            "\n  Add, for example: response: {at: NAME, position: 0 mm, direction: x, quantity: accelerance}",
        ),
    ],
)
def test_each_fault_has_its_message(message, sound, section, expected):
    assert message(sound.replace(ONE, section)) == expected


def test_an_assembly_gives_the_frf_of_each_response(assemblies):
    both = dovetail.load(assemblies / "bt40_er32_two_points.yaml").on([500.0, 1300.0, 6500.0])
    assert both.frfs().shape == (2, 3)
    for index, (place, values) in enumerate(zip((0.0, 0.06), both.frfs(), strict=True)):
        point = [("tool", place, "x")]
        expected = both.receptance(None, point, point)[:, 0, 0] * -((2 * 3.141592653589793 * both.frequency) ** 2)
        assert values == pytest.approx(expected, rel=1e-9)
        assert both.at(index).frf() == pytest.approx(expected, rel=1e-9)
    assert both.frf() == pytest.approx(both.frfs()[0], rel=1e-12)
    assert both.frfs([both.from_unit(0.3 + 0 * both.vector(None))] * 4).shape == (4, 2, 3)
