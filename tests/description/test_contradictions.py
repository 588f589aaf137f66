"""Descriptions that say one thing in two places, or a thing that changes nothing: each is refused or reported."""

from __future__ import annotations

import copy
from typing import Any

import pytest

import dovetail

BAR = {
    "dovetail": 1,
    "name": "bar",
    "frequency": {"start": 20.0, "stop": 2000.0, "step": 20.0},
    "substructures": {
        "bar": {
            "model": "timoshenko_beam",
            "material": {"young": "206 GPa", "density": "7850 kg/m^3"},
            "sections": [{"length": "200 mm", "outer": "20 mm", "elements": 10}],
        },
        "base": {"model": "ground"},
    },
    "joints": {
        "clamp": {
            "model": "spring_damper",
            "connect": {"a": {"to": "bar", "at": "200 mm"}, "b": {"to": "base", "at": "0 mm"}},
            "parameters": {
                "k": {"range": ["1e6 N/m", "1e9 N/m"], "scale": "log"},
                "c": {"value": 10.0},
                "kr": {"range": ["1e3 N m/rad", "1e6 N m/rad"], "scale": "log"},
                "cr": {"value": 0.1},
            },
        }
    },
    "response": {"at": "bar", "position": "0 mm", "quantity": "accelerance"},
}


def changed(changes: dict[str, Any]) -> dict[str, Any]:
    """Return the description of a clamped bar with other values at some places."""
    whole = copy.deepcopy(BAR)
    for path, value in changes.items():
        *steps, last = path.split("/")
        section: Any = whole
        for step in steps:
            section = section[int(step)] if isinstance(section, list) else section.setdefault(step, {})
        section[int(last) if isinstance(section, list) else last] = value
    return whole


