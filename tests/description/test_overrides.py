"""Overrides of a description: by `extends`, in a dict, and by the `change` of a test in a series.

Each override has the effect that it describes, or is refused: none is passed over.
"""

from __future__ import annotations

import copy
import json
from typing import Any

import numpy as np
import pytest

import dovetail
from dovetail.series.reading import read_series

STEEL = {"young": "200 GPa", "density": "7800 kg/m^3", "poisson": 0.3}
BEAM = {"model": "timoshenko_beam", "material": STEEL, "sections": [{"length": "0.1 m", "outer": "10 mm"}]}


def joint(direction: str, to: str, at: Any, parameters: dict[str, Any], part: str = "left") -> dict[str, Any]:
    ends = {"a": {"to": part, "at": "100 mm"}, "b": {"to": to, "at": at}}
    return {"model": "spring_damper", "direction": direction, "connect": ends, "parameters": parameters}


BASE = {
    "dovetail": 1,
    "name": "base",
    "frequency": {"start": 50.0, "stop": 500.0, "step": 50.0},
    "substructures": {"left": BEAM, "right": BEAM, "base": {"model": "ground"}},
    "joints": {
        "lap": joint("x", "right", 0, {"k": {"range": [1e6, 1e9], "scale": "log"}, "c": {"value": 50.0}}),
        "tilt": joint("rz", "right", 0, {"kr": {"about": 1e3, "sd": "10 %"}, "cr": {"value": 0.01}}),
        "foot": joint("x", "base", 0, {"k": {"same_as": "lap.k", "ratio": 2.0}, "c": {"range": [1, 100]}}, "right"),
    },
    "response": {"at": "left", "position": 0, "quantity": "receptance"},
}
LAP, FOOT, TILT = ("joints", "lap", "parameters", "k"), ("joints", "foot", "parameters", "k"), ("joints", "tilt")
MATERIAL = ("substructures", "left", "material")
MISSPELT = [
    ("joints", "lapp"), ("joints", "lap", "dirction"), (*LAP[:-1], "kk"), (*LAP, "rnge"), (*TILT, "conect"),
    ("joints", "lap", "connect", "c"), ("joints", "lap", "connect", "a", "too"), ("substructures", "lft"),
    ("substructures", "left", "materal"), (*MATERIAL, "yung"), ("frequency", "stp"), ("response", "positon"),
    ("respnse",), ("calibraton",), ("identification", "sampels"), (*TILT, "parameters", "kr", "sdd"),
]  # fmt: skip
REFUSED = [
    (LAP, {"value": 5e7, "unit": "N/mm"}), (LAP, {"value": "5e7 N/m N/m"}), (LAP, {"sd": "10 %"}),
    (LAP, {"ratio": 3.0}), (LAP, {"same_as": "foot.k"}), (LAP, {"value": 5e7, "range": [1e6, 1e7]}),
    (LAP, {"range": [1e9, 1e6]}), (LAP, {"range": ["1e6 N/m", "1e9 N m/rad"]}), (LAP, {"value": 5e7, "scale": "log"}),
    (LAP, {"about": "10 %", "sd": "1 %"}), (LAP, {"range": ["10 %", "20 %"]}), (FOOT, {"ratio": "2 N/m"}),
    (LAP, {"about": "1e7 N/m", "sd": "1e6 N/mm", "scale": "log"}), (FOOT, {"same_as": "lap.kk"}),
    (FOOT, {"same_as": "lapp.k"}), (FOOT, {"same_as": "tilt.kr"}), (FOOT, {"same_as": "lap.c"}),
    (FOOT, {"ratio": -2.0}), (FOOT, {"same_as": "LAP.K"}), (FOOT, {"same_as": "lap.k", "ratio": 2, "value": 3}),
    ((*TILT, "parameters", "kr"), {"sd": "20 N/m"}), ((*TILT, "parameters", "kr"), {"sd": "-5 %"}),
    ((*MATERIAL, "young"), "210 GPa GPa"), ((*MATERIAL, "young_GPa"), 210), (("frequency", "unit"), "kHz"),
    (("response", "unit"), "um/N"), (("substructures", "left", "length"), "10 mm"), (("dovetail",), 2),
    (("response", "position"), "20"), (("substructures", "left", "model"), "lumped"),
]  # fmt: skip
TAKEN: list[tuple[tuple[str, ...], Any, str, Any]] = [
    (LAP, {"value": "5e7 N/m"}, "lap.k", None),
    (LAP, "5e7 N/m", "lap.k", None),
    (LAP, {"range": ["1 kN/mm", "1e8"]}, "lap.k", (1e6, 1e8, "log", "uniform")),
    (LAP, {"scale": "linear"}, "lap.k", (1e6, 1e9, "linear", "uniform")),
    (LAP, {"about": "1 kN/mm", "sd": "10 N/mm", "scale": "linear"}, "lap.k", (0.96e6, 1.04e6, "linear", "normal")),
    ((*TILT, "parameters", "kr"), {"sd": "20 %"}, "tilt.kr", (200.0, 1800.0, "linear", "normal")),
    ((*TILT, "parameters", "kr"), {"about": 2e3}, "tilt.kr", (1200.0, 2800.0, "linear", "normal")),
    ((*TILT, "parameters", "kr"), {"range": [1, 2]}, "tilt.kr", (1.0, 2.0, "log", "uniform")),
    (FOOT, {"range": [1e4, 1e5]}, "foot.k", (1e4, 1e5, "log", "uniform")),
    ((*MATERIAL, "poisson"), {"range": [0.25, 0.35]}, "left.material.poisson", (0.25, 0.35, "linear", "uniform")),
]  # fmt: skip
WAYS = ["extends", "dict", "change"]


