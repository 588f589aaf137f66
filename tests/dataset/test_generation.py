"""Datasets: samples, what is stored, what is refused, and resuming after an interruption."""

from __future__ import annotations

import errno
import json
import os

import numpy as np
import pytest

import dovetail
from dovetail.dataset import generation, latin_hypercube
from dovetail.errors import DatasetError


def found(error) -> str:
    return error.value.faults[0].problem


def other(assembly, **changes):
    return dovetail.load({**json.loads(assembly.description.text), **changes})


def test_a_latin_hypercube_fills_each_range_evenly_on_its_scale(collet):
    fractions = collet.to_unit(latin_hypercube(collet, 50, seed=1))
    for column in fractions.T:
        assert sorted(np.floor(column * 50).astype(int)) == list(range(50))
    np.testing.assert_array_equal(latin_hypercube(collet, 50, seed=1), latin_hypercube(collet, 50, seed=1))
    assert np.any(latin_hypercube(collet, 50, seed=1) != latin_hypercube(collet, 50, seed=2))


def test_a_dataset_holds_the_amplitude_of_the_accelerance(sdof, tmp_path):
    receptance = other(sdof, response={"at": "mass", "position": 0, "quantity": "receptance"})
    dataset = dovetail.generate(receptance, tmp_path / "data.zarr", samples=30, seed=3)
    assert (len(dataset), dataset.seed, dataset.complete) == (30, 3, True)
    expected = np.abs(sdof.frf(dataset.parameters))
    np.testing.assert_allclose(np.asarray(dataset.amplitude[:]), expected, rtol=1e-6)
    again = dovetail.load(json.loads(dataset.description))
    assert again.description.fingerprint == receptance.description.fingerprint


def test_samples_and_seed_come_from_the_description_by_default(sdof, tmp_path):
    described = other(sdof, identification={"samples": 20, "seed": 7})
    dataset = dovetail.generate(described, tmp_path / "data.zarr")
    assert (len(dataset), dataset.seed) == (20, 7)


def test_progress_ends_at_the_number_of_samples(sdof, tmp_path):
    reported = []
    dovetail.generate(sdof, tmp_path / "data.zarr", samples=25, progress=lambda *what: reported.append(what[:3]))
    assert reported[0] == ("generate", 0, 25)
    assert reported[-1] == ("generate", 25, 25)


class Stop(BaseException):
    """Stands in for Ctrl-C."""


def interrupted(assembly, path, monkeypatch, after):
    """Generate in chunks of 10 and stop after some of them."""
    monkeypatch.setattr(generation, "_CHUNK_BYTES", 4 * len(assembly.frequency) * 10)
    calls = []

    def progress(stage, done, total, note=""):
        calls.append(done)
        if len(calls) > after:
            raise Stop

    with pytest.raises(Stop):
        dovetail.generate(assembly, path, samples=95, progress=progress)


def test_a_resumed_dataset_is_bit_for_bit_the_uninterrupted_one(sdof, tmp_path, monkeypatch):
    interrupted(sdof, tmp_path / "broken.zarr", monkeypatch, after=4)
    partial = dovetail.Dataset(tmp_path / "broken.zarr")
    assert not partial.complete
    with pytest.raises(DatasetError) as error:
        partial.require(sdof)
    assert found(error) == "its generation was interrupted."
    begun = (tmp_path / "broken.zarr" / "amplitude" / "c" / "0" / "0").stat().st_mtime_ns
    resumed = dovetail.generate(sdof, tmp_path / "broken.zarr", samples=95, resume=True)
    whole = dovetail.generate(sdof, tmp_path / "whole.zarr", samples=95)
    assert resumed.complete
    np.testing.assert_array_equal(np.asarray(resumed.amplitude[:]), np.asarray(whole.amplitude[:]))
    np.testing.assert_array_equal(resumed.parameters, whole.parameters)
    assert (tmp_path / "broken.zarr" / "amplitude" / "c" / "0" / "0").stat().st_mtime_ns == begun