K, YOUNG = "joints/clamp/parameters/k", "substructures/bar/material/young"
CHAIN = "response/calibration/"
FAULTS = {
    "range with one unit": ({K: {"range": [1, "1000 N/um"]}}, "1 has no unit, and '1000 N/um' has one."),
    "range of an option": ({YOUNG: {"range": ["190 GPa", 215]}}, "215 has no unit, and '190 GPa' has one."),
    "deviation without percent": ({YOUNG: {"about": "206 GPa", "sd": 2}}, "is 9.7e-12 times the middle."),
    "middle with another unit": (
        {"substructures/bar/material/density": {"about": "7.85 g/cm^3", "sd": 2}},
        "2 has no unit, and '7.85 g/cm^3' has one.",
    ),
    "phase in degrees": ({f"{CHAIN}phase": 5}, "Were 5 deg meant?"),
    "phase and sign": ({f"{CHAIN}phase": "180 deg", f"{CHAIN}sign": -1}, "turns the sign too, and 'sign' is given."),
    "range of the phase and sign": (
        {f"{CHAIN}phase": {"range": ["-180 deg", "180 deg"]}, f"{CHAIN}sign": "unknown"},
        "turns the sign too, and 'sign' is given.",
    ),
    "tie to nothing": (
        {"joints/clamp/parameters/cr": {"same_as": "clamp.cr", "ratio": 0}},
        "a ratio of 0 ties nothing.",
    ),
    "rate of decay in Hz": ({f"{CHAIN}window": "12 Hz"}, "'12 Hz' may be a rate or 2 pi times one. Write it in 1/s."),
    "rate of decay in rad/s": ({f"{CHAIN}window": "12 rad/s"}, "Write it in 1/s."),
    "sensors twice": (
        {"calibration": {"mass": "5 g", "at": 2 * [{"at": "bar", "position": "0 mm"}]}},
        "this is the same place as calibration.at[0].",
    ),
    "band outside": ({"frequency/bands": [["3 kHz", "4 kHz"]]}, "3000 to 4000 Hz lies outside of what is compared"),
    "band beyond": ({"frequency/bands": [["100 Hz", "4 kHz"]]}, "100 to 4000 Hz reaches beyond what is compared"),
    "nothing left out": (
        {"frequency/bands": [[100, 1000]], "frequency/without": [[1500, 1600]]},
        "1500 to 1600 Hz lies outside of what is compared",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("changes", "said"), FAULTS.values(), ids=FAULTS)
def test_a_contradiction_is_refused(changes, said):
    with pytest.raises(dovetail.DescriptionError) as caught:
        dovetail.load(changed(changes))
    assert said in str(caught.value)


SOUND = {
    "SI next to a unit": {K: {"range": [1e6, "1e9 N/m"]}},
    "SI next to another unit": {K: {"range": ["1 kN/mm", "1e8"]}},
    "zero next to a unit": {f"{CHAIN}delay": {"range": [0, "20 us"]}},
    "part of the middle": {K: {"about": "10 MN/m", "sd": "10 %"}},
    "phase within a quarter": {f"{CHAIN}phase": {"about": "0 deg", "sd": "5 deg"}, f"{CHAIN}sign": "unknown"},
    "turned phase": {f"{CHAIN}phase": "180 deg"},
    "between two lines": {"frequency/without": [["48 Hz", "52 Hz"]]},
    "a little beyond": {"frequency/bands": [["20 Hz", "2.5 kHz"]]},
}  # fmt: skip


@pytest.mark.parametrize("changes", SOUND.values(), ids=SOUND)
def test_what_only_looks_like_one_is_accepted(changes):
    assert dovetail.find_warnings(dovetail.load(changed(changes))) == ()


def remarks(changes: dict[str, Any]) -> str:
    return "\n".join(dovetail.find_warnings(dovetail.load(changed(changes))))


CLAMP = BAR["joints"]["clamp"]
SPRINGS = {"model": "spring_damper", "connect": CLAMP["connect"]}
TIP = {"to": "tip", "at": "0 mm"}
REMARKED = {
    "exponents of ten": ({K: {"range": [6, 9], "scale": "log"}}, "6 N/m to 9 N/m is far from 10000 N/m to 1e+10 N/m"),
    "value of another unit": ({K: {"value": "1e13 N/m"}}, "parameters.k: 1e+13 N/m is far from"),
    "loss factor for a frequency": (
        {"joints/clamp/structural_damping": 0.02},
        "structural_damping: 0.02 Hz is far from the lines",
    ),
    "joint twice": ({"joints/other": CLAMP}, "'clamp', 'other' are of the same model and connect the same nodes"),
    "the same to two grounds": (
        {
            "substructures/floor": {"model": "ground"},
            "joints/other": {**CLAMP, "connect": {**CLAMP["connect"], "b": {"to": "floor", "at": "0 mm"}}},
        },
        "clamp.k and other.k: they change all FRFs in the same way",
    ),
    "spring next to a rigid joint": (
        {"joints/weld": {"model": "rigid", "connect": CLAMP["connect"]}},
        "clamp: none of its parameters (k, kr) changes an FRF",
    ),
    "names": (
        {
            "response/name": "tip",
            "substructures/Bar": {"model": "lumped", "masses": [{"mass": "1 kg"}]},
            "joints/end": {
                "model": "rigid",
                "connect": {"a": {"to": "Bar", "at": "0 mm"}, "b": {"to": "bar", "at": "0 mm"}},
            },
        },
        "substructures: the names 'bar' and 'Bar' differ by upper and lower case only.",
    ),
    "gain in percent": ({f"{CHAIN}gain": "5 %"}, "Was its uncertainty meant"),
    "sensor in grams": ({f"{CHAIN}mass": 10}, "Were 10 g meant?"),
    "delay in microseconds": ({f"{CHAIN}delay": 20}, "Were 20 us meant?"),
    "mass of an augmentation": (
        {"identification/augmentation": {"mass": 5}},
        "identification.augmentation.mass: 5 kg; were 5 g meant?",
    ),
    "final value of a window": ({f"{CHAIN}window": 0.01}, "a decay rate of 0.01 1/s changes nothing"),
    "loss factor in percent": ({"substructures/bar/material/loss_factor": 0.3}, "Were 0.3 % meant? Write 0.003."),
    "digit of the density": ({"substructures/bar/material/density": 785}, "nothing of 206 GPa is as light"),
    "inertia in g mm^2": (
        {
            "substructures/tip": {"model": "lumped", "masses": [{"mass": "20 g", "inertia": 1}]},
            "joints/end": {"model": "rigid", "connect": {"a": TIP, "b": {"to": "bar", "at": "0 mm"}}},
        },
        "a ring with a radius of 7.07 m",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("changes", "said"), REMARKED.values(), ids=REMARKED)
def test_what_is_hardly_meant_is_reported(changes, said):
    assert said in remarks(changes)


UNREMARKED = {
    "no spring": {K: {"value": 0}},
    "soft mount": {K: {"range": ["500 N/m", "5e4 N/m"], "scale": "log"}},
    "damping alloy": {"substructures/bar/material/loss_factor": 0.05},
    "prior of the gain": {f"{CHAIN}gain": {"about": 1, "sd": "5 %"}},
    "springs at two places": {
        "joints/other": {**CLAMP, "connect": {**CLAMP["connect"], "a": {"to": "bar", "at": "100 mm"}}}
    },
    "known priors in parallel": {
        "joints/other": {**CLAMP, "model": "spring_damper", "direction": "x", "parameters": {
            "k": {"about": "1e7 N/m", "sd": "5 %"}, "c": {"value": 1.0}}},
    },
}  # fmt: skip


@pytest.mark.parametrize("changes", UNREMARKED.values(), ids=UNREMARKED)
def test_what_is_usual_is_not_reported(changes):
    assert remarks(changes) == ""


AUGMENTED = {
    "reuse": ({"reuse": 5}, "'reuse' has no effect without 'fresh: true'"),
    "decades": ({"multiplicative": 0, "multiplicative_decades": 2}, "without 'multiplicative'"),
    "number of a file": ({"like_index": 2}, "'like_index' has no effect without 'like'"),
}


@pytest.mark.parametrize(("section", "said"), AUGMENTED.values(), ids=AUGMENTED)
def test_an_option_of_the_training_without_effect_is_refused(section, said):
    with pytest.raises(dovetail.DescriptionError, match="has no effect") as caught:
        dovetail.load(changed({"identification/augmentation": section}))
    assert said in str(caught.value)


def test_tensions_of_a_bolt_in_two_units_are_refused():
    lap = {
        "model": "bolted",
        "nodes": 1,
        "preload": {"force": 5, "reference": "10 kN"},
        "connect": CLAMP["connect"],
    }
    with pytest.raises(dovetail.DescriptionError, match="the force is 5 N, the reference 10000 N"):
        dovetail.load(changed({"joints/lap": lap}))
