"""Faults of unknown options of parts, of calibrations and of forces: position, problem, remedy."""

from __future__ import annotations

import copy
from typing import Any

import pytest

import dovetail

SOUND: dict[str, Any] = {
    "dovetail": 1,
    "name": "arm",
    "frequency": {"start": 20, "stop": 2500, "step": 10},
    "substructures": {
        "arm": {
            "model": "timoshenko_beam",
            "material": {"young": "206 GPa", "density": 7850},
            "sections": [{"length": "300 mm", "outer": "22 mm", "inner": "10 mm", "elements": 6}],
        },
        "wall": {"model": "ground"},
    },
    "joints": {
        "foot": {"model": "spring_damper", "connect": {"a": {"to": "arm", "at": 0}, "b": {"to": "wall", "at": 0}}},
    },
    "response": {"at": "arm", "position": "node n5"},
}
YOUNG, INNER = "substructures.arm.material.young", "substructures.arm.sections.0.inner"
CHAIN, FORCE, FOOT = "response.calibration", "response.force", "joints.foot.parameters"
FAULTS = {
    "one_end": (YOUNG, {"range": [1e11]}, "young.range\n  a range has a lower and an upper end, but this list has 1"),
    "empty": (YOUNG, {"range": [2e11, 1e11]}, "young.range\n  the range from 200000000000.0 to 100000000000.0 is"),
    "unit": (YOUNG, {"range": ["1 mm", 2e11]}, "young.range[0]\n  '1 mm' is not in Pa, or"),
    "invalid_end": (
        YOUNG,
        {"range": [-1, 2e11]},
        "the part cannot have -1 Pa there: it must be greater than 0.",
    ),
    "invalid_part": (
        INNER,
        {"range": ["10 mm", "30 mm"]},
        "inner\n  the part cannot have 30 mm there: the inner diameter must be smaller than the outer one.",
    ),
    "no_sd": (YOUNG, {"about": "206 GPa"}, "young\n  the parameter 'material.young' lacks 'sd'."),
    "sd_0": (YOUNG, {"about": "206 GPa", "sd": 0}, "young.sd\n  a standard deviation must be greater than 0."),
    "misspelt": (
        YOUNG,
        {"abuot": 1},
        "'abuot' is not a key of the parameter 'material.young'.\n  Did you mean 'about'?",
    ),
    "both": (YOUNG, {"range": [1e11, 2e11], "value": 3}, "the parameter 'material.young' has a value and a range."),
    "nothing": (YOUNG, {}, "the parameter 'material.young' has neither a range nor a value."),
    "scale_alone": (YOUNG, {"scale": "linear"}, "the parameter 'material.young' has neither a range nor a value."),
    "whole_number": (
        "substructures.arm.sections.0.elements",
        {"range": [3, 6]},
        "elements\n  a section of keys and values is not a whole number.",
    ),
    "tie_to_another_unit": (
        YOUNG,
        {"same_as": "arm.material.density"},
        "same_as\n  'arm.material.density' is in kg/m^3, but this option is in Pa.",
    ),
    "tie_to_itself": (YOUNG, {"same_as": "arm.material.young"}, "'arm.material.young' has no value or range"),
    "tie_to_nothing": (YOUNG, {"same_as": "leg.material.young"}, "'leg.material.young' has no value or range"),
    "tie_without_owner": (
        YOUNG,
        {"same_as": "young"},
        "same_as\n  'young' is not a parameter.\n  Accepted: the",
    ),
    "tie_of_a_joint": (FOOT, {"k": {"same_as": "foot.kk"}}, "k.same_as\n  there is no parameter 'foot.kk'."),
    "circle": (FOOT, {"k": {"same_as": "foot.k"}}, "k.same_as\n  'foot.k' is tied to 'foot.k', which is tied to it."),
    "misspelt_chain": (CHAIN, {"gian": 1}, "gian\n  'gian' is not a key of a calibration.\n  Did you mean 'gain'?"),
    "negative_gain": (CHAIN, {"gain": -1}, "gain\n  gain must be positive, but is -1 here.\n  Write 'sign: unknown'"),
    "no_sign": (CHAIN, {"sign": 2}, "sign\n  2 is not a sign.\n  Accepted: 1, -1 or unknown"),
    "negative_mass": (CHAIN, {"mass": "-1 g"}, "mass\n  mass must be 0 or more, but is -0.001 kg here."),
    "chain_is_a_number": (CHAIN, 3, "calibration\n  3 is not a section of keys and values."),
    "force_nowhere": (FORCE, {"position": "node n99"}, "force.position\n  substructure 'arm' has no node 'n99'."),
    "force_on_the_ground": (FORCE, {"at": "wall", "position": 0}, "force.at\n  the force cannot be at 'wall', which"),
    "force_without_position": (FORCE, {"at": "arm"}, "force.position\n  'response.force' lacks 'position'."),
    "a_name_with_a_blank": ("response.name", "a b", "name\n  'a b' has characters that are not allowed here."),
}


