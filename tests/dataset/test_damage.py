"""A dataset with missing or damaged files says so, and never returns numbers that were not computed."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

import dovetail
from dovetail.dataset import generation
from dovetail.errors import DatasetError


@pytest.fixture(scope="module")
def sound(sdof, tmp_path_factory):
    """Chunks of ten samples, the last one of five."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(generation, "_CHUNK_BYTES", 4 * len(sdof.frequency) * 10)
        return dovetail.generate(sdof, tmp_path_factory.mktemp("sound") / "data.zarr", samples=65)


@pytest.fixture
def copy(sound, tmp_path):
    return shutil.copytree(sound.path, tmp_path / "data.zarr")


def truncate(file):
    file.write_bytes(file.read_bytes()[:-100])


def empty(file):
    file.write_bytes(b"")


def flip(file):
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)


DAMAGES = {
    "truncated": (truncate, "it has 23904 bytes instead of 24004", "Continue with `resume=True` to compute it again."),
    "empty": (empty, "it has 0 bytes instead of 24004", "Continue with `resume=True` to compute it again."),
    "missing": (lambda file: file.unlink(), "it is missing", "Continue with `resume=True` to compute it again."),
    "one bit": (flip, "damaged (Stored and computed checksum", "Delete this file and continue with `resume=True`"),
}


@pytest.mark.parametrize("kind", DAMAGES)
@pytest.mark.parametrize("chunk", [0, 2, 6])
def test_a_damaged_chunk_is_reported_and_computed_again(kind, chunk, sdof, sound, copy):
    damage, found, remedy = DAMAGES[kind]
    file = copy / "amplitude" / "c" / str(chunk) / "0"
    damage(file)
    dataset = dovetail.Dataset(copy)
    held = f"this chunk holds samples {10 * chunk} to {min(10 * chunk + 9, 64)}, and "
    for read in (
        lambda: dataset.amplitude[:],
        lambda: dataset.amplitude[10 * chunk + 3],
        lambda: dovetail.train(sdof, dataset),
    ):
        with pytest.raises(DatasetError) as error:
            read()
        [fault] = error.value.faults
        assert fault.where == str(file)
        assert fault.problem.startswith(held)
        assert found in fault.problem
        assert fault.remedy.startswith(remedy)
    others = np.delete(np.arange(65), np.s_[10 * chunk : 10 * chunk + 10])
    np.testing.assert_array_equal(dataset.amplitude[int(others[0])], sound.amplitude[int(others[0])])
    if kind == "one bit":
        file.unlink()
    mended = dovetail.generate(sdof, copy, samples=65, resume=True)
    np.testing.assert_array_equal(mended.amplitude[:], sound.amplitude[:])
    assert file.read_bytes() == (sound.path / "amplitude" / "c" / str(chunk) / "0").read_bytes()


@pytest.mark.parametrize("name", ["parameters", "frequency"])
@pytest.mark.parametrize("damage", [truncate, empty, flip, lambda file: file.unlink()])
def test_a_damaged_small_array_is_reported(name, damage, copy):
    files = [file for file in (copy / name / "c").rglob("*") if file.is_file()]
    damage(files[-1])
    with pytest.raises(DatasetError) as error:
        dovetail.Dataset(copy)
    [fault] = error.value.faults
    assert fault.where == str(copy / name)
    assert "missing" in fault.problem or "damaged" in fault.problem
    assert fault.remedy == "Generate the dataset again, or restore a copy."


def test_samples_that_are_not_generated_yet_are_not_given(sdof, copy):
    (copy / "written" / "c" / "3").unlink()
    dataset = dovetail.Dataset(copy)
    assert not dataset.complete
    with pytest.raises(DatasetError, match="interrupted before these samples"):
        dataset.amplitude[25:35]
    assert np.isfinite(dataset.amplitude[20:30]).all()
    assert dovetail.generate(sdof, copy, samples=65, resume=True).complete


def test_flags_that_cannot_be_read_lose_no_dataset(sdof, sound, copy):
    (copy / "written" / "c" / "3").write_bytes(b"")
    with pytest.raises(DatasetError) as error:
        dovetail.Dataset(copy)
    assert error.value.faults[0].remedy == f"Delete {copy / 'written' / 'c'} and continue with `resume=True`."
    shutil.rmtree(copy / "written" / "c")
    mended = dovetail.generate(sdof, copy, samples=65, resume=True)
    np.testing.assert_array_equal(mended.amplitude[:], sound.amplitude[:])


def test_a_missing_dataset_is_an_error(tmp_path):
    with pytest.raises(DatasetError) as error:
        dovetail.Dataset(tmp_path / "data.zarr")
    (fault,) = error.value.faults
    assert fault.where == str(tmp_path / "data.zarr")
    assert fault.problem == "this is not a dataset: there is no such folder."
    assert "dovetail generate" in fault.remedy