def test_resuming_a_complete_dataset_computes_but_three_samples_to_compare(sdof, tmp_path, monkeypatch):
    dovetail.generate(sdof, tmp_path / "data.zarr", samples=20)
    computed, compute = [], dovetail.Assembly.accelerance_amplitude
    monkeypatch.setattr(
        dovetail.Assembly,
        "accelerance_amplitude",
        lambda self, theta: (computed.append(len(theta)), compute(self, theta))[1],
    )
    assert dovetail.generate(sdof, tmp_path / "data.zarr", samples=20, resume=True).complete
    assert computed == [3]


def test_existing_paths_are_never_overwritten(sdof, tmp_path):
    dovetail.generate(sdof, tmp_path / "data.zarr", samples=20)
    with pytest.raises(DatasetError) as error:
        dovetail.generate(sdof, tmp_path / "data.zarr", samples=20)
    assert found(error) == "a file or folder of this name already exists."


@pytest.mark.parametrize(
    ("change", "message"),
    [({"samples": 21}, "it was begun with samples 20, not 21."), ({"seed": 1}, "it was begun with seed 0, not 1.")],
)
def test_another_plan_is_refused(sdof, tmp_path, change, message):
    dovetail.generate(sdof, tmp_path / "data.zarr", samples=20)
    with pytest.raises(DatasetError) as error:
        dovetail.generate(sdof, tmp_path / "data.zarr", resume=True, **{"samples": 20, **change})
    assert found(error) == message
    assert error.value.faults[0].remedy == "Go on with that one, or choose another name."


def test_another_description_is_refused_but_other_training_is_not(sdof, tmp_path):
    dovetail.generate(sdof, tmp_path / "data.zarr", samples=20)
    changed = other(sdof, frequency={"start": 1, "stop": 500, "step": 1})
    with pytest.raises(DatasetError) as error:
        dovetail.generate(changed, tmp_path / "data.zarr", samples=20, resume=True)
    assert found(error).startswith("it was made from another description ('sdof') than 'sdof'")
    retrained = other(sdof, identification={"reducer": {"model": "none"}})
    dovetail.generate(retrained, tmp_path / "data.zarr", samples=20, resume=True).require(retrained)


def test_a_full_disk_leaves_a_dataset_that_can_be_resumed(sdof, tmp_path, monkeypatch):
    monkeypatch.setattr(generation, "_CHUNK_BYTES", 4 * len(sdof.frequency) * 10)
    real, calls = dovetail.Assembly.accelerance_amplitude, []

    def full(self, theta):
        calls.append(1)
        if len(calls) == 3:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return real(self, theta)

    monkeypatch.setattr(dovetail.Assembly, "accelerance_amplitude", full)
    with pytest.raises(DatasetError) as error:
        dovetail.generate(sdof, tmp_path / "data.zarr", samples=50)
    assert "No space left on device" in found(error)
    monkeypatch.setattr(dovetail.Assembly, "accelerance_amplitude", real)
    resumed = dovetail.generate(sdof, tmp_path / "data.zarr", samples=50, resume=True)
    np.testing.assert_allclose(np.asarray(resumed.amplitude[:]), np.abs(sdof.frf(resumed.parameters)), rtol=1e-6)


def test_a_dataset_without_parameters_or_samples_is_refused(sdof, tmp_path):
    description = json.loads(sdof.description.text)
    description["joints"]["mount"]["parameters"] = {"k": {"value": 1e6}, "c": {"value": 10}}
    with pytest.raises(DatasetError) as error:
        dovetail.generate(dovetail.load(description), tmp_path / "data.zarr")
    assert found(error) == "there are no parameters to sample."
    with pytest.raises(DatasetError, match="0 samples were requested"):
        dovetail.generate(sdof, tmp_path / "data.zarr", samples=0)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("content", ["missing", "empty folder", "a file", "other zarr", "damaged"])
def test_other_folders_are_refused_as_datasets(sdof, tmp_path, content):
    path = tmp_path / "data.zarr"
    if content == "empty folder":
        path.mkdir()
    elif content == "a file":
        path.write_text("no")
    elif content == "other zarr":
        import zarr

        zarr.open_group(path, mode="w")
    elif content == "damaged":
        dovetail.generate(sdof, path, samples=20)
        (path / "zarr.json").write_text("{")
    with pytest.raises(DatasetError) as error:
        dovetail.Dataset(path)
    assert "not a" in found(error)
