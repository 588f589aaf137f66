"""Joints that declare themselves wrongly: one block that names the plugin, what is wrong and what is accepted."""

from __future__ import annotations

import re

import pytest

import dovetail
from dovetail.errors import PluginError
from dovetail.interfaces import joint_faults

PLUGIN = """\
import numpy as np
import dovetail
from dovetail import JointPort, Parameter


class Pad(dovetail.JointModel):
    name = "pad"
    summary = "A pad"
    parameters = (Parameter("k", "N/m", 1e5, 1e7), Parameter("c", "N s/m", 1.0, 10.0, "log"))
    ports = (JointPort("a", 1), JointPort("b", 1))
    internal_dofs = 0
    merged_dofs = ()

    def matrices(self, theta):
        joint = dovetail.StructuralMatrices.zeros(len(theta), 4)
        across = np.outer([1, 0, -1, 0], [1, 0, -1, 0])
        joint.K[:] = theta[:, 0, None, None] * across
        joint.C[:] = theta[:, 1, None, None] * across
        return joint

    def range_objections(self, lower, upper):
        return super().range_objections(lower, upper)


@dovetail.hookimpl
def dovetail_components():
    return [Pad]
"""

DESCRIPTION = """\
dovetail: 1
name: padded
frequency: {start: 1, stop: 100, step: 1}
substructures:
  mass: {model: lumped, masses: [{mass: 1}]}
  base: {model: ground}
joints:
  mount:
    model: pad
    connect: {a: {to: mass, at: 0}, b: {to: base, at: 0}}
    parameters:
      k: {range: [1e5, 1e6]}
response: {at: mass, position: 0}
"""

K = 'Parameter("k", "N/m", 1e5, 1e7)'
AT_IMPORT = {
    "scale": (', "log")', ', "lg")', "parameter 'c': its scale is 'lg'. Accepted: linear, log."),
    "empty": (
        "1e5, 1e7",
        "1e7, 1e7",
        "parameter 'k': its range from 1e+07 to 1e+07 is empty. Accepted: lower < upper.",
    ),
    "log": (
        "1.0, 10.0",
        "0.0, 10.0",
        "parameter 'c': its range on a logarithmic scale begins at 0. Accepted: lower > 0.",
    ),
    "infinite": ("1e7", "np.inf", "parameter 'k': an end of its range is inf. Accepted: a finite number in N/m."),
    "text": ("1e5", '"1e5"', "parameter 'k': an end of its range is '1e5'. Accepted: a finite number in N/m."),
    "truth": ("1e5", "False", "parameter 'k': an end of its range is False. Accepted: a finite number in N/m."),
    "name": ('"k"', '"k 1"', "parameter 'k 1': this cannot be a name. Accepted: letters, digits and '_'"),
    "no_name": ('"k"', "7", "parameter 7: its name is 7. Accepted: a text."),
    "no_unit": ('"N/m"', "None", "parameter 'k': its unit is None. Accepted: a text."),
    "port_name": ('"a"', "1", "port 1: this cannot be a name. Accepted: a text of letters, digits and '_'."),
    "port_nodes": ('"a", 1', '"a", 0', "port 'a': its number of nodes is 0. Accepted: a whole number from 1."),
    "port_half": ('"a", 1', '"a", 1.5', "port 'a': its number of nodes is 1.5. Accepted: a whole number from 1."),
}
AT_READING = {
    "twice": ('"c"', '"k"', "has 2 parameters of the name 'k'.\n", "Accepted: names that differ"),
    "dotted": (
        '"k"',
        '"mount.k"',
        "has 'mount.k' among its parameters, which cannot be a name.\n",
        "Accepted: letters",
    ),
    "unit": ('"N/m"', '"N/mm/furlongs2"', "has the parameter 'k' in 'N/mm/furlongs2', which is not a unit.\n", "Acc"),
    "not_a_tuple": (
        "parameters = (",
        "parameters = 5 or (",
        "has 5 for its parameters, not a tuple.\n",
        "Accepted: a tuple such as (Parameter(",
    ),
    "strangers": (K, '("k", "N/m")', "has ('k', 'N/m') among its parameters, which is not a Parameter.\n", "Accepted"),
    "no_ports": ("ports = (", "ports = None and (", "has None for its ports, not a tuple.\n", "Accepted: a tuple such"),
    "port_strangers": (
        'JointPort("b", 1)',
        '"b"',
        "has 'b' among its ports, which is not a JointPort.\n",
        "Accepted: a tuple",
    ),
    "ports_alike": ('"b"', '"a"', "has 2 ports of the name 'a'.\n", "Accepted: names that differ"),
    "internal": ("internal_dofs = 0", "internal_dofs = 0.5", "has 0.5 for its internal_dofs.\n", "Accepted: a whole"),
    "merged": ("merged_dofs = ()", "merged_dofs = ((0, 4),)", "has (0, 4) among its merged_dofs.\n", "Accepted: pairs"),
    "nested": (
        "merged_dofs = ()",
        'nested_ports = (("a", "hub", None),)',
        "has ('a', 'hub', None) among its nested_ports.\n",
        "Accepted: two of the ports a, b, and a diameter",
    ),
    "nested_pair": (
        "merged_dofs = ()",
        'nested_ports = (("a", "b"),)',
        "has ('a', 'b') among its nested_ports.\n",
        "Accepted: two of the ports",
    ),
    "nested_diameter": (
        "merged_dofs = ()",
        'nested_ports = (("a", "b", 0.0),)',
        "has ('a', 'b', 0.0) among its nested_ports.\n",
        "Accepted: two of the ports",
    ),
    "merged_none": (
        "merged_dofs = ()",
        "merged_dofs = 3",
        "has 3 for its merged_dofs, not a tuple.\n",
        "Accepted: pairs",
    ),
}


