"""Faults of joints, each with its exact message."""

from __future__ import annotations

from pathlib import Path

import pytest

CONFTEST = Path(__file__).with_name("conftest.py")
CASES = {
    "joint_name": (
        {"  collet:": "  1st:"},
        "test.yaml:15:3  joints.'1st'\n"
        "  '1st' cannot be the name of a joint.\n"
        "  Accepted: letters, digits and '_', not beginning with a digit",
    ),
    "joint_model_unknown": (
        {"model: clamp": "model: clmap"},
        "test.yaml:16:12  joints.collet.model\n"
        "  'clmap' is not a joint model.\n"
        "  Did you mean 'clamp'? A model of your own needs `plugins='FILE.py'` or, in a package, "
        "`pip install -e FOLDER` once more.  "
        "Accepted: clamp, portless, weld",
    ),
    "joint_option_unknown": (
        {"    model: clamp": "    model: clamp\n    segment: 10 mm"},
        "test.yaml:17:5  joints.collet.segment\n"
        "  'segment' is not a key of joint model 'clamp' (fake 1.0).\n"
        "  Accepted: model, connect, parameters, structural_damping, axes",
    ),
    "ports_crash": (
        {"model: clamp": "model: portless"},
        "test.yaml:15:3  joints.collet\n"
        "  joint model 'portless' (fake 1.0) cannot give its ports: AttributeError: 'Config' object has "
        "no attribute 'missing'.\n"
        f"  Correct it in {CONFTEST}.",
    ),
    "connect_missing": (
        {
            (
                "    connect:\n"
                "      tool: {to: tool, at: [90 mm, 100 mm]}\n"
                "      holder: {to: holder, at: [0 mm, 10 mm]}\n"
            ): ""
        },
        "test.yaml:15:3  joints.collet.connect\n"
        "  joint model 'clamp' (fake 1.0) lacks 'connect'.\n"
        "  Accepted: a section with the ports tool, holder",
    ),
    "connect_is_a_text": (
        {
            (
                "    connect:\n"
                "      tool: {to: tool, at: [90 mm, 100 mm]}\n"
                "      holder: {to: holder, at: [0 mm, 10 mm]}\n"
            ): "    connect: tool\n"
        },
        "test.yaml:17:5  joints.collet.connect\n"
        "  'tool' is not a section of keys and values.\n"
        "  Accepted: a section with the ports tool, holder",
    ),
    "port_unknown": (
        {"      holder: {to": "      hodler: {to"},
        "test.yaml:19:7  joints.collet.connect.hodler\n"
        "  'hodler' is not a port of joint model 'clamp' (fake 1.0).\n"
        "  Did you mean 'holder'?  Accepted: tool, holder",
    ),
    "port_key_unknown": (
        {"tool: {to: tool, at": "tool: {too: tool, at"},
        "test.yaml:18:14  joints.collet.connect.tool.too\n"
        "  'too' is not a key of the port 'tool'.\n"
        "  Did you mean 'to'?  Accepted: to, at [m]",
    ),
    "port_without_positions": (
        {"{to: tool, at: [90 mm, 100 mm]}": "{to: tool}"},
        "test.yaml:18:7  joints.collet.connect.tool.at\n  the port 'tool' lacks 'at'.\n  Accepted: a quantity in m",
    ),
    "port_to_nowhere": (
        {"{to: holder,": "{to: holdr,"},
        "test.yaml:19:20  joints.collet.connect.holder.to\n"
        "  there is no substructure 'holdr'.\n"
        "  Did you mean 'holder'?  Accepted: tool, holder",
    ),
    "port_takes_two_nodes": (
        {"at: [90 mm, 100 mm]": "at: [100 mm]"},
        "test.yaml:18:24  joints.collet.connect.tool.at\n"
        "  the port 'tool' of joint model 'clamp' (fake 1.0) takes 2 nodes, not 1.",
    ),
    "port_position_unit": (
        {"at: [90 mm, 100 mm]": "at: [90 mm, 100 s]"},
        "test.yaml:18:36  joints.collet.connect.tool.at[1]\n"
        "  '100 s' is not in m, or in a unit that can be converted to it.",
    ),
    "no_node_there": (
        {"at: [90 mm, 100 mm]": "at: [90 mm, 96 mm]"},
        "test.yaml:18:36  joints.collet.connect.tool.at[1]\n"
        "  substructure 'tool' has no node at 96 mm.\n"
        "  The nearest nodes are at 90 mm and 100 mm.  Accepted: 0 mm, 10 mm, 20 mm, 30 mm, 40 mm, 50 "
        "mm, 60 mm, 70 mm, 80 mm, 90 mm, 100 mm",
    ),
    "node_taken_twice": (
        {"at: [90 mm, 100 mm]": "at: [90 mm, 90 mm]"},
        "test.yaml:18:36  joints.collet.connect.tool.at[1]\n"
        "  the node of 'tool' at 90 mm is already taken by this joint.",
    ),
    "joint_between_walls": (
        {
            "joints:\n": (
                "  left: {model: wall}\n"
                "  right: {model: wall}\n"
                "joints:\n"
                "  beam: {model: weld, connect: {a: {to: left, at: 0}, b: {to: right, at: 0}}}\n"
            )
        },
        "test.yaml:14:3  substructures.left\n"
        "  no joint connects 'left' with 'tool', where the response is.\n"
        "  Connect it or remove it.\n"
        "test.yaml:15:3  substructures.right\n"
        "  no joint connects 'right' with 'tool', where the response is.\n"
        "  Connect it or remove it.\n"
        "test.yaml:17:3  joints.beam\n"
        "  the joint 'beam' attaches to nothing that moves.\n"
        "  Connect it to a part that moves, or remove it.",
    ),
    "node_ambiguous": (
        {
            "joints:\n": (
                "  two: {model: pair}\n"
                "joints:\n"
                "  extra: {model: weld, connect: {a: {to: two, at: 0}, b: {to: tool, at: 0}}}\n"
            )
        },
        "test.yaml:16:47  joints.extra.connect.a.at[0]\n"
        "  0 mm of substructure 'two' could be any of its nodes left, right.",
    ),
    "joint_to_itself": (
        {"joints:\n": "joints:\n  extra: {model: weld, connect: {a: {to: tool, at: 0}, b: {to: tool, at: 0}}}\n"},
        "test.yaml:15:70  joints.extra.connect.b.at[0]\n  the node of 'tool' at 0 mm is already taken by this joint.",
    ),
    "only_one_node_far_away": (
        {
            "joints:\n": (
                "  base: {model: wall}\n"
                "joints:\n"
                "  extra: {model: weld, connect: {a: {to: base, at: 5 mm}, b: {to: tool, at: 0}}}\n"
            )
        },
        "test.yaml:16:48  joints.extra.connect.a.at[0]\n"
        "  substructure 'base' has no node at 5 mm.\n"
        "  The only node is at 0 mm.  Accepted: 0 mm",
    ),
    "joint_without_a_section": (
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
            ): "joints:\n  collet:\n"
        },
        "test.yaml:15:3  joints.collet\n"
        "  an empty value is not a section of keys and values.\n"
        "  Accepted: a section that begins with 'model:'",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_each_fault_has_its_message(case, message, broken):
    edits, expected = CASES[case]
    assert message(broken(edits)) == expected
