"""The identified joint in another assembly."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import dovetail
from dovetail.errors import ParameterError


@pytest.fixture(scope="module")
def result(model: dovetail.Identifier, measured: dovetail.Frf) -> dovetail.Identification:
    return model.identify(measured, "network")


def another(
    sdof: dovetail.Assembly, joints: dict[str, dict[str, Any]] | None = None, mass: str = "2 kg"
) -> dovetail.Assembly:
    """A heavier mass, on the joints that are given by their parameters, and another quantity."""
    description = json.loads(sdof.description.text)
    description["name"] = "heavier"
    description["substructures"]["mass"]["masses"][0]["mass"] = mass
    description["response"]["quantity"] = "receptance"
    mount = description["joints"]["mount"]
    if joints is not None:
        description["joints"] = {name: {**mount, "parameters": parameters} for name, parameters in joints.items()}
    return dovetail.load(description)


def exact(assembly: dovetail.Assembly, stiffness: float, damping: float, mass: float = 2.0) -> np.ndarray:
    omega = 2 * np.pi * assembly.frequency
    return 1.0 / (stiffness + 1j * omega * damping - mass * omega**2)


def test_the_frf_of_another_mass_on_the_same_joint_is_predicted(
    sdof: dovetail.Assembly, result: dovetail.Identification
) -> None:
    other = another(sdof)
    frf = dovetail.predict(other, result)
    assert frf.quantity == "receptance"
    np.testing.assert_array_equal(frf.frequency, other.frequency)
    np.testing.assert_allclose(frf.values, exact(other, *result.theta), rtol=1e-9)


def test_a_joint_of_another_name_is_matched_by_its_parameters(
    sdof: dovetail.Assembly, result: dovetail.Identification
) -> None:
    other = another(sdof, {"clamp": {}})
    np.testing.assert_allclose(dovetail.predict(other, result).values, exact(other, *result.theta), rtol=1e-9)


def test_an_assembly_with_another_known_joint_is_predicted(
    sdof: dovetail.Assembly, result: dovetail.Identification
) -> None:
    other = another(sdof, {"mount": {}, "side": {"k": {"value": 1e6}, "c": {"value": 5.0}}})
    assert [parameter.name for parameter in other.parameters] == ["mount.k", "mount.c"]
    expected = exact(other, result.theta[0] + 1e6, result.theta[1] + 5.0)
    np.testing.assert_allclose(dovetail.predict(other, result).values, expected, rtol=1e-9)


def test_a_joint_that_is_damped_in_another_way_is_refused(
    sdof: dovetail.Assembly, result: dovetail.Identification
) -> None:
    description = json.loads(sdof.description.text)
    description["joints"]["mount"]["structural_damping"] = "20 Hz"
    with pytest.raises(ParameterError, match="its structural damping was none where it was identified, and is 20 Hz"):
        dovetail.predict(dovetail.load(description), result)


def test_a_joint_of_another_name_that_is_damped_in_another_way_is_refused(
    sdof: dovetail.Assembly, result: dovetail.Identification
) -> None:
    description = json.loads(sdof.description.text)
    description["joints"] = {"clamp": {**description["joints"]["mount"], "structural_damping": "20 Hz"}}
    with pytest.raises(ParameterError, match="its structural damping was none where it was identified, and is 20 Hz"):
        dovetail.predict(dovetail.load(description), result)


def test_a_joint_that_stands_in_both_assemblies_is_not_taken_for_another(
    sdof: dovetail.Assembly, result: dovetail.Identification
) -> None:
    known = {"k": {"value": 1e6}, "c": {"value": 5.0}}
    with pytest.raises(ParameterError) as caught:
        dovetail.predict(another(sdof, {"mount": known, "side": {}}), result)
    assert [fault.where for fault in caught.value.faults] == ["parameters side.k, side.c"]
    other = another(sdof, {"clamp": {}, "side": known})
    expected = exact(other, result.theta[0] + 1e6, result.theta[1] + 5.0)
    np.testing.assert_allclose(dovetail.predict(other, result).values, expected, rtol=1e-9)


def test_what_the_other_description_fixes_stays(sdof: dovetail.Assembly, result: dovetail.Identification) -> None:
    other = another(sdof, {"mount": {"c": {"value": 7.0}}})
    with pytest.warns(UserWarning, match="joint mount: c is 7 N s/m here, and was"):
        predicted = dovetail.predict(other, result)
    np.testing.assert_allclose(predicted.values, exact(other, result.theta[0], 7.0), rtol=1e-9)


def test_predictions_use_the_known_parameters_of_the_identified_joint(
    sdof: dovetail.Assembly, result: dovetail.Identification
) -> None:
    stiffness_only = replace(result, parameters={"k": result.parameters["k"]}, known={"mount.c": 7.0})
    other = another(sdof)
    np.testing.assert_allclose(
        dovetail.predict(other, stiffness_only).values, exact(other, result.theta[0], 7.0), rtol=1e-9
    )


def test_a_parameter_that_was_not_identified_is_named(sdof: dovetail.Assembly) -> None:
    with pytest.raises(ParameterError) as caught:
        dovetail.predict(another(sdof, {"mount": {}, "side": {}}), {"mount.k": 1e6, "mount.c": 5.0, "side.k": 1e6})
    assert len(caught.value.faults) == 1
    assert caught.value.faults[0].where == "parameter side.c"
    assert "mount.k, mount.c, side.k" in str(caught.value)


def test_one_identified_joint_is_not_taken_for_two(sdof: dovetail.Assembly, result: dovetail.Identification) -> None:
    with pytest.raises(ParameterError) as caught:
        dovetail.predict(another(sdof, {"mount": {}, "side": {}}), result)
    assert [fault.where for fault in caught.value.faults] == ["parameters side.k, side.c"]


def test_a_parameter_in_another_unit_is_refused(sdof: dovetail.Assembly, result: dovetail.Identification) -> None:
    rotational = replace(result.parameters["k"], unit="N m/rad")
    changed = replace(result, parameters={"k": rotational, "c": result.parameters["c"]})
    with pytest.raises(ParameterError, match="identified in N m/rad"):
        dovetail.predict(another(sdof), changed)


def test_values_by_name_do_as_well(sdof: dovetail.Assembly) -> None:
    other = another(sdof)
    given: list[dict[str, Any]] = [
        {"k": 1e6, "c": 5.0},
        {"mount.k": 1e6, "mount.c": np.float32(5.0)},
        {"k": "1 MN/m", "c": "5 N s/m"},
    ]
    for values in given:
        np.testing.assert_allclose(dovetail.predict(other, values).values, exact(other, 1e6, 5.0), rtol=1e-9)
    for wrong in ("stiff", "1 mm", None):
        with pytest.raises(ParameterError, match="parameter k"):
            dovetail.predict(other, {"k": wrong, "c": 5.0})


def test_the_determined_sign_is_used_in_predictions(sdof: dovetail.Assembly) -> None:
    description = json.loads(sdof.description.text)
    description["response"]["calibration"] = {"sign": "unknown"}
    assembly = dovetail.load(description)
    values = -sdof.frf({"k": 1e6, "c": 20.0})
    noise = 1e-3 * np.abs(values).mean() * np.random.default_rng(0).standard_normal((2, len(values)))
    frf = dovetail.Frf(sdof.frequency, values + noise[0] + 1j * noise[1], "accelerance")
    identified = dovetail.identify(assembly, frf, "refined", cause_seconds=0.0)
    assert identified.known["response.sign"] == -1.0
    np.testing.assert_allclose(dovetail.predict(assembly, identified).values, values, rtol=0.01)
    with pytest.raises(ParameterError, match="level"):
        dovetail.predict_band(assembly, dovetail.identify(assembly, frf, form="laplace"), level=1.5)


def test_a_predicted_frf_lies_within_its_band_in_every_quantity(sdof: dovetail.Assembly) -> None:
    """Also far below the resonance, where the accelerance is ten thousand times smaller than at its peak."""
    frf = dovetail.noisy_frf(sdof.simulate({"k": 2.5e6, "c": 60.0}), 0.01, 0)
    result = dovetail.identify(sdof, frf, form="laplace", cause_seconds=0.0)
    above = []
    for quantity in ("accelerance", "receptance"):
        description = json.loads(another(sdof).description.text)
        description["response"]["quantity"] = quantity
        other = dovetail.load(description)
        band, amplitude = dovetail.predict_band(other, result), dovetail.predict(other, result).amplitude
        assert np.all((band.lower < amplitude) & (amplitude < band.upper))
        above.append(band.upper / amplitude)
    np.testing.assert_allclose(above[0], above[1], rtol=0.02)


def test_one_odd_measurement_does_not_end_a_batch(sdof: dovetail.Assembly) -> None:
    good = dovetail.Frf(sdof.frequency, sdof.frf({"k": 1e6, "c": 20.0}), "accelerance", label="good")
    odd = dovetail.Frf(sdof.frequency, np.full(len(sdof.frequency), 1e-30 + 0j), "accelerance", label="odd")
    batch = dovetail.identify_many(sdof, [good, odd], processes=1, samples=20, cause_seconds=0.0)
    assert "good" in batch.results


def test_a_mass_is_not_taken_off_a_displacement_per_moment_by_itself() -> None:
    with pytest.raises(dovetail.MeasurementError, match="drive-point"):
        dovetail.remove_accelerometer_mass(dovetail.Frf([1.0, 2.0], [1.0, 1.0], "accelerance", moment=True), 0.001)