def with_value(place: str, value: Any) -> dict[str, Any]:
    changed: Any = copy.deepcopy(SOUND)
    node = changed
    *steps, last = place.split(".")
    for step in steps:
        node = node[int(step)] if step.isdecimal() else node[step]
    node[last] = value
    return changed


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_reported_once_with_its_problem(fault):
    place, value, message = FAULTS[fault]
    with pytest.raises(dovetail.DescriptionError) as raised:
        dovetail.load(with_value(place, value))
    assert message in str(raised.value)
    assert len(raised.value.faults) == 1


def test_owners_of_parameters_must_have_different_names():
    changed = with_value(YOUNG, {"range": [1e11, 2e11]})
    changed["joints"]["arm"] = changed["joints"].pop("foot")
    with pytest.raises(dovetail.DescriptionError, match="a joint has the name 'arm' too"):
        dovetail.load(changed)
    changed = with_value("response.name", "foot")
    changed["response"]["calibration"] = {"gain": 1.1}
    with pytest.raises(dovetail.DescriptionError, match="the response has the name of a joint, 'foot'"):
        dovetail.load(changed)


def test_ranges_that_fit_one_by_one_and_not_together():
    changed = with_value(INNER, {"range": ["10 mm", "20 mm"]})
    changed["substructures"]["arm"]["sections"][0]["outer"] = {"range": ["19 mm", "40 mm"]}
    message = "the part cannot have sections.0.outer = 19 mm, sections.0.inner = 20 mm: the inner diameter must be"
    with pytest.raises(dovetail.DescriptionError) as raised:
        dovetail.load(changed)
    assert message in str(raised.value)


def test_an_option_that_is_tied_to_another_is_tried_with_it():
    changed = with_value(INNER, {"same_as": "arm.sections.0.outer", "ratio": 0.5})
    changed["substructures"]["arm"]["sections"][0]["outer"] = {"range": ["10 mm", "40 mm"]}
    assert [parameter.name for parameter in dovetail.load(changed).parameters][-1] == "arm.sections.0.outer"
    changed = with_value("substructures.arm.material.loss_factor", {"same_as": "arm.material.poisson", "ratio": 4})
    changed["substructures"]["arm"]["material"]["poisson"] = {"range": [0, 0.3]}
    with pytest.raises(dovetail.DescriptionError, match=r"material.poisson = 0.3, material.loss_factor = 1.2: it must"):
        dovetail.load(changed)


def test_a_tied_parameter_is_checked_at_the_ends_of_the_range_it_is_tied_to():
    changed = copy.deepcopy(SOUND)
    stiff = {**copy.deepcopy(SOUND["joints"]["foot"]), "parameters": {"k": {"same_as": "foot.k", "ratio": -1}}}
    changed["joints"]["stiff"] = stiff
    with pytest.raises(dovetail.DescriptionError, match=r"joints.stiff.parameters.k.*\n  k must not be negative"):
        dovetail.load(changed)
    stiff["parameters"]["k"]["ratio"] = 0.5
    assert not [parameter for parameter in dovetail.load(changed).parameters if parameter.name == "stiff.k"]


def test_options_tied_to_those_of_another_part_are_tried_at_the_ends_of_their_ranges():
    changed = with_value("substructures.arm.sections.0.outer", {"range": ["20 mm", "40 mm"]})
    other = copy.deepcopy(SOUND["substructures"]["arm"])
    for key, ratio in (("outer", 1), ("inner", 0.9)):
        other["sections"][0][key] = {"same_as": "arm.sections.0.outer", "ratio": ratio}
    changed["substructures"]["other"] = other
    changed["joints"]["knee"] = {
        "model": "rigid",
        "connect": {"a": {"to": "arm", "at": 0.3}, "b": {"to": "other", "at": 0}},
    }
    assert "arm.sections.0.outer" in [parameter.name for parameter in dovetail.load(changed).parameters]
    other["sections"][0]["inner"] = "19 mm"
    other["sections"][0]["outer"]["ratio"] = 0.7
    with pytest.raises(dovetail.DescriptionError) as raised:
        dovetail.load(changed)
    (fault,) = raised.value.faults
    assert fault.where.endswith("substructures.other.sections[0].outer")
    assert fault.problem == "the part cannot have 14 mm there: the inner diameter must be smaller than the outer one."
    assert fault.remedy == "Narrow the range of 'arm.sections.0.outer', to which it is tied."


def test_an_unknown_option_of_a_part_with_very_many_dofs_is_refused():
    changed = with_value(YOUNG, {"range": [1e11, 2e11]})
    changed["substructures"]["arm"]["sections"][0]["elements"] = 400
    with pytest.raises(dovetail.DescriptionError, match="it has 802 DOFs, and its matrices are made anew"):
        dovetail.load({**changed, "response": {"at": "arm", "position": "node n401"}})


def test_two_responses_with_one_name_are_refused():
    changed = {key: value for key, value in SOUND.items() if key != "response"}
    changed["responses"] = [{"at": "arm", "position": f"node n{n}", "name": "tip"} for n in (3, 5)]
    with pytest.raises(dovetail.DescriptionError, match="another response has the name 'tip'"):
        dovetail.load(changed)
