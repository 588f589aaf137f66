"""A dataset is checked in full against its own description before training or resuming."""

from __future__ import annotations

import json
import re
import shutil

import numpy as np
import pytest
import zarr

import dovetail
from dovetail.errors import DatasetError


@pytest.fixture(scope="module")
def sound(sdof, tmp_path_factory):
    return dovetail.generate(sdof, tmp_path_factory.mktemp("sound") / "data.zarr", samples=300)


@pytest.fixture
def copy(sound, tmp_path):
    return shutil.copytree(sound.path, tmp_path / "data.zarr")


def replace(folder, name, values):
    """Write another array in the place of one, with its checksum."""
    group = zarr.open_group(folder, mode="r+")
    old = group[name]
    chunks = old.chunks if values.shape == old.shape else "auto"
    del group[name]
    group.create_array(name, data=values, chunks=chunks, compressors=old.compressors)


def rows_of_1e9(folder, sound):
    parameters = sound.parameters.copy()
    parameters[100:153] = 1e9
    replace(folder, "parameters", parameters)


def not_a_number(folder, sound):
    parameters = sound.parameters.copy()
    parameters[7, 1] = np.nan
    replace(folder, "parameters", parameters)


def another_axis(folder, sound):
    replace(folder, "frequency", 2 * sound.frequency)


def cut_table(folder, sound):
    replace(folder, "parameters", sound.parameters[:250])


def cut_columns(folder, sound):
    replace(folder, "parameters", sound.parameters[:, :1])


def cut_frfs(folder, sound):
    replace(folder, "amplitude", sound.amplitude[:][:, :-1])


def another_description(folder, sound):
    group = zarr.open_group(folder, mode="r+")
    description = json.loads(group.attrs["description"])
    description["frequency"]["stop"] = "500 Hz"
    group.attrs["description"] = json.dumps(description)


def rows_in_another_order(folder, sound):
    replace(folder, "parameters", np.roll(sound.parameters, 1, axis=0))


def a_few_foreign_frfs(folder, sound):
    amplitude = sound.amplitude[:]
    amplitude[20:40] *= 1.01
    replace(folder, "amplitude", amplitude)


CHANGES = {
    rows_of_1e9: r"53 of its 300 parameter vectors are outside the ranges, the first in row 101: k = 1e\+09 N/m\.",
    not_a_number: "1 of its 300 parameter vectors are outside the ranges, the first in row 8: c = nan N s/m.",
    another_axis: "its frequencies are not those of its description.",
    cut_table: r"are inconsistent|begun with samples 250|have the shape \(250, 2\) and its FRFs \(300, 600\)",
    cut_columns: r"are inconsistent|have the shape \(300, 1\) and its FRFs \(300, 600\)",
    cut_frfs: r"are inconsistent|have the shape \(300, 2\) and its FRFs \(300, 599\)",
    another_description: "its description does not match its fingerprint.",
    rows_in_another_order: "its FRFs are not those that the assembly gives now",
    a_few_foreign_frfs: "its FRFs are not those that the assembly gives now",
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_changed_dataset_is_refused_before_training(change, sdof, sound, copy):
    change(copy, sound)
    uses = [lambda: dovetail.train(sdof, dovetail.Dataset(copy))]
    if change is not a_few_foreign_frfs:  # three are looked at before a dataset is gone on with
        uses.append(lambda: dovetail.generate(sdof, copy, samples=300, resume=True))
    for use in uses:
        with pytest.raises(DatasetError) as error:
            use()
        assert re.search(CHANGES[change], str(error.value))


def test_a_sound_dataset_is_taken(sdof, sound):
    sound.require(sdof)
