"""A measured FRF in, joint parameters and what belongs to them out."""

from __future__ import annotations

import json
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import dovetail
from dovetail.errors import MeasurementError
from dovetail_plugins.methods.refined import Refined


def test_known_parameters_come_back(model: dovetail.Identifier, small: dovetail.Assembly) -> None:
    rng = np.random.default_rng(11)
    fractions = rng.uniform(0.1, 0.9, (20, 2))
    theta = small.from_unit(fractions)
    errors = [
        small.to_unit(model.identify(dovetail.Frf(small.frequency, values, "accelerance"), "network").theta) - fraction
        for values, fraction in zip(small.frf(theta), fractions, strict=True)
    ]
    assert np.abs(errors).max() < 0.05


def test_the_result_holds_values_units_and_ranges(model: dovetail.Identifier, measured: dovetail.Frf) -> None:
    result = model.identify(measured, "network")
    assert list(result.parameters) == ["k", "c"]
    stiffness = result.parameters["k"]
    assert (stiffness.unit, stiffness.lower, stiffness.upper, stiffness.joint) == ("N/m", 1e5, 1e7, "mount")
    assert stiffness.in_range
    assert stiffness.value == result.theta[0]
    assert result.method == "network"
    assert result.interval is None
    assert result.warnings == ()


def test_the_frf_is_the_assembly_at_the_identified_values(
    model: dovetail.Identifier, measured: dovetail.Frf, small: dovetail.Assembly
) -> None:
    result = model.identify(measured, "network")
    np.testing.assert_array_equal(result.frf.values, small.frf(result.theta))
    np.testing.assert_array_equal(result.frf.frequency, small.frequency)
    expected = dovetail.coherence_spectrum(measured.values, result.frf.values)
    np.testing.assert_allclose(result.coherence, expected, rtol=1e-12)
    assert result.mean_coherence == pytest.approx(expected.mean())
    assert result.mean_coherence > 0.98


@pytest.mark.parametrize("quantity", ["receptance", "mobility"])
def test_the_quantity_of_the_measurement_does_not_matter(
    model: dovetail.Identifier, measured: dovetail.Frf, quantity: str
) -> None:
    one, other = model.identify(measured, "network"), model.identify(measured.to(quantity), "network")
    np.testing.assert_allclose(other.theta, one.theta, rtol=1e-5)
    assert other.measured.quantity == "accelerance"
    assert other.mean_coherence == pytest.approx(one.mean_coherence, abs=1e-5)


def test_another_frequency_axis_is_interpolated_for_the_network_only(
    model: dovetail.Identifier, small: dovetail.Assembly, measured: dovetail.Frf, truth: np.ndarray
) -> None:
    fine = np.arange(0.5, 700.0, 0.4)
    receptance = 1.0 / (truth[0] + 2j * np.pi * fine * truth[1] - (2 * np.pi * fine) ** 2)
    result = model.identify(dovetail.Frf(fine, receptance, "receptance"), "network")
    inside = (fine >= small.frequency[0]) & (fine <= small.frequency[-1])
    np.testing.assert_array_equal(result.measured.frequency, fine[inside])
    np.testing.assert_array_equal(result.frf.values, small.on(fine[inside]).frf(result.theta))
    np.testing.assert_allclose(result.measured.to("receptance").values, receptance[inside], rtol=1e-12)
    np.testing.assert_allclose(result.theta, model.identify(measured, "network").theta, rtol=1e-3)


def test_a_measurement_that_does_not_cover_the_frequencies_is_refused(
    model: dovetail.Identifier, measured: dovetail.Frf
) -> None:
    narrow = dovetail.Frf(measured.frequency[50:], measured.values[50:], "accelerance")
    with pytest.raises(MeasurementError, match="covers 51 to 600 Hz"):
        model.identify(narrow, "network")


def test_a_parameter_outside_its_range_is_flagged_and_kept(model: dovetail.Identifier, measured: dovetail.Frf) -> None:
    scaling = model.network.target_scaling
    further = replace(scaling, upper=scaling.lower + 3.0 * (scaling.upper - scaling.lower))
    result = replace(model, network=replace(model.network, target_scaling=further)).identify(measured, "network")
    assert not result.parameters["k"].in_range
    assert result.parameters["k"].value == pytest.approx(12e6, rel=0.1)
    assert result.warnings[0].startswith("k = 1.")
    assert result.warnings[0].endswith("lies outside its range, 1e+05 N/m to 1e+07 N/m.")


def test_amplitude_alone_gives_the_same_parameters_and_says_so(
    model: dovetail.Identifier, measured: dovetail.Frf
) -> None:
    result = model.identify(replace(measured, values=measured.amplitude, has_phase=False), "network")
    np.testing.assert_allclose(result.theta, model.identify(measured, "network").theta, rtol=1e-9)
    assert any("no phase" in warning for warning in result.warnings)
    assert result.mean_coherence > 0.99


