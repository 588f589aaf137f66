"""Faults of yaml, each with its exact message."""

from __future__ import annotations

import pytest

CASES = {
    "two_colons": (
        {"name: test": "name: test: 2"},
        "test.yaml:2:11\n  this is not YAML: a ':' is not allowed here; an indentation or a quote is wrong.",
    ),
    "tab": ({"  samples": "\tsamples"}, "test.yaml:25:1\n  this is not YAML: a tab is not an indentation; use spaces."),
    "unclosed_list": (
        {"[0 mm, 10 mm]}": "[0 mm, 10 mm}"},
        "test.yaml:19:44\n  this is not YAML: expected ',' or ']', but got '}'.",
    ),
    "indentation": (
        {"    model: clamp": "   model: clamp"},
        "test.yaml:17:12\n  this is not YAML: a ':' is not allowed here; an indentation or a quote is wrong.",
    ),
    "open_quote": (
        {"name: test": "name: 'test"},
        "test.yaml:2:7\n  this is not YAML: the quote that opens here is not closed.",
    ),
    "reserved_character": (
        {"name: test": "name: @test"},
        "test.yaml:2:7\n  this is not YAML: a text that begins with '@' must be in quotes.",
    ),
    "key_twice": (
        {"    parameters:": "    model: clamp\n    parameters:"},
        "test.yaml:20:5  joints.collet.model\n"
        "  the key 'model' is repeated; it is first used in line 16.\n"
        "  Remove one of them.",
    ),
    "key_is_a_number": (
        {"      Dc:": "      5:"},
        "test.yaml:21:7  joints.collet.parameters\n  the key is 5.\n  Put it in quotes.  Accepted: a text",
    ),
    "key_is_a_list": (
        {"      Dc:": "      [Dc, dc]:"},
        "test.yaml:21:7  joints.collet.parameters\n  the key is a list.\n  Accepted: a text",
    ),
    "tag": (
        {"name: test": "name: !!python/object/apply:os.system ['true']"},
        "test.yaml:2:7  name\n"
        "  the tag '!!python/object/apply:os.system' is not allowed here; a description has only plain "
        "values.\n"
        "  Remove it.  Accepted: !!str, !!int, !!float, !!bool, !!null, !!map, !!seq",
    ),
    "local_tag": (
        {"young: 200 GPa": "young: !pa 200"},
        "test.yaml:11:23  substructures.holder.material.young\n"
        "  the tag '!pa' is not allowed here; a description has only plain values.\n"
        "  Remove it.  Accepted: !!str, !!int, !!float, !!bool, !!null, !!map, !!seq",
    ),
    "core_tag_of_another_type": (
        {"elements: 4": "elements: !!int four"},
        "test.yaml:13:49  substructures.holder.sections[0].elements\n  'four' is not what its tag '!!int' says.",
    ),
    "not_finite": (
        {"young: 200 GPa": "young: .inf"},
        "test.yaml:11:23  substructures.holder.material.young\n  '.inf' is not a finite number.",
    ),
    "too_large": (
        {"young: 200 GPa": "young: 1e999"},
        "test.yaml:11:23  substructures.holder.material.young\n  '1e999' is not a finite number.",
    ),
    "too_large_a_whole_number": (
        {"elements: 4": "elements: 99999999999999999999"},
        "test.yaml:13:49  substructures.holder.sections[0].elements\n"
        "  '99999999999999999999' is too large a whole number.",
    ),
    "alias_without_anchor": (
        {"young: 200 GPa": "young: *steel"},
        "test.yaml:11:23  substructures.holder.material.young\n  the alias '*steel' has no anchor '&steel' before it.",
    ),
    "alias_inside_itself": (
        {"[26 mm, 40 mm]": "&r [26 mm, *r]"},
        "test.yaml:21:30  joints.collet.parameters.Dc.range[1]\n  the alias '*r' is inside its own anchor.",
    ),
    "directive": (
        {"dovetail: 1": "%YAML 1.1\n---\ndovetail: 1"},
        "test.yaml:2:1\n  the file requires YAML 1.1.\n  Accepted: YAML 1.2",
    ),
    "two_documents": (
        {"response:": "---\nresponse:"},
        "test.yaml:23:1\n  a second document begins here.\n  Accepted: one document in a file",
    ),
    "extends_nothing": (
        {"name: test": "extends: bsae.yaml"},
        "test.yaml:2:10  extends\n  there is no file 'bsae.yaml'.\n  The path is relative to the file that names it.",
    ),
    "extends_a_number": (
        {"name: test": "extends: 5"},
        "test.yaml:2:10  extends\n  5 is not a file.\n  Accepted: the path of a file",
    ),
    "extends_itself": (
        {"name: test": "extends: ./test.yaml"},
        "test.yaml:2:10  extends\n  'test.yaml' extends itself in a circle.",
    ),
    "merge_key": (
        {"      Dc:": "      <<:"},
        "test.yaml:21:7  joints.collet.parameters.'<<'\n"
        "  '<<' is not a parameter of joint model 'clamp' (fake 1.0).\n"
        "  Accepted: Dc [m], mn1 [kg], kr_tc [N m/rad]",
    ),
    "control_character": (
        {"name: test": 'name: "te\\x07st"'},
        "test.yaml:2:7  name\n  the character U+0007 is not allowed in a description.",
    ),
    "nul": ({"name: test": "name: te\0st"}, "test.yaml:2:9\n  the character U+0000 is not allowed in a description."),
    "key_is_empty": (
        {"      Dc:": "      :"},
        "test.yaml:21:7  joints.collet.parameters\n  the key is an empty value.\n  Accepted: a text",
    ),
    "nested_too_deep": (
        {"name: test": "name: [[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]"},
        "test.yaml:2:38\n  this is nested more than 32 levels deep.",
    ),
    "escape_out_of_range": (
        {"name: test": 'name: "\\UFFFFFFFF"'},
        "test.yaml:2:1\n  this is not YAML: an escape or a directive cannot be read.",
    ),
    "surrogate": (
        {"name: test": 'name: "\\ud800"'},
        "test.yaml:2:7  name\n  the character U+D800 is not allowed in a description.",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_each_fault_has_its_message(case, message, broken):
    edits, expected = CASES[case]
    assert message(broken(edits)) == expected
