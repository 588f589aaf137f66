"""Amplitudes or complex FRFs on disk, and training from either."""

from __future__ import annotations

import json

import numpy as np
import pytest

import dovetail
from dovetail.errors import DatasetError
from dovetail.network.augmentation import NoisyFeatures

TRAINED = {
    "samples": 200,
    "reducer": {"model": "pca", "n_components": 8},
    "regressor": {"model": "mlp", "hidden": [16, 16], "max_epochs": 3},
}


def described(assembly, **identification):
    return dovetail.load({**json.loads(assembly.description.text), "identification": {**TRAINED, **identification}})


@pytest.fixture(scope="module")
def both(sdof, tmp_path_factory):
    folder = tmp_path_factory.mktemp("both")
    return [dovetail.generate(described(sdof), folder / name, storage=name) for name in ("amplitude", "complex")]


def test_a_complex_dataset_contains_the_accelerance(sdof, both):
    amplitude, phased = both
    assert (amplitude.storage, phased.storage) == ("amplitude", "complex")
    assert phased.attributes["quantity"] == "accelerance"
    assert phased.accelerance.dtype == np.complex64
    np.testing.assert_allclose(phased.accelerance[:], sdof.frf(phased.parameters), rtol=1e-6)
    assert phased.amplitude.dtype == np.float32
    np.testing.assert_allclose(phased.amplitude[:], amplitude.amplitude[:], rtol=1e-6)
    np.testing.assert_array_equal(phased.amplitude[-1], phased.amplitude[199])
    with pytest.raises(DatasetError, match="it contains amplitudes without phases"):
        _ = amplitude.accelerance


def test_the_quantity_of_the_response_does_not_change_what_is_stored(sdof, both, tmp_path):
    receptance = json.loads(sdof.description.text)
    receptance["response"]["quantity"] = "receptance"
    stored = dovetail.generate(dovetail.load(receptance), tmp_path / "d", samples=200, storage="complex")
    np.testing.assert_allclose(stored.accelerance[:], both[1].accelerance[:], rtol=1e-5)


def test_training_takes_the_amplitude_of_either(sdof, both):
    one, other = (dovetail.train(described(sdof), dataset) for dataset in both)
    probe = both[0].amplitude[:5]
    span = np.ptp(both[0].parameters, axis=0)
    difference = (one.predict_parameters(probe) - other.predict_parameters(probe)) / span
    assert np.abs(difference).max() < 1e-2


def test_a_remaining_mass_is_applied_with_the_stored_phases(sdof, both):
    settings = {"mass": "2 g", "additive": 0.0, "multiplicative": 0.0}
    assembly = described(sdof, augmentation=settings)
    phased = both[1]
    noisy = NoisyFeatures.from_samples(assembly, phased.accelerance[:], phased.parameters)
    found = 10.0 ** noisy(0)[0] - 1
    mass = 2e-3 * np.random.default_rng([assembly.description.identification.seed, 2, 0, 0]).standard_normal((200, 1))
    exact = sdof.frf(phased.parameters)
    np.testing.assert_allclose(found, np.abs(exact / (1 + mass * exact)), rtol=1e-4, atol=1e-6)
    assert np.isfinite(dovetail.train(assembly, phased).predict_parameters(phased.amplitude[:3])).all()
    with pytest.raises(DatasetError, match="without phases") as error:
        dovetail.train(assembly, both[0])
    assert "storage='complex'" in error.value.faults[0].remedy


def test_training_without_a_dataset_keeps_the_phases_that_it_needs(sdof):
    assembly = described(sdof, augmentation={"mass": "2 g"})
    assert dovetail.train(assembly).evaluation.training_samples == 160


def test_another_storage_is_refused(sdof, both, tmp_path):
    with pytest.raises(DatasetError, match="it was begun with storage complex, not amplitude"):
        dovetail.generate(described(sdof), both[1].path, resume=True)
    with pytest.raises(DatasetError, match="'float16' is not a storage"):
        dovetail.generate(described(sdof), tmp_path / "d", storage="float16")
    assert dovetail.generate(described(sdof), both[1].path, storage="complex", resume=True).complete


def test_a_dataset_without_the_attribute_storage_has_amplitudes(sdof, tmp_path):
    dovetail.generate(described(sdof), tmp_path / "old")
    file = tmp_path / "old" / "zarr.json"
    text = json.loads(file.read_text())
    del text["attributes"]["storage"]
    file.write_text(json.dumps(text))
    assert dovetail.generate(described(sdof), tmp_path / "old", resume=True).storage == "amplitude"
