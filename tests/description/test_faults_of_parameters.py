"""Faults of parameters, each with its exact message."""

from __future__ import annotations

import pytest

CASES = {
    "parameter_unknown": (
        {"      kr_tc:": "      k_ry:"},
        "test.yaml:22:7  joints.collet.parameters.k_ry\n"
        "  'k_ry' is not a parameter of joint model 'clamp' (fake 1.0).\n"
        "  Did you mean 'kr_tc'?  Accepted: Dc [m], mn1 [kg], kr_tc [N m/rad]",
    ),
    "parameters_is_a_list": (
        {
            (
                "    parameters:\n"
                "      Dc: {range: [26 mm, 40 mm]}\n"
                "      kr_tc: {range: [2e3 N m/rad, 6e4 N m/rad], scale: log}\n"
            ): "    parameters: [Dc]\n"
        },
        "test.yaml:20:5  joints.collet.parameters\n  a list is not a section of keys and values.",
    ),
    "parameter_key_unknown": (
        {"Dc: {range: ": "Dc: {rnage: "},
        "test.yaml:21:12  joints.collet.parameters.Dc.rnage\n"
        "  'rnage' is not a key of the parameter 'Dc'.\n"
        "  Did you mean 'range'?  Accepted: range, scale, value, about, sd, same_as, ratio",
    ),
    "parameter_empty": (
        {"{range: [26 mm, 40 mm]}": "{}"},
        "test.yaml:21:7  joints.collet.parameters.Dc\n"
        "  the parameter 'Dc' has neither a range nor a value.\n"
        "  Accepted: range, scale, value, about and sd, or same_as",
    ),
    "parameter_is_a_list": (
        {"{range: [26 mm, 40 mm]}": "[26 mm, 40 mm]"},
        "test.yaml:21:7  joints.collet.parameters.Dc\n  a list is not a quantity in m.",
    ),
    "parameter_value_and_range": (
        {"{range: [26 mm, 40 mm]}": "{range: [26 mm, 40 mm], value: 30 mm}"},
        "test.yaml:21:7  joints.collet.parameters.Dc\n"
        "  the parameter 'Dc' has a value and a range.\n"
        "  Accepted: a range to seek it in, or a value that is known",
    ),
    "parameter_value_and_scale": (
        {"{range: [26 mm, 40 mm]}": "{value: 30 mm, scale: log}"},
        "test.yaml:21:7  joints.collet.parameters.Dc\n"
        "  the parameter 'Dc' has a value and a scale.\n"
        "  Accepted: a range to seek it in, or a value that is known",
    ),
    "parameter_value_empty": (
        {"{range: [26 mm, 40 mm]}": "{value: }"},
        "test.yaml:21:12  joints.collet.parameters.Dc.value\n  an empty value is not a quantity in m.",
    ),
    "parameter_value_unit": (
        {"{range: [26 mm, 40 mm]}": "30 kg"},
        "test.yaml:21:11  joints.collet.parameters.Dc\n"
        "  '30 kg' is not in m, or in a unit that can be converted to it.",
    ),
    "range_backwards": (
        {"[26 mm, 40 mm]": "[40 mm, 26 mm]"},
        "test.yaml:21:12  joints.collet.parameters.Dc.range\n  the range from '40 mm' to '26 mm' is empty.\n"
        "  The lower end comes first.",
    ),
    "range_of_three": (
        {"[26 mm, 40 mm]": "[26 mm, 30 mm, 40 mm]"},
        "test.yaml:21:12  joints.collet.parameters.Dc.range\n"
        "  a range has a lower and an upper end, but this list has 3 elements.",
    ),
    "range_is_a_text": (
        {"[26 mm, 40 mm]": "26-40 mm"},
        "test.yaml:21:19  joints.collet.parameters.Dc.range\n  '26-40 mm' is not a list.",
    ),
    "range_unit": (
        {"[26 mm, 40 mm]": "[26 mm, 40 N]"},
        "test.yaml:21:27  joints.collet.parameters.Dc.range[1]\n"
        "  '40 N' is not in m, or in a unit that can be converted to it.",
    ),
    "range_of_words": (
        {"[26 mm, 40 mm]": "[26 mm, [40 mm]]"},
        "test.yaml:21:27  joints.collet.parameters.Dc.range[1]\n  a list is not a quantity in m.",
    ),
    "scale_unknown": (
        {"scale: log": "scale: logarithmic"},
        "test.yaml:22:57  joints.collet.parameters.kr_tc.scale\n"
        "  'logarithmic' is not one of the choices.\n"
        "  Did you mean 'log'?  Accepted: linear, log",
    ),
    "log_range_not_positive": (
        {"[2e3 N m/rad, 6e4 N m/rad]": "[0 N m/rad, 6e4 N m/rad]"},
        "test.yaml:22:15  joints.collet.parameters.kr_tc.range\n"
        "  a range on a logarithmic scale must be positive, but this one begins at 0 N m/rad.\n"
        "  Write 'scale: linear', or a lower end greater than 0.",
    ),
    "log_scale_of_the_models_range": (
        {"Dc: {range: [26 mm, 40 mm]}": "mn1: {scale: log}"},
        "test.yaml:21:20  joints.collet.parameters.mn1.scale\n"
        "  a range on a logarithmic scale must be positive, but this one begins at 0 kg.\n"
        "  Write 'scale: linear', or a lower end greater than 0.",
    ),
    "parameter_of_a_joint_without_any": (
        {
            "joints:\n": (
                "joints:\n"
                "  extra: {model: weld, connect: {a: {to: tool, at: 0}, b: {to: tool, at: 20 mm}}, parameters: "
                "{k: 5}}\n"
            )
        },
        "test.yaml:15:96  joints.extra.parameters.k\n"
        "  'k' is not a parameter of joint model 'weld' (fake 1.0).\n"
        "  Accepted: no parameters",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_each_fault_has_its_message(case, message, broken):
    edits, expected = CASES[case]
    assert message(broken(edits)) == expected
