"""An identified joint in an assembly whose description of it differs from the one with which it was identified."""

from __future__ import annotations

import copy
import json
import warnings
from typing import Any

import numpy as np
import pytest

import dovetail
from dovetail.errors import ParameterError
from dovetail.identification.result_file import result_from_json

FREE = {"kt": {"range": [1e6, 1e9]}, "ct": {"range": [1.0, 1e3]}, "kr": {"value": 1e3}, "cr": {"value": 0.01}}
TRUE = {"kt": 3e7, "ct": 50.0}


def beam(elements: int) -> dict[str, Any]:
    material = {"young": "200 GPa", "density": "7800 kg/m^3", "poisson": 0.3, "loss_factor": 0.002}
    sections = [{"length": "100 mm", "outer": "10 mm", "elements": elements}]
    return {"model": "timoshenko_beam", "material": material, "sections": sections}


def lap(nodes: int = 3, parameters: dict[str, Any] | None = None, **options: Any) -> dict[str, Any]:
    """Two bars that overlap by 20 mm."""
    places = np.linspace(0.0, 0.02, nodes)
    ends = {"a": {"to": "left", "at": (places + 0.08).tolist()}, "b": {"to": "right", "at": places.tolist()}}
    joint = {"model": "bolted", "nodes": nodes, "connect": ends, "parameters": {**FREE, **(parameters or {})}}
    return {
        "dovetail": 1,
        "name": "lap",
        "frequency": {"start": 50.0, "stop": 2000.0, "step": 25.0},
        "substructures": {"left": beam(5 * (nodes - 1)), "right": beam(5 * (nodes - 1))},
        "joints": {"lap": {**joint, **options}},
        "response": {"at": "left", "position": 0, "quantity": "receptance"},
    }


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """The joint, written and read again."""
    assembly = dovetail.load(lap())
    measured = dovetail.noisy_frf(assembly.simulate(TRUE), 1e-3, 0)
    file = tmp_path_factory.mktemp("result") / "result.json"
    file.write_text(json.dumps(dovetail.identify(assembly, measured, "refined", cause_seconds=0.0).to_dict()))
    return dovetail.load_result(file)


def values(result) -> dict[str, float]:
    return {name: parameter.value for name, parameter in result.parameters.items()}


@pytest.mark.sweep
@pytest.mark.parametrize("quantity", ["receptance", "mobility", "accelerance"])
@pytest.mark.parametrize("frequency", [{"lines": 7}, {"start": 500.0, "stop": 520.0, "step": 10.0}, {"stop": 9000.0}])
@pytest.mark.parametrize(
    "point", [{}, {"at": "right", "position": "100 mm"}, {"force": {"at": "right", "position": 0}}]
)
@pytest.mark.parametrize("density", ["7800 kg/m^3", "2700 kg/m^3"])
def test_the_same_joint_elsewhere_has_the_frf_of_its_values(result, quantity, frequency, point, density):
    other = lap()
    other["response"] |= {**point, "quantity": quantity}
    axis = {**other["frequency"], **frequency}
    other["frequency"] = {key: value for key, value in axis.items() if key != "step" or "lines" not in axis}
    other["substructures"]["left"]["material"]["density"] = density
    assembly = dovetail.load(other)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        predicted = dovetail.predict(assembly, result)
    assert predicted.quantity == quantity
    np.testing.assert_allclose(predicted.values, assembly.frf(values(result)), rtol=1e-12)


PRELOAD = {"force": "2 kN", "reference": "1 kN"}


@pytest.mark.parametrize(
    ("other", "words"),
    [
        (lap(5), "joint lap: nodes is 5 here, and was 3 where it was identified"),
        (lap(preload=PRELOAD), "preload.reference is 1000.0 here, and was None"),
        (lap(parameters={"kr": {"value": 2e3}}), "kr is 2000 N m/rad here, and was 1000 N m/rad"),
        (lap(parameters={"ct": {"value": 7.0}}), "ct is 7 N s/m here, and was 5"),
    ],
)
def test_another_option_or_known_value_gives_a_warning(result, other, words):
    with pytest.warns(UserWarning, match=words):
        dovetail.predict(dovetail.load(other), result)


def test_options_that_joints_may_differ_in_give_none(result):
    tight = lap(preload=PRELOAD)
    assembly = dovetail.load(tight)
    identified = dovetail.identify(assembly, assembly.simulate(TRUE), "refined", cause_seconds=0.0)
    tight["joints"]["lap"]["preload"] = {**PRELOAD, "force": "4 kN"}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        dovetail.predict(dovetail.load(tight), identified)


def test_a_joint_of_another_model_is_refused(result):
    other = lap()
    parameters = {"k": {"range": [1e6, 1e9]}, "c": {"value": 1.0}}
    other["joints"]["lap"] |= {"model": "spring_damper", "direction": "x", "parameters": parameters}
    with pytest.raises(ParameterError, match="needs it, and the identification does not hold it"):
        dovetail.predict(dovetail.load(other), result)
    stored = copy.deepcopy(result.to_dict())
    stored["provenance"]["description"] = stored["provenance"]["description"].replace('"bolted"', '"another_lap"')
    with pytest.raises(ParameterError, match="it is a 'bolted' here, and the joint was identified as a 'another_lap'"):
        dovetail.predict(dovetail.load(lap()), result_from_json(json.dumps(stored), "result.json"))


def test_responses_with_chains_that_are_exchanged_are_refused():
    chain = {"calibration": {"gain": {"range": [0.5, 2.0]}}, "quantity": "receptance", "position": "0 mm"}
    whole = lap()
    del whole["response"]
    whole["responses"] = [{"at": "left", **chain}, {"at": "right", **chain}]
    assembly = dovetail.load(whole)
    theta = {**TRUE, "response_1.gain": 1.2, "response_2.gain": 0.8}
    measured = [assembly.at(point).simulate(theta) for point in range(2)]
    identified = dovetail.identify(assembly, measured, "refined", cause_seconds=0.0)
    predicted = dovetail.predict(assembly, identified)
    np.testing.assert_allclose(predicted.values, measured[0].values, rtol=1e-3)
    whole["responses"].reverse()
    with pytest.raises(
        ParameterError, match=r"response_\d\n  it is at (left|right), 0 mm here, and its measurement chain"
    ):
        dovetail.predict(dovetail.load(whole), identified)


def test_a_value_that_is_given_twice_is_refused():
    with pytest.raises(ParameterError, match=r"kt is given with and without the name of its joint"):
        dovetail.predict(dovetail.load(lap()), {**TRUE, "lap.kt": 4e7})


def test_a_name_that_the_assembly_does_not_have_gives_a_warning():
    with pytest.warns(UserWarning, match="assembly 'lap' has no parameter ks"):
        dovetail.predict(dovetail.load(lap()), {**TRUE, "ks": 1.0})
