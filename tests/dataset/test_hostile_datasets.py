"""Malicious datasets: no codec but ours is called, and no more memory is reserved than the files account for."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

import dovetail
from dovetail.errors import DatasetError
from support.waiting import PATIENCE


@pytest.fixture(scope="module")
def sound(sdof, tmp_path_factory):
    return dovetail.generate(sdof, tmp_path_factory.mktemp("sound") / "data.zarr", samples=20).path


@pytest.fixture
def copy(sound, tmp_path):
    return shutil.copytree(sound, tmp_path / "data.zarr")


def change(folder, **entries):
    file = folder / "zarr.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | entries))


def change_codecs(folder):
    change(folder / "parameters", codecs=[{"name": "bytes"}, {"name": "zstd", "configuration": {"level": 1}}])


def consolidate(folder):
    """Put metadata with another codec into the group, which Zarr would take in place of the array's own."""
    arrays = {name: json.loads((folder / name / "zarr.json").read_text()) for name in ("parameters", "frequency")}
    arrays["parameters"]["shape"] = [30, 2]
    change(folder, consolidated_metadata={"kind": "inline", "must_understand": False, "metadata": arrays})


def grow(folder):
    change(folder / "parameters", shape=[10**12, 2])


def chunk(folder):
    grid = {"name": "regular", "configuration": {"chunk_shape": [10**9, 2]}}
    change(folder / "parameters", chunk_grid=grid)


def link(folder):
    (folder / "parameters/c/0/0").unlink()
    os.symlink("/dev/zero", folder / "parameters/c/0/0")


def flags(folder):
    (folder / "written/c/0").write_bytes(bytes(100))


def another_type(folder):
    change(folder / "amplitude", data_type="float64")


def big_endian(folder):
    change(folder / "frequency", codecs=[{"name": "bytes", "configuration": {"endian": "big"}}])


def fewer_lines(folder):
    change(folder / "frequency", shape=[7], chunk_grid={"name": "regular", "configuration": {"chunk_shape": [7]}})
    (folder / "frequency/c/0").write_bytes((folder / "frequency/c/0").read_bytes()[:60])


def other_width(folder):
    change(folder / "amplitude", shape=[19, 600])


HARM = {
    change_codecs: "parameters\n  its codecs are bytes, zstd.\n",
    grow: "far more than a dataset needs",
    chunk: "far more than a dataset needs",
    link: "chunks are missing",
    flags: "it is damaged (the chunk c/0 is not a file of 1 bytes)",
    another_type: "not an array of float32",
    big_endian: "not an array of float64",
    fewer_lines: "are inconsistent",
    other_width: "are inconsistent",
}


@pytest.mark.parametrize("harm", HARM, ids=lambda harm: harm.__name__)
def test_a_dataset_made_to_do_harm_is_one_error(harm, copy):
    harm(copy)
    with pytest.raises(DatasetError) as caught:
        dovetail.Dataset(copy)
    assert HARM[harm] in str(caught.value)
    assert len(caught.value.faults) == 1


def test_the_metadata_of_the_arrays_are_their_own(sound, copy):
    consolidate(copy)
    np.testing.assert_array_equal(dovetail.Dataset(copy).parameters, dovetail.Dataset(sound).parameters)


PICKLE = """
import sys, pathlib, numcodecs, numpy, zarr, dovetail
zarr.config.set({"default_zarr_format": 2})
group = zarr.open_group(sys.argv[1], mode="w", zarr_format=2, attributes={"dovetail_dataset": 1})
for name in ("parameters", "frequency", "amplitude", "written"):
    folder = pathlib.Path(sys.argv[1], name); folder.mkdir()
    (folder / ".zarray").write_text('{"chunks": [2], "compressor": {"id": "pickle", "protocol": 4}, "dtype": "<f8", '
        '"fill_value": 0, "filters": null, "order": "C", "shape": [2], "zarr_format": 2}')
    (folder / "0").write_bytes(b"cbuiltins\\nprint\\n(S'CODE RAN'\\ntR.")
numcodecs.register_codec(numcodecs.pickles.Pickle)
try:
    dovetail.Dataset(sys.argv[1])
except dovetail.DatasetError as error:
    print(error)
"""


def test_format_2_whose_codec_unpickles_is_refused_unread(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", PICKLE, tmp_path / "data.zarr"],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=True,
    )
    assert "CODE RAN" not in done.stdout
    assert done.stdout.startswith(f"{tmp_path / 'data.zarr'}\n  this is not a readable dovetail dataset (zarr.json: ")
