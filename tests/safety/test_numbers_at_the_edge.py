"""Extreme numbers that no measurement has: one clear error each, or the right answer if there is one."""

from __future__ import annotations

import json

import numpy as np
import pytest

import dovetail
from dovetail.errors import DatasetError, MeasurementError

TRUTH = {"k": 3e6, "c": 40.0}


def measured(assembly, change, noise=1e-3):
    values = assembly.frf(TRUTH)
    random = np.random.default_rng(0)
    values = values + noise * values.std() * (random.standard_normal((values.size, 2)) @ [1, 1j])
    change(values)
    return dovetail.Frf(assembly.frequency, values, "accelerance", label="m")


def zeros(values):
    values[:] = 0


def two_thirds(values):
    values[::3] = values[1::3] = 0


def spike(values):
    values[300] = 1e100


SAID = {
    zeros: "exactly zero at 600 of 600 lines",
    two_thirds: "exactly zero at 400 of 600 lines",
    spike: r"its amplitude is 1e\+100 at 301 Hz",
}


@pytest.mark.parametrize("method", ["refined", "multistart", "posterior"])
@pytest.mark.parametrize("change", SAID, ids=lambda change: change.__name__)
def test_an_frf_that_no_structure_has_is_refused(sdof, change, method):
    with pytest.raises(MeasurementError, match=SAID[change]):
        dovetail.identify(sdof, measured(sdof, change), method)


def test_a_single_line_of_zero_or_of_damage_is_a_bad_line(sdof):
    def damage(values):
        values[100], values[300] = 0, values[300] * 1e12

    found = dovetail.identify(sdof, measured(sdof, damage), "refined")
    assert found.parameters["k"].value == pytest.approx(3e6, rel=1e-4)


def test_an_frf_without_noise_has_its_answer(sdof):
    found = dovetail.identify(sdof, measured(sdof, lambda values: None, noise=0.0), "posterior")
    assert found.parameters["k"].value == pytest.approx(3e6, rel=1e-6)
    assert found.is_trustworthy


@pytest.mark.parametrize("mass", [1e300, 1e4, -1.0, np.nan])
def test_an_accelerometer_of_an_impossible_mass_is_refused(sdof, mass):
    with pytest.raises(MeasurementError, match=r"the accelerometer's mass is .* kg"):
        dovetail.remove_accelerometer_mass(measured(sdof, lambda values: None), mass)


@pytest.mark.parametrize("samples", [10**20, 10**11, 10**8])
def test_more_samples_than_a_dataset_may_have_are_refused(sdof, tmp_path, samples):
    with pytest.raises(DatasetError, match="at most 31,250,000"):
        dovetail.generate(sdof, tmp_path / "d.zarr", samples=samples)
    assert list(tmp_path.iterdir()) == []


def test_a_mass_of_zero_is_a_massless_node(sdof):
    description = json.loads(sdof.description.text)
    description["substructures"]["mass"]["masses"] = [{"mass": "0 kg"}]
    massless = dovetail.load(description)
    omega = 2 * np.pi * massless.frequency
    np.testing.assert_allclose(massless.frf(TRUTH), -(omega**2) / (3e6 + 40j * omega), rtol=1e-12)