def test_a_measurement_the_model_cannot_follow_gives_a_warning(
    model: dovetail.Identifier, measured: dovetail.Frf
) -> None:
    result = model.identify(replace(measured, values=-measured.values), "network")
    assert result.mean_coherence < 0.1
    assert any("mean coherence" in warning for warning in result.warnings)


def test_a_mode_is_listed_with_the_peaks_of_both_frfs(
    model: dovetail.Identifier, measured: dovetail.Frf, truth: np.ndarray
) -> None:
    result = model.identify(measured, "network")
    (mode,) = result.modes
    assert mode.natural_frequency == pytest.approx(np.sqrt(result.theta[0]) / (2 * np.pi), rel=1e-9)
    assert mode.reconstructed_peak == pytest.approx(mode.natural_frequency, rel=1e-3)
    assert mode.measured_peak == pytest.approx(np.sqrt(truth[0]) / (2 * np.pi), rel=1e-3)


def test_provenance_names_description_measurement_and_versions(
    model: dovetail.Identifier, measured: dovetail.Frf
) -> None:
    provenance = model.identify(measured, "network").provenance
    assert provenance["assembly"] == "sdof"
    assert provenance["measurement"] == "measured.csv"
    assert provenance["seed"] == 0
    assert len(provenance["description_sha256"]) == 64
    assert provenance["evaluation"]["test_samples"] == 300
    assert json.loads(provenance["description"])["name"] == "sdof"
    assert {"python", "numpy", "dovetail-frf"} <= set(provenance["packages"])
    assert provenance["components"]["reducer pca"].startswith("dovetail-frf")


@pytest.mark.sweep(keep=2)
@pytest.mark.parametrize(
    ("method", "options"), [("refined", {}), ("posterior", {"form": "laplace"}), ("multistart", {"starts": 2})]
)
def test_provenance_names_the_seed_that_was_used(small, measured, method, options):
    assert dovetail.identify(small, measured, method, seed=77, **options).provenance["seed"] == 77
    assert dovetail.identify(small, measured, method, **options).provenance["seed"] == 0


def test_the_result_is_plain_json(model: dovetail.Identifier, measured: dovetail.Frf) -> None:
    result = model.identify(measured, "network")
    read = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert read["parameters"]["k"]["value"] == result.theta[0]
    assert read["parameters"]["k"]["unit"] == "N/m"
    assert len(read["coherence"]) == len(read["frequency_Hz"]) == len(read["frf"]["real"]) == 600
    assert read["interval"] is None


def test_the_result_cannot_be_changed(model: dovetail.Identifier, measured: dovetail.Frf) -> None:
    result = model.identify(measured, "network")
    with pytest.raises(FrozenInstanceError):
        result.method = "another"
    with pytest.raises(TypeError):
        result.parameters["k"] = None


def test_one_frf_alone_is_answered_as_in_a_batch(model: dovetail.Identifier, dataset: dovetail.Dataset) -> None:
    amplitude = np.array(dataset.amplitude[:64])
    batch = model.predict_parameters(amplitude)
    alone = np.concatenate([model.predict_parameters(row[np.newaxis]) for row in amplitude])
    np.testing.assert_allclose(alone, batch, rtol=1e-9)


@pytest.mark.parametrize(
    ("amplitude", "message"),
    [
        (np.ones(600), r"shape \(600,\)"),
        (np.ones((2, 599)), r"shape \(2, 599\)"),
        (np.ones((0, 600)), r"shape \(0, 600\)"),
        (np.full((1, 600), np.nan), "not finite"),
        (np.full((1, 600), -0.5), "negative"),
    ],
)
def test_amplitudes_that_cannot_be_are_refused(model: dovetail.Identifier, amplitude: np.ndarray, message: str) -> None:
    with pytest.raises(MeasurementError, match=message):
        model.predict_parameters(amplitude)


def test_an_unknown_method_is_refused(model: dovetail.Identifier, measured: dovetail.Frf) -> None:
    with pytest.raises(ValueError, match="Did you mean 'network'"):
        model.identify(measured, method="netwrk")


def test_parameters_that_the_network_guesses_are_named(model: dovetail.Identifier, measured: dovetail.Frf) -> None:
    metrics = {**model.evaluation.parameters, "c": replace(model.evaluation.parameters["c"], r2=0.02)}
    guessing = replace(model, evaluation=replace(model.evaluation, parameters=metrics))
    (warning,) = guessing.identify(measured, "network").warnings
    assert warning.startswith("Do not rely on c: ")


def test_linear_algebra_takes_one_thread_while_a_joint_is_identified(small, measured, monkeypatch):
    def threads(*_, **__):
        return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}

    seen, refined = [], Refined.identify

    def watched(*arguments, **options):
        seen.append(threads())
        return refined(*arguments, **options)

    monkeypatch.setattr(Refined, "identify", watched)
    with threadpool_limits(2, user_api="blas"):
        dovetail.identify(small, measured, "refined")
        assert seen == [{1}]
        assert threads() == {2}