@pytest.fixture
def load(tmp_path):
    def read(old: str, new: str, description: str = DESCRIPTION):
        assert old in PLUGIN
        (tmp_path / "pad.py").write_text(PLUGIN.replace(old, new, 1))
        (tmp_path / "padded.yaml").write_text(description)
        return dovetail.load(tmp_path / "padded.yaml", plugins=[tmp_path / "pad.py"])

    return read


def test_the_sound_joint_is_read(load):
    joint = load("0", "0").description.joints["mount"].connection.model
    assert joint_faults(joint) == ()


@pytest.mark.parametrize("case", AT_IMPORT)
def test_a_value_that_cannot_be_is_refused_where_it_stands(load, tmp_path, case):
    old, new, said = AT_IMPORT[case]
    with pytest.raises(PluginError) as error:
        load(old, new)
    assert re.fullmatch(rf"{re.escape(str(tmp_path / 'pad.py'))}:(9|10)", error.value.faults[0].where)
    assert error.value.faults[0].problem.startswith(said)


@pytest.mark.parametrize("case", AT_READING)
def test_declarations_that_do_not_fit_are_refused_with_the_description(load, tmp_path, case):
    old, new, said, accepted = AT_READING[case]
    with pytest.raises(dovetail.DovetailError) as error:
        load(old, new)
    assert len(error.value.faults) == 1
    text = str(error.value)
    assert text.startswith(
        f"{tmp_path / 'padded.yaml'}:8:3  joints.mount\n  joint model 'pad' ({tmp_path / 'pad.py'}) {said}"
    )
    assert f"  Correct it in {tmp_path / 'pad.py'}.  {accepted}" in text


def test_a_joint_with_an_invalid_parameter_is_refused(load):
    broken = 'parameters = property(lambda self: (Parameter("k", "N/m", 5, 1),)) or ('
    with pytest.raises(
        dovetail.DovetailError, match="cannot give its parameters: parameter 'k': its range from 5 to 1 is"
    ):
        load("parameters = (", broken)


NEGATIVE = DESCRIPTION.replace("[1e5, 1e6]", "[-1e5, 1e6]")


def test_a_negative_range_is_refused_with_its_line(load):
    with pytest.raises(dovetail.DovetailError) as error:
        load("0", "0", NEGATIVE)
    assert str(error.value).endswith(
        "padded.yaml:12:7  joints.mount.parameters.k\n  k must not be negative, but is -100000 to 1e+06 N/m."
    )


def test_a_negative_value_is_refused_with_its_line(load):
    with pytest.raises(dovetail.DovetailError, match=r"yaml:12:7 .*\n  k must not be negative, but is -3 N/m\."):
        load("0", "0", DESCRIPTION.replace("{range: [1e5, 1e6]}", "-3 N/m"))


def test_a_model_may_allow_negative_values(load):
    load("return super().range_objections(lower, upper)", "return {}", NEGATIVE)
    load("1e5, 1e7", "-1e7, 1e7", NEGATIVE)


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("return 'no'", "gives 'no' for its objections, not a mapping."),
        ("return lower['gone']", "failed: KeyError: 'gone'"),
    ],
)
def test_range_objections_of_the_wrong_form_are_the_plugins_fault(load, body, said):
    with pytest.raises(dovetail.DovetailError, match=re.escape(said)):
        load("return super().range_objections(lower, upper)", body)


@pytest.mark.parametrize(
    ("edits", "said"),
    [
        (
            {"Dc": {"range": ["15 mm", "40 mm"]}},
            "the inner diameter dc may be 18 mm where the outer diameter Dc is 15 mm",
        ),
        (
            {"dc": {"range": ["10 mm", "26 mm"]}},
            "the inner diameter dc may be 26 mm where the outer diameter Dc is 26 mm",
        ),
        ({"dc": {"value": "35 mm"}, "Dc": {"value": "30 mm"}}, "dc may be 35 mm where the outer diameter Dc is 30 mm"),
        ({"mn1": {"range": [-0.1, 0.2]}}, "mn1 must not be negative, but is -0.1 to 0.2 kg."),
        ({"kt_tc": {"value": "-1 N/m"}}, "kt_tc must not be negative, but is -1 N/m."),
    ],
)
def test_a_collet_that_cannot_be_is_refused(assemblies, tmp_path, edits, said):
    source = {
        "extends": str(assemblies / "bt40_er32.yaml"),
        "name": "impossible",
        "joints": {"collet": {"parameters": edits}},
    }
    with pytest.raises(dovetail.DovetailError, match=re.escape(said)) as error:
        dovetail.load(source)
    assert "joints.collet.parameters." in error.value.faults[0].where
