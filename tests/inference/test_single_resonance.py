"""One resonance: errors of gain, phase, frequency and background are distinguished; unknown ones are NaN."""

from __future__ import annotations

import json

import numpy as np
import pytest

import dovetail
from dovetail.inference.adequacy.verdict import Adequacy
from dovetail.inference.fitting import refinement
from dovetail.inference.posterior.model_error import ModelError
from support.short_search import of_one_batch

MASS, NATURAL, RATIO = 0.42, 445.4, 1e-4
AXIS = np.arange(435.0, 456.01, 0.25)
TRUTH = {"k": MASS * (2 * np.pi * NATURAL) ** 2, "c": 2 * RATIO * MASS * 2 * np.pi * NATURAL}
UNKNOWN = {"range": [1e-5, 10], "scale": "log"}
NO_CAUSES = {"cause_seconds": 0}


@pytest.fixture(autouse=True)
def _short_search(monkeypatch):
    """Fits end after the first batch of starts, which is enough for one resonance."""
    monkeypatch.setattr(refinement, "_Refinement", of_one_batch)


def resonator(mass=UNKNOWN, quantity="accelerance", **response):
    """Return a mass on a spring and a damper that are unknown over many decades."""
    mount = {
        "model": "spring_damper",
        "direction": "x",
        "connect": {"a": {"to": "mass", "at": 0}, "b": {"to": "base", "at": 0}},
        "parameters": {"k": {"range": [1, 1e8], "scale": "log"}, "c": {"range": [1e-5, 1e3], "scale": "log"}},
    }
    return dovetail.load(
        {
            "dovetail": 1,
            "name": "one resonance",
            "frequency": {"start": 435, "stop": 456, "step": 0.25},
            "substructures": {"base": {"model": "ground"}, "mass": {"model": "lumped", "masses": [{"mass": mass}]}},
            "joints": {"mount": mount},
            "response": {"at": "mass", "position": 0, "quantity": quantity, **response},
        }
    )


def measured_of(factor=1.0, quantity="accelerance", added=0.0, noise=4e-3, axis=AXIS):
    """Return the FRF of the resonator times a complex factor, with a background and noise over its deviation."""
    values = factor * (resonator(MASS, quantity).on(axis).frf(TRUTH) + added)
    scatter = np.random.default_rng(3).standard_normal((2, len(axis))) / np.sqrt(2.0)
    return dovetail.Frf(axis, values + noise * values.std() * (scatter[0] + 1j * scatter[1]), quantity)


@pytest.mark.sweep(keep=3)
@pytest.mark.parametrize("quantity", ["accelerance", "mobility", "receptance"])
@pytest.mark.parametrize("degrees", [16.6, -5.0])
def test_a_turned_phase_is_reported_and_widens_the_intervals(quantity, degrees):
    turned = np.radians(degrees)
    measured = measured_of(np.exp(1j * turned), quantity)
    result = dovetail.identify(resonator(quantity=quantity), measured, form="laplace", **NO_CAUSES)
    assert result.adequacy.size.phase == pytest.approx(abs(turned), rel=0.05)
    which = "ahead of" if degrees > 0.0 else "behind"
    assert any(f"{abs(degrees):.2g} degrees {which} the model's" in reason for reason in result.adequacy.reasons)
    low, high = result.interval["mass.masses.0.mass"]
    assert low < MASS < high
    assert 0.5 < np.log(high / low) / (2 * 1.645 * max(abs(turned), 0.1)) < 2.0
    assert result.theta[-1] == pytest.approx(MASS, rel=0.05)


def test_sizes_that_the_parameters_can_follow_are_unknown():
    result = dovetail.identify(resonator(), measured_of(1.2 * np.exp(0.2j)), "refined", **NO_CAUSES)
    size = result.adequacy.size
    assert {"natural_frequency", "damping", "magnitude"} <= {*size.unknown}
    assert np.isfinite(size.phase)
    unknown = "Errors of natural frequencies, damping, amplitudes and a smooth background are unknown"
    assert unknown in result.adequacy.sentence
    assert "natural frequencies are off" not in result.adequacy.sentence
    stored = json.loads(json.dumps(result.to_dict()))["adequacy"]["model_error"]
    assert stored["magnitude"] is None
    assert stored["phase"] == pytest.approx(0.2, rel=0.05)


