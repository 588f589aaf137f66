"""Faults of substructures, each with its exact message."""

from __future__ import annotations

import pytest

CASES = {
    "substructure_name": (
        {"  holder:\n": "  the holder:\n"},
        "test.yaml:9:3  substructures.'the holder'\n"
        "  'the holder' cannot be the name of a substructure.\n"
        "  Accepted: letters, digits and '_', not beginning with a digit\n"
        "test.yaml:19:20  joints.collet.connect.holder.to\n"
        "  there is no substructure 'holder'.\n"
        "  Did you mean 'the holder'?  Accepted: tool, the holder",
    ),
    "substructure_without_model": (
        {"    model: rod\n    material: {young: 580": "    material: {young: 580"},
        "test.yaml:5:3  substructures.tool.model\n"
        "  the substructure lacks 'model'.\n"
        "  Accepted: crashing, empty, nodeless, pair, refusing, rod, wall",
    ),
    "substructure_is_a_list": (
        {
            (
                "  holder:\n"
                "    model: rod\n"
                "    material: {young: 200 GPa, density: 7800 kg/m^3}\n"
                "    sections:\n"
                "      - {length: 40 mm, outer: 50 mm, elements: 4}\n"
            ): "  holder: [rod]\n"
        },
        "test.yaml:9:3  substructures.holder\n"
        "  a list is not a section of keys and values.\n"
        "  Accepted: a section that begins with 'model:'",
    ),
    "model_unknown": (
        {"model: rod\n    material: {young: 580": "model: rob\n    material: {young: 580"},
        "test.yaml:6:12  substructures.tool.model\n"
        "  'rob' is not a substructure model.\n"
        "  Did you mean 'rod'? A model of your own needs `plugins='FILE.py'` or, in a package, "
        "`pip install -e FOLDER` once more.  "
        "Accepted: crashing, empty, nodeless, pair, refusing, rod, wall",
    ),
    "model_not_a_text": (
        {"model: rod\n    material: {young: 580": "model: [rod]\n    material: {young: 580"},
        "test.yaml:6:5  substructures.tool.model\n"
        "  a list is not the name of a model.\n"
        "  Accepted: crashing, empty, nodeless, pair, refusing, rod, wall",
    ),
    "model_of_another_kind": (
        {"model: rod\n    material: {young: 580": "model: clamp\n    material: {young: 580"},
        "test.yaml:6:12  substructures.tool.model\n"
        "  'clamp' is a joint model; a substructure model is needed here.\n"
        "  Accepted: crashing, empty, nodeless, pair, refusing, rod, wall",
    ),
    "model_offered_twice": (
        {"model: rod\n    material: {young: 580": "model: twin\n    material: {young: 580"},
        "test.yaml:6:12  substructures.tool.model\n"
        "  the substructure model 'twin' is offered by fake 1.0 and other 2.0.\n"
        "  Say which: fake:twin, other:twin.",
    ),
    "constructor_refuses": (
        {"model: rod\n    material: {young: 580": "model: refusing\n    material: {young: 580"},
        "test.yaml:5:3  substructures.tool\n"
        "  substructure model 'refusing' (fake 1.0) cannot be made from this section: the rod is too "
        "thin.",
    ),
    "constructor_crashes": (
        {"model: rod\n    material: {young: 580": "model: crashing\n    material: {young: 580"},
        "test.yaml:5:3  substructures.tool\n"
        "  substructure model 'crashing' (fake 1.0) cannot be made from this section: KeyError: "
        "'stiffness'.",
    ),
    "nodes_crash": (
        {"model: rod\n    material: {young: 580": "model: nodeless\n    material: {young: 580"},
        "test.yaml:5:3  substructures.tool\n"
        "  substructure model 'nodeless' (fake 1.0) cannot give its nodes: RuntimeError: no mesh.",
    ),
    "no_nodes": (
        {"model: rod\n    material: {young: 580": "model: empty\n    material: {young: 580"},
        "test.yaml:5:3  substructures.tool\n  substructure model 'empty' (fake 1.0) has no nodes.",
    ),
    "option_unknown": (
        {"    material: {young: 200 GPa": "    colour: red\n    material: {young: 200 GPa"},
        "test.yaml:11:5  substructures.holder.colour\n"
        "  'colour' is not a key of substructure model 'rod' (fake 1.0).\n"
        "  Accepted: model, reversed, place, material, sections",
    ),
    "option_missing": (
        {"    material: {young: 200 GPa, density: 7800 kg/m^3}\n": ""},
        "test.yaml:9:3  substructures.holder.material\n  substructure model 'rod' (fake 1.0) lacks 'material'.",
    ),
    "nested_option_unknown": (
        {"{young: 200 GPa, ": "{yong: 200 GPa, young: 200 GPa, "},
        "test.yaml:11:16  substructures.holder.material.yong\n"
        "  'yong' is not a key of 'material' of substructure model 'rod' (fake 1.0).\n"
        "  Did you mean 'young'?  Accepted: young [Pa], density [kg/m^3]",
    ),
    "nested_option_missing": (
        {"{young: 200 GPa, ": "{"},
        "test.yaml:11:5  substructures.holder.material.young\n"
        "  'material' of substructure model 'rod' (fake 1.0) lacks 'young'.\n"
        "  Accepted: a quantity in Pa",
    ),
    "unit_of_another_dimension": (
        {"outer: 50 mm": "outer: 50 kg"},
        "test.yaml:13:32  substructures.holder.sections[0].outer\n"
        "  '50 kg' is not in m, or in a unit that can be converted to it.",
    ),
    "unit_unknown": (
        {"outer: 50 mm": "outer: 50 milimeter"},
        "test.yaml:13:32  substructures.holder.sections[0].outer\n"
        "  'milimeter' in '50 milimeter' is not a unit; a unit of m was expected.",
    ),
    "quantity_is_a_word": (
        {"outer: 50 mm": "outer: wide"},
        "test.yaml:13:32  substructures.holder.sections[0].outer\n"
        "  'wide' is not a quantity: write a number, a space and a unit of m.",
    ),
    "quantity_is_a_truth_value": (
        {"outer: 50 mm": "outer: true"},
        "test.yaml:13:32  substructures.holder.sections[0].outer\n  true is not a quantity in m.",
    ),
    "quantity_is_negative": (
        {"outer: 50 mm": "outer: -50 mm"},
        "test.yaml:13:32  substructures.holder.sections[0].outer\n  '-50 mm' must be greater than 0.",
    ),
    "quantity_is_a_list": (
        {"outer: 50 mm": "outer: [50 mm]"},
        "test.yaml:13:25  substructures.holder.sections[0].outer\n  a list is not a quantity in m.",
    ),
    "quantity_is_empty": (
        {"outer: 50 mm": "outer: "},
        "test.yaml:13:25  substructures.holder.sections[0].outer\n  an empty value is not a quantity in m.",
    ),
    "count_is_too_great": (
        {"elements: 4": "elements: 400"},
        "test.yaml:13:49  substructures.holder.sections[0].elements\n  400 must be at most 100.",
    ),
    "count_is_a_word": (
        {"elements: 4": "elements: four"},
        "test.yaml:13:49  substructures.holder.sections[0].elements\n  'four' is not a whole number.",
    ),
    "truth_value_is_a_word": (
        {"elements: 4": "hollow: maybe"},
        "test.yaml:13:47  substructures.holder.sections[0].hollow\n  'maybe' is not true or false.",
    ),
    "several_types_possible": (
        {"elements: 4": "mesh: fine"},
        "test.yaml:13:45  substructures.holder.sections[0].mesh\n  'fine' is not a whole number or a list.",
    ),
    "list_is_empty": (
        {"sections: [{length: 100 mm, outer: 10 mm, elements: 10}]": "sections: []"},
        "test.yaml:8:5  substructures.tool.sections\n  a list must have 1 or more elements.",
    ),
    "list_is_a_section": (
        {"sections: [{length: 100 mm, outer: 10 mm, elements: 10}]": "sections: {length: 100 mm}"},
        "test.yaml:8:5  substructures.tool.sections\n  a section of keys and values is not a list.",
    ),
    "element_is_a_text": (
        {"- {length: 40 mm, outer: 50 mm, elements: 4}": "- 40 mm"},
        "test.yaml:13:9  substructures.holder.sections[0]\n  '40 mm' is not a section of keys and values.",
    ),
    "model_is_empty": (
        {"model: rod\n    material: {young: 580": "model:\n    material: {young: 580"},
        "test.yaml:6:5  substructures.tool.model\n"
        "  an empty value is not the name of a model.\n"
        "  Accepted: crashing, empty, nodeless, pair, refusing, rod, wall",
    ),
    "substructure_is_not_connected": (
        {
            (
                "  tool:\n"
                "    model: rod\n"
                "    material: {young: 580 GPa, density: 14450 kg/m^3}\n"
                "    sections: [{length: 100 mm, outer: 10 mm, elements: 10}]\n"
            ): (
                "  tool:\n"
                "    model: rod\n"
                "    material: {young: 580 GPa, density: 14450 kg/m^3}\n"
                "    sections: [{length: 100 mm, outer: 10 mm, elements: 10}]\n"
                "  spare: {model: wall}\n"
            )
        },
        "test.yaml:9:3  substructures.spare\n"
        "  no joint connects 'spare' with 'tool', where the response is.\n"
        "  Connect it or remove it.",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_each_fault_has_its_message(case, message, broken):
    edits, expected = CASES[case]
    assert message(broken(edits)) == expected
