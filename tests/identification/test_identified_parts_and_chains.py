"""Unknown options of parts and of measurement chains are identified together with a joint, by every method."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import dovetail
from dovetail.identification.one_measurement import check_mass
from dovetail.identification.unknown_signs import _sign
from dovetail.problem import Problem

MASSES: dict[str, Any] = {
    "dovetail": 1,
    "name": "two masses",
    "frequency": {"start": "5 Hz", "stop": "120 Hz", "step": "0.5 Hz"},
    "substructures": {
        "base": {"model": "ground"},
        "low": {"model": "lumped", "masses": [{"mass": "4 kg"}]},
        "high": {"model": "lumped", "masses": [{"mass": {"range": ["1 kg", "6 kg"], "scale": "log"}}]},
    },
    "joints": {
        "foot": {
            "model": "spring_damper",
            "direction": "x",
            "connect": {"a": {"to": "base", "at": 0}, "b": {"to": "low", "at": 0}},
            "parameters": {"k": {"range": [1e5, 1e7], "scale": "log"}, "c": {"range": [1, 1000], "scale": "log"}},
        },
        "neck": {
            "model": "spring_damper",
            "direction": "x",
            "connect": {"a": {"to": "low", "at": 0}, "b": {"to": "high", "at": 0}},
            "parameters": {"k": {"same_as": "foot.k", "ratio": 0.5}, "c": {"same_as": "foot.c"}},
        },
    },
}
NECK = {"k": {"same_as": "foot.k", "ratio": 0.5}}
DRIVE: dict[str, Any] = {"at": "low", "position": 0, "quantity": "receptance"}
TRANSFER: dict[str, Any] = {
    "at": "high",
    "position": 0,
    "quantity": "accelerance",
    "force": {"at": "low", "position": 0},
}
TRUTH = {"foot.k": 1.3e6, "foot.c": 60.0, "high.masses.0.mass": 2.3}


def receptances(frequency: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Receptance of the lower mass, and of the upper one per force at the lower one, by the 2 x 2 matrices."""
    omega, k, c = 2.0 * np.pi * frequency, TRUTH["foot.k"], TRUTH["foot.c"]
    neck = 0.5 * k + 1j * omega * c
    low = k + 1j * omega * c + neck - omega**2 * 4.0
    high = neck - omega**2 * TRUTH["high.masses.0.mass"]
    determinant = low * high - neck**2
    return high / determinant, neck / determinant


def measured(assembly: dovetail.Assembly, values: list[np.ndarray], error: float = 0.01) -> list[dovetail.Frf]:
    rng = np.random.default_rng(4)
    frfs = []
    for response, frf in zip(assembly.description.responses, values, strict=True):
        noise = (rng.normal(size=frf.shape) + 1j * rng.normal(size=frf.shape)) / np.sqrt(2.0)
        frfs.append(dovetail.Frf(assembly.frequency, frf * (1.0 + error * noise), response.quantity))
    return frfs


def as_measured(assembly: dovetail.Assembly, gain: float = 1.0, delay: float = 0.0) -> list[np.ndarray]:
    drive, transfer = receptances(assembly.frequency)
    omega = 2.0 * np.pi * assembly.frequency
    chain = gain * np.exp(-1j * omega * delay)
    return [chain * drive, -(omega**2) * transfer][: len(assembly.description.responses)]


def holds(result: dovetail.Identification, name: str, truth: float) -> bool:
    low, high = result.interval[name]
    return bool(low <= truth <= high)


def test_masses_ties_and_a_chain_are_identified_with_a_transfer_frf():
    chain = {"gain": {"range": [0.5, 2.0], "scale": "log"}, "delay": {"range": ["-1 ms", "1 ms"]}, "sign": "unknown"}
    assembly = dovetail.load({**MASSES, "responses": [{**DRIVE, "name": "tip", "calibration": chain}, TRANSFER]})
    frfs = measured(assembly, as_measured(assembly, gain=-1.2, delay=0.3e-3))
    result = dovetail.identify(assembly, frfs, "posterior")
    assert result.adequacy.word == "to the noise"
    assert result.known["tip.sign"] == -1.0
    truth = {**TRUTH, "tip.gain": 1.2, "tip.delay": 0.3e-3}
    assert set(result.parameters) == set(truth)
    for name, value in truth.items():
        assert result.parameters[name].value == pytest.approx(value, rel=0.03)
    assert sum(holds(result, name, value) for name, value in truth.items()) >= 4
    assert result.parameters["tip.gain"].joint == "tip"
    assert result.parameters["high.masses.0.mass"].joint == "high"


