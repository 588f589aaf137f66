"""A function in the place of an assembly."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import dovetail
from support.small_joints import ASSEMBLIES

TRUTH = {"k": 2.5e6, "c": 40.0}
RANGES = (dovetail.Parameter("k", "N/m", 1e5, 1e7), dovetail.Parameter("c", "N s/m", 1.0, 100.0))
BAND = np.arange(1.0, 601.0)


def accelerance(frequency, k, c):
    """The FRF of assemblies/sdof.yaml."""
    s = 2j * np.pi * frequency
    return s**2 / (s**2 + c * s + k)


@pytest.fixture(scope="module")
def model():
    return dovetail.CallableModel(accelerance, RANGES, BAND, quantity="accelerance")


@pytest.fixture(scope="module")
def sdof():
    return dovetail.load(ASSEMBLIES / "sdof.yaml")


@pytest.mark.sweep(keep=1)
@pytest.mark.parametrize("method", ["posterior", "refined", "multistart"])
def test_the_estimate_is_that_of_the_assembly_with_the_same_frf(model, sdof, method):
    measured = dovetail.noisy_frf(sdof.simulate(TRUTH), 0.01, 3)
    ours, theirs = (dovetail.identify(each, measured, method) for each in (model, sdof))
    assert list(ours.parameters) == list(theirs.parameters)
    np.testing.assert_allclose(ours.theta, theirs.theta, rtol=1e-5)
    assert ours.adequacy.word == theirs.adequacy.word == "to the noise"
    if method == "posterior":
        for name, interval in theirs.interval.items():
            # Rounding may turn the directions in which 400 samples are drawn; an end then errs by 3 % of the width.
            width = interval[1] - interval[0]
            np.testing.assert_allclose(ours.interval[name], interval, rtol=0.0, atol=0.15 * width)


def test_frf_and_derivatives_are_those_of_the_assembly(model, sdof):
    np.testing.assert_allclose(model.frf(TRUTH), sdof.frf(TRUTH), rtol=1e-12)
    np.testing.assert_allclose(model.frf_jacobian(TRUTH)[1], sdof.frf_jacobian(TRUTH)[1], rtol=1e-6)
    np.testing.assert_allclose(model.accelerance_amplitude(TRUTH), sdof.accelerance_amplitude(TRUTH), rtol=1e-6)
    assert model.on([10.0, 20.0]).frf(TRUTH).shape == (2,)


def test_a_misfit_is_found_and_no_cause_is_looked_for_in_parts_that_it_lacks(model, sdof):
    values = sdof.frf(TRUTH) + sdof.frf({"k": 6e6, "c": 20.0})
    result = dovetail.identify(model, dovetail.Frf(BAND, values, "accelerance"), "refined")
    assert not result.is_trustworthy
    assert result.adequacy.causes == ()


def test_a_transfer_function_is_not_taken_for_a_drive_point():
    ranges, band = RANGES, BAND
    model = dovetail.CallableModel(lambda frequency, k, c: -accelerance(frequency, k, c), ranges, band,
                                   quantity="accelerance", drive_point=False, name="transfer")  # fmt: skip
    assert not model.description.response.is_drive_point
    result = dovetail.identify(model, model.simulate(TRUTH), "refined")
    np.testing.assert_allclose(result.theta, list(TRUTH.values()), rtol=1e-6)


def test_results_are_written_and_read_and_networks_trained(model, tmp_path):
    result = dovetail.identify(model, model.simulate(TRUTH), "refined")
    dovetail.write_report(result, tmp_path / "report.html")
    assert dovetail.predict(model, result).values.shape == BAND.shape
    dataset = dovetail.generate(model, tmp_path / "data.zarr", samples=30)
    np.testing.assert_allclose(dataset.amplitude[0], model.accelerance_amplitude(dataset.parameters[0]), rtol=1e-5)


def test_it_can_be_pickled(model):
    again = pickle.loads(pickle.dumps(model))
    np.testing.assert_array_equal(again.frf(TRUTH), model.frf(TRUTH))


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ((accelerance, RANGES[:1], BAND), "missing a required argument: 'c'"),
        ((3, RANGES, BAND), "cannot be called"),
        ((accelerance, (), BAND), "Parameter objects"),
        ((accelerance, ["k", "c"], BAND), "Parameter objects"),
        ((accelerance, RANGES * 2, BAND), "a name occurs twice"),
        ((accelerance, RANGES, [3.0, 2.0]), "increasing positive frequencies"),
        ((lambda frequency, k, c: k + c, RANGES, BAND), r"an array of the shape \(\)"),
        ((lambda frequency, k, c: ["a"] * 600, RANGES, BAND), "the type <U1"),
    ],
)
def test_a_callable_model_with_faulty_arguments_is_refused(arguments, problem):
    with pytest.raises(dovetail.ParameterError, match=problem):
        dovetail.CallableModel(*arguments)


def test_a_function_alone_is_refused_with_what_to_do(sdof):
    with pytest.raises(dovetail.ParameterError, match=r"dovetail\.CallableModel\(function"):
        dovetail.identify(accelerance, sdof.simulate(TRUTH))


def test_it_has_no_modes(model):
    with pytest.raises(dovetail.ParameterError, match="no parts, joints and modes"):
        dovetail.modes(model)