def test_the_gain_is_estimated_if_a_mass_is_known(monkeypatch):
    monkeypatch.undo()  # the first starts end in another minimum
    result = dovetail.identify(resonator(MASS), measured_of(1.2 * np.exp(0.2j)), form="laplace", **NO_CAUSES)
    size = result.adequacy.size
    assert size.magnitude == pytest.approx(np.log(1.2), rel=0.05)
    assert size.phase == pytest.approx(0.2, rel=0.05)
    assert size.unknown[:2] == ("natural_frequency", "damping")
    for name, (low, high) in result.interval.items():
        assert low < TRUTH[name] < high


def test_a_background_is_no_error_of_the_phase(monkeypatch):
    monkeypatch.undo()  # the first starts end in another minimum
    peak = np.abs(resonator(MASS).on(AXIS).frf(TRUTH)).max()
    measured = measured_of(np.exp(0.1j), added=0.02 * peak)
    size = dovetail.identify(resonator(), measured, "refined", **NO_CAUSES).adequacy.size
    assert size.phase == pytest.approx(0.1, rel=0.1)
    assert size.background == pytest.approx(0.02 * peak / np.median(measured.amplitude), rel=0.1)


def test_samples_and_gaussian_agree_on_a_turned_phase():
    measured = measured_of(np.exp(0.29j))
    widths = []
    for form in ("samples", "laplace"):
        low, high = dovetail.identify(resonator(), measured, form=form, samples=100, **NO_CAUSES).interval["k"]
        assert low < TRUTH["k"] < high
        widths.append(np.log(high / low))
    assert 0.7 < widths[0] / widths[1] < 1.4


def test_a_result_with_unknown_sizes_is_read_again(tmp_path):
    result = dovetail.identify(resonator(), measured_of(np.exp(0.2j)), form="laplace", samples=50, **NO_CAUSES)
    (tmp_path / "result.json").write_text(json.dumps(result.to_dict()))
    again = dovetail.load_result(tmp_path)
    assert again.adequacy.sentence == result.adequacy.sentence
    assert again.adequacy.error_in_intervals == result.adequacy.error_in_intervals


def test_an_unknown_phase_of_the_chain_is_identified():
    calibrated = resonator(MASS, calibration={"phase": {"range": ["-40 deg", "40 deg"]}})
    result = dovetail.identify(calibrated, measured_of(np.exp(0.29j)), "refined", **NO_CAUSES)
    assert result.adequacy.word == "to the noise"
    assert result.parameters["response.phase"].value == pytest.approx(0.29, abs=0.01)
    frf, jacobian = calibrated.frf_jacobian(result.theta)
    assert np.allclose(jacobian[..., -1], 1j * frf)


def test_unknown_sizes_are_not_in_the_sentence():
    size = ModelError(np.nan, damping=np.nan, magnitude=0.1, phase=np.nan, other=0.02)
    assert size.describe() == "amplitudes are off by 10 %, and what none of these explains is 2 % of the FRF"
    assert size.within(ModelError(0.01, magnitude=0.2, other=0.1))
    assert not size.within(ModelError(0.01, magnitude=0.05, other=0.1))


@pytest.mark.parametrize("word", ["good", "rough", "does not fit"])
@pytest.mark.parametrize("known", [{}, {"damping": 0.1}])
def test_a_sentence_is_whole_where_no_error_is_known(word, known):
    unknown = dict.fromkeys(("damping", "magnitude", "phase", "background"), np.nan)
    sentence = Adequacy(word, ModelError(np.nan, **(unknown | known))).sentence
    assert sentence.startswith("The model ")
    assert ("off by" in sentence) == bool(known)
    assert not any(gap in sentence for gap in (" .", ":.", "unless."))