def test_a_tied_parameter_is_reported_with_its_value(tmp_path):
    description = {**MASSES, "response": DRIVE, "joints": {**MASSES["joints"]}}
    description["joints"]["neck"] = {**MASSES["joints"]["neck"], "parameters": {**NECK, "c": {"value": 60}}}
    description["joints"]["foot"] = {
        **MASSES["joints"]["foot"],
        "parameters": {"k": {"range": [1e5, 1e7], "scale": "log"}, "c": {"same_as": "neck.c", "ratio": 2}},
    }
    assembly = dovetail.load(description)
    frf = assembly.simulate({"foot.k": 1.3e6, "high.masses.0.mass": 2.3})
    result = dovetail.identify(assembly, frf, "posterior", form="laplace")
    assert result.known == {"neck.c": 60.0, "foot.c": 120.0}
    free, _, tied = result.table
    assert (tied.name, tied.tied_to, tied.unit, tied.verdict, tied.joint) == (
        "neck.k", "foot.k", "N/m", free.verdict, "neck")  # fmt: skip
    for name in ("estimate", "interval_low", "interval_high", "range_low", "range_high", "best_fit"):
        assert getattr(tied, name) == 0.5 * getattr(free, name)
    (tmp_path / "result.json").write_text(json.dumps(result.to_dict()))
    loaded = dovetail.load_result(tmp_path)
    assert loaded.table[2].estimate == pytest.approx(tied.estimate)
    parts = {**MASSES["substructures"], "high": {"model": "lumped", "masses": [{"mass": "2.3 kg"}]}}
    elsewhere = {**MASSES, "response": DRIVE, "substructures": parts, "joints": {**MASSES["joints"]}}
    elsewhere["joints"]["neck"] = {**MASSES["joints"]["foot"], "connect": MASSES["joints"]["neck"]["connect"]}
    other = dovetail.load(elsewhere)
    predicted = dovetail.predict(other, loaded)
    own = {"foot.k": free.best_fit, "foot.c": 120.0, "neck.k": tied.best_fit, "neck.c": 60.0}
    np.testing.assert_allclose(predicted.values, other.frf(own), rtol=1e-9)
    assert dovetail.predict_band(other, loaded).upper.shape == predicted.values.shape
    page = dovetail.write_report(result, tmp_path / "report.html").read_text()
    assert "neck.k" in page
    assert "tied to foot.k" in page


def test_a_normal_prior_decides_what_the_measurement_does_not():
    """Without phase and with a free gain, the prior alone decides a common factor of stiffness and mass."""
    free = {**MASSES, "substructures": {**MASSES["substructures"]}}
    free["substructures"]["low"] = {"model": "lumped", "masses": [{"mass": {"about": "4 kg", "sd": "3 %"}}]}
    response = {**DRIVE, "calibration": {"gain": {"range": [0.2, 5.0], "scale": "log"}}}
    assembly = dovetail.load({**free, "response": response})
    frfs = measured(assembly, as_measured(assembly, gain=1.5))
    result = dovetail.identify(assembly, frfs, "posterior")
    fitted = {name: parameter.value for name, parameter in result.parameters.items()}
    assert fitted["low.masses.0.mass"] == pytest.approx(4.0, rel=0.01)
    assert fitted["response.gain"] == pytest.approx(1.5, rel=0.03)
    low, high = result.interval["low.masses.0.mass"]
    assert (high - low) / 4.0 == pytest.approx(2 * 1.645 * 0.03, rel=0.25)
    narrow, wide = result.interval["response.gain"]
    assert (wide - narrow) / 1.5 == pytest.approx(2 * 1.645 * 0.03, rel=0.3)


def test_bands_leave_out_a_disturbance():
    assembly = dovetail.load({**MASSES, "responses": [DRIVE, TRANSFER]})
    values = as_measured(assembly)
    hum = (assembly.frequency >= 48) & (assembly.frequency <= 52)
    disturbed = [np.where(hum, 5.0 * frf, frf) for frf in values]
    masked = {**MASSES["frequency"], "without": [["48 Hz", "52 Hz"]]}
    without = dovetail.load({**MASSES, "frequency": masked, "responses": [DRIVE, TRANSFER]})
    frfs = measured(assembly, disturbed)
    result = dovetail.identify(without, frfs, "refined")
    assert result.adequacy.word == "to the noise"
    assert not any("lacks lines" in warning for warning in result.warnings)
    assert not ((result.frf.frequency >= 48) & (result.frf.frequency <= 52)).any()
    for name, value in TRUTH.items():
        assert result.parameters[name].value == pytest.approx(value, rel=0.02)
    only = {**MASSES["frequency"], "bands": [["5 Hz", "47.5 Hz"], ["52.5 Hz", "120 Hz"]]}
    again = dovetail.load({**MASSES, "frequency": only, "responses": [DRIVE, TRANSFER]})
    assert np.array_equal(again.frequency, without.frequency)


def test_lines_count_as_weights_say():
    assembly = dovetail.load({**MASSES, "response": DRIVE})
    [frf] = measured(assembly, as_measured(assembly))
    upper = assembly.frequency > 60
    wrong = replace(frf, values=np.where(upper, 1.3 * frf.values, frf.values), coherence=np.where(upper, 0.02, 0.9999))

    def greatest_error(weights: Any) -> float:
        identified = dovetail.identify(assembly, wrong, "refined", weights=weights, cause_seconds=0.0).parameters
        return max(abs(identified[name].value / value - 1.0) for name, value in TRUTH.items())

    assert greatest_error("coherence") < 0.02
    assert greatest_error(np.where(upper, 1e-8, 1.0) / np.abs(frf.values) ** 2) < 0.02
    assert greatest_error("amplitude") > 0.05


