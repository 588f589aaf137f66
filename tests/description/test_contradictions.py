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
    "middle with another unit": ({K: {"about": "1 MN/m", "sd": 1e4}}, "10000.0 has no unit, and '1 MN/m' has one."),
    "phase in degrees": ({f"{CHAIN}phase": 5}, "Were 5 deg meant?"),
    "phase and sign": ({f"{CHAIN}phase": "180 deg", f"{CHAIN}sign": -1}, "turns the sign too, and 'sign' is given."),
    "range of the phase and sign": (
        {f"{CHAIN}phase": {"range": ["-180 deg", "180 deg"]}, f"{CHAIN}sign": "unknown"},
        "turns the sign too, and 'sign' is given.",
    ),
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
