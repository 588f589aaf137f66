"""What one function returns, the next one takes: results, their parameters, mappings and arrays."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import dovetail
from support.small_joints import ASSEMBLIES

TRUTH = {"k": 2.5e6, "c": 40.0}
POINT = [("mass", 0.0, "x")]
CONNECTED = {"a": {"to": "mass", "at": "0 mm"}, "b": {"to": "base", "at": "0 mm"}}
FUNCTIONS = {
    "frf": lambda assembly, theta: assembly.frf(theta),
    "frfs": lambda assembly, theta: assembly.frfs(theta),
    "frf_jacobian": lambda assembly, theta: assembly.frf_jacobian(theta)[1],
    "simulate": lambda assembly, theta: assembly.simulate(theta).values,
    "accelerance_amplitude": lambda assembly, theta: assembly.accelerance_amplitude(theta),
    "receptance": lambda assembly, theta: assembly.receptance(theta, POINT, POINT),
    "natural_frequencies": lambda assembly, theta: assembly.natural_frequencies(theta, 1),
    "modes": lambda assembly, theta: assembly.modes(theta, 1)[0].pole,
    "by_joint": lambda assembly, theta: next(iter(assembly.by_joint(theta).values())),
    "to_unit": lambda assembly, theta: assembly.to_unit(theta),
    "vector": lambda assembly, theta: assembly.vector(theta),
    "dovetail.modes": lambda assembly, theta: dovetail.modes(assembly, theta, count=1).natural_frequency,
    "dovetail.natural_frequencies": lambda assembly, theta: dovetail.natural_frequencies(assembly, theta, count=1),
    "dovetail.damping_ratios": lambda assembly, theta: dovetail.damping_ratios(assembly, theta, count=1),
    "dovetail.mode_shapes": lambda assembly, theta: dovetail.mode_shapes(assembly, theta, count=1)["mass"],
}


@pytest.fixture(scope="module")
def sdof():
    return dovetail.load(ASSEMBLIES / "sdof.yaml")


@pytest.fixture(scope="module")
def result(sdof):
    return dovetail.identify(sdof, sdof.simulate(TRUTH), "refined")


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_result_and_its_parameters_give_what_their_vector_gives(sdof, result, name):
    function = FUNCTIONS[name]
    expected = function(sdof, result.theta)
    values = {parameter.name: parameter.value for parameter in result.parameters.values()}
    texts = {parameter.name: f"{parameter.value!r} {parameter.unit}" for parameter in result.parameters.values()}
    for theta in (result, result.parameters, dict(result.parameters), values, texts):
        np.testing.assert_allclose(function(sdof, theta), expected, rtol=1e-12)


def test_fractions_are_any_arrays_of_one_number_for_each_parameter(sdof):
    np.testing.assert_array_equal(sdof.from_unit([0.5, 0.5]), sdof.from_unit(np.full(2, 0.5)))
    assert sdof.to_unit(sdof.from_unit(np.full((3, 4, 2), 0.25))) == pytest.approx(0.25)
    for wrong in ([0.5], 0.5, np.zeros((2, 3))):
        with pytest.raises(dovetail.ParameterError, match="does not fit 2 parameters"):
            sdof.from_unit(wrong)


def test_the_fit_starts_from_a_result(sdof, result):
    again = dovetail.identify(sdof, sdof.simulate(TRUTH), "refined", start=result)
    by_parameters = dovetail.identify(sdof, sdof.simulate(TRUTH), "refined", start=result.parameters)
    np.testing.assert_array_equal(again.theta, by_parameters.theta)


def test_predict_takes_a_result_or_its_parameters(sdof, result):
    expected = dovetail.predict(sdof, result)
    np.testing.assert_array_equal(dovetail.predict(sdof, result.parameters).values, expected.values)


def test_single_identified_parameters_stand_among_other_values(sdof, result):
    mixed = sdof.vector({"k": result.parameters["k"], "c": "30 N s/m"})
    np.testing.assert_allclose(mixed, [result.parameters["k"].value, 30.0])


def test_a_result_that_lacks_a_parameter_is_refused_instead_of_taking_the_middle(sdof, result):
    with pytest.raises(dovetail.ParameterError, match=r"lack c\.") as error:
        sdof.frf({"k": result.parameters["k"]})
    assert "dovetail.predict" in str(error.value)


def test_a_result_of_another_assembly_is_refused(result):
    with pytest.raises(dovetail.ParameterError, match="has no such parameter"):
        dovetail.load(ASSEMBLIES / "bt40_er32.yaml").frf(result)


def test_another_unit_is_refused(sdof):
    other = SimpleNamespace(value=1.0, unit="m", joint="mount")
    with pytest.raises(dovetail.ParameterError, match="identified in m, and its unit is N/m here"):
        sdof.frf({"k": other, "c": 3.0})


def test_parameters_of_a_single_joint_are_found_by_the_joint_where_there_are_several(sdof, result):
    section = {"model": "spring_damper", "direction": "x", "connect": CONNECTED}
    assembly = dovetail.load(
        {
            "dovetail": 1,
            "name": "two mounts",
            "frequency": {"start": "1 Hz", "stop": "600 Hz", "step": "1 Hz"},
            "substructures": {
                "mass": {"model": "lumped", "masses": [{"mass": "1 kg"}]},
                "base": {"model": "ground"},
            },
            "joints": {"mount": section, "other": {**section, "parameters": {"k": 1.0, "c": 1.0}}},
            "response": {"at": "mass", "position": "0 mm", "direction": "x", "quantity": "accelerance"},
        }
    )
    np.testing.assert_allclose(assembly.vector(result), result.theta)


@pytest.mark.parametrize("values", [{"k": -3e5}, {"k": "-3e5 N/m"}, {"c": -1.0}, {"mount.k": -1.0}], ids=str)
def test_a_negative_value_of_a_parameter_with_a_positive_range_is_refused(sdof, values):
    with pytest.raises(dovetail.ParameterError, match="its range in the description is not negative"):
        sdof.frf(values)