def test_the_phase_may_be_left_out():
    assembly = dovetail.load({**MASSES, "responses": [DRIVE, TRANSFER]})
    [drive, transfer] = measured(assembly, as_measured(assembly))
    turned = [replace(frf, values=frf.values * np.exp(0.7j)) for frf in (drive, transfer)]
    result = dovetail.identify(assembly, turned, "refined", phase=False)
    for name, value in TRUTH.items():
        assert result.parameters[name].value == pytest.approx(value, rel=0.02)
    result = dovetail.identify(assembly, turned, "refined", cause_seconds=0.0)
    assert result.adequacy.word != "to the noise"


def test_faulty_weights_are_refused_with_the_reason():
    assembly = dovetail.load({**MASSES, "response": DRIVE})
    [frf] = measured(assembly, as_measured(assembly))
    with pytest.raises(dovetail.ParameterError, match="'coherance' is not a way to weight lines"):
        dovetail.identify(assembly, frf, "refined", weights="coherance")
    with pytest.raises(dovetail.MeasurementError, match="it has no coherence"):
        dovetail.identify(assembly, frf, "refined", weights="coherence")
    with pytest.raises(dovetail.MeasurementError, match=r"weights of shape \(3,\) were given for 231 lines"):
        dovetail.identify(assembly, frf, "refined", weights=np.ones(3))


def test_an_identified_part_is_predicted_with():
    assembly = dovetail.load({**MASSES, "response": DRIVE})
    result = dovetail.identify(assembly, measured(assembly, as_measured(assembly))[0], "refined")
    predicted = dovetail.predict(dovetail.load({**MASSES, "response": TRANSFER}), result)
    expected = as_measured(dovetail.load({**MASSES, "responses": [DRIVE, TRANSFER]}))[1]
    assert np.abs(predicted.values - expected).max() < 0.05 * np.abs(expected).max()


def test_an_unknown_sign_is_determined_from_phases_of_weak_lines_too(sdof):
    """Far below the resonance an accelerance is a ten-thousandth of its peak, and all noise."""
    plain = json.loads(sdof.description.text)
    plain["response"]["calibration"] = {"sign": "unknown"}
    assembly = dovetail.load(plain)
    theta, random = assembly.from_unit(np.array([0.3, 0.4])), np.random.default_rng(0)
    values = -assembly.frf(theta)
    for _ in range(20):
        noise = random.standard_normal((2, len(values))) * 0.1 * np.abs(values).mean()
        noisy = dovetail.Frf(assembly.frequency, values + noise[0] + 1j * noise[1], "accelerance")
        assert _sign(Problem.of(assembly, noisy), theta) == -1.0
    turned = noisy.values * np.exp(2j * np.pi * np.random.default_rng(1).random(len(noisy.values)))
    with pytest.warns(UserWarning, match=r"as little with one sign as with the other .* State the sign"):
        _sign(Problem.of(assembly, replace(noisy, values=turned)), theta)


@pytest.mark.parametrize("shape", ["response", "responses"])
def test_what_all_responses_share_may_be_set_to_a_known_value(shape):
    points = {"response": DRIVE} if shape == "response" else {"responses": [DRIVE, TRANSFER]}
    assembly = dovetail.load({**MASSES, **points, "calibration": {"gain": {"range": [0.9, 1.1]}}})
    known = dovetail.load(json.loads(assembly.description.with_known({("calibration", "gain"): 1.02}).text))
    assert [p.name for p in assembly.parameters if p not in known.parameters] == ["calibration.gain"]


def test_the_ratio_of_a_tie_may_change_alone(tmp_path):
    (tmp_path / "base.yaml").write_text(json.dumps({**MASSES, "response": DRIVE}))
    (tmp_path / "other.yaml").write_text("extends: base.yaml\njoints: {neck: {parameters: {k: {ratio: 0.25}}}}")
    ties = dovetail.load(tmp_path / "other.yaml").description.joints["neck"].ties
    assert ties == {
        **dovetail.load(tmp_path / "base.yaml").description.joints["neck"].ties,
        "k": replace(ties["k"], ratio=0.25),
    }


def test_no_mass_is_taken_off_a_transfer_frf_as_off_a_drive_point():
    """A table does not say where it was measured; the description does."""
    check_mass(dovetail.load({**MASSES, "response": DRIVE}), 0.02)
    transfer = dovetail.load({**MASSES, "response": TRANSFER})
    check_mass(transfer, 0.0)
    with pytest.raises(dovetail.MeasurementError, match="is no drive point, from which no mass can be removed"):
        check_mass(transfer, 0.02)


def test_no_mass_is_taken_off_before_a_calibration():
    """A reversed sign, a gain or a delay would be in what it is taken off from."""
    reversed_there = dovetail.load({**MASSES, "response": {**DRIVE, "calibration": {"sign": -1}}})
    check_mass(reversed_there, 0.0)
    with pytest.raises(dovetail.MeasurementError, match="has a 'calibration', and a mass would be removed before it"):
        check_mass(reversed_there, 0.02)