def loaded(folder, way: str, path: tuple[str, ...], value: Any) -> dovetail.Assembly:
    for key in reversed(path):
        value = {key: value}
    (folder / "base.yaml").write_text(json.dumps(BASE))
    if way == "change":
        (folder / "m.csv").write_text("# quantity: receptance\nfrequency_Hz,real,imag\n100,1,0\n200,1,0\n")
        tests = {"one": {"measured": "m.csv", "change": value}}
        (folder / "s.yaml").write_text(json.dumps({"dovetail_series": 1, "assembly": "base.yaml", "tests": tests}))
        return read_series(folder / "s.yaml").tests[0].assembly
    if way == "dict":
        return dovetail.load({"extends": str(folder / "base.yaml"), **value})
    (folder / "over.yaml").write_text(json.dumps({"extends": "base.yaml", **value}))
    return dovetail.load(folder / "over.yaml")


@pytest.mark.sweep
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("value", [None, {}, 5, [], "5 N/m"], ids=str)
@pytest.mark.parametrize("path", MISSPELT, ids=".".join)
def test_an_override_of_something_that_does_not_exist_is_refused(tmp_path, way, path, value):
    with pytest.raises(dovetail.DovetailError):
        loaded(tmp_path, way, path, value)


@pytest.mark.sweep
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("path", "value"), REFUSED, ids=str)
def test_an_override_that_contradicts_itself_or_the_base_is_refused(tmp_path, way, path, value):
    with pytest.raises(dovetail.DovetailError):
        loaded(tmp_path, way, path, value)


@pytest.mark.sweep
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("path", "value", "name", "expected"), TAKEN, ids=str)
def test_an_override_has_the_effect_that_it_describes(tmp_path, way, path, value, name, expected):
    parameters = {p.name: p for p in loaded(tmp_path, way, path, value).parameters}
    assert (name in parameters) == (expected is not None)
    if expected is not None:
        p = parameters[name]
        assert (p.scale, p.prior) == expected[2:]
        np.testing.assert_allclose((p.lower, p.upper), expected[:2])


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("ratio", [3.0, "3", 0.5])
def test_another_ratio_of_a_tie_is_that_of_a_fixed_stiffness(tmp_path, way, ratio):
    theta = {"lap.k": 2e7, "tilt.kr": 1e3, "foot.c": 10.0}
    fixed = copy.deepcopy(BASE)
    fixed["joints"]["foot"]["parameters"]["k"] = {"value": 2e7 * float(ratio)}
    values = loaded(tmp_path, way, FOOT, {"ratio": ratio}).frf(theta)
    np.testing.assert_allclose(values, dovetail.load(fixed).frf(theta), rtol=1e-12)
