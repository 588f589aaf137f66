"""A covariate that a measured file gives is compared with that of its test in the description of the series."""

from __future__ import annotations

import json
import warnings

import h5py
import numpy as np
import pytest
import scipy.io

import dovetail
from dovetail.measurement import frf_files
from dovetail.series.fitted_tests import fit_tests
from dovetail.series.reading import read_series

FREQUENCY = np.arange(20.0, 60.0, 2.0)
MODEL = {
    "dovetail": 1,
    "name": "mass",
    "frequency": {"start": 20.0, "stop": 58.0, "step": 2.0},
    "substructures": {"block": {"model": "lumped", "masses": [{"mass": 1.0}]}, "base": {"model": "ground"}},
    "joints": {
        "foot": {
            "model": "spring_damper",
            "direction": "x",
            "connect": {"a": {"to": "block", "at": 0}, "b": {"to": "base", "at": 0}},
            "parameters": {"k": {"range": [1e4, 1e6]}, "c": {"value": 20.0}},
        }
    },
    "response": {"at": "block", "position": 0, "quantity": "receptance"},
}
OTHER = [
    "torque: 40 N m", "Torque = 40 N m", "torque [N m]: 40", "TORQUE: 0.04 kN m", "torque\t40", "torque: 2.0 N m",
    "Torque (kN m): 0.04", "torque,40", "torque_Nm: 40", "torque 40 N m",
]  # fmt: skip
SAME = [
    "torque: 20 N m", "torque [kN m]: 0.02", "torque: 20.0", "torque: see notebook", "torque wrench: 3", "load: 40 N",
    "torque: 40 mm", "torque: 20.1 N m",
]  # fmt: skip


def load(folder, suffix, **measured):
    series = {
        "dovetail_series": 1,
        "assembly": "mass.yaml",
        "covariates": {"torque": "N m"},
        "tests": {
            "low": {"measured": {"file": f"low.{suffix}"} | measured, "at": {"torque": "20 N m"}},
            "high": {"measured": {"file": "high.csv"}, "at": {"torque": 60}},
        },
        "parameters": {"k": {"law": "linear", "over": "torque"}},
    }
    for name, content in (("mass.yaml", MODEL), ("series.yaml", series)):
        (folder / name).write_text(json.dumps(content))
    return fit_tests(read_series(folder / "series.yaml"))


@pytest.fixture
def values(tmp_path):
    values = 1.0 / (2e5 - (2 * np.pi * FREQUENCY) ** 2 + 40j * np.pi * FREQUENCY)
    dovetail.write_frf(dovetail.Frf(FREQUENCY, 1.1 * values, "receptance"), tmp_path / "high.csv")
    return values


def write(folder, values, line):
    dovetail.write_frf(dovetail.Frf(FREQUENCY, values, "receptance"), folder / "low.csv", overwrite=True)
    (folder / "low.csv").write_text(f"# {line}\n{(folder / 'low.csv').read_text()}")


@pytest.mark.parametrize("line", OTHER)
def test_another_value_in_a_comment_is_refused(tmp_path, values, line):
    write(tmp_path, values, line)
    with pytest.raises(dovetail.DovetailError, match=r"low\.csv:1\n  torque is '.*' here, and 20 N m in the test"):
        load(tmp_path, "csv")
    load(tmp_path, "csv", names={"skip": "torque"})


@pytest.mark.parametrize("line", SAME)
def test_the_same_value_or_another_quantity_is_accepted(tmp_path, values, line):
    write(tmp_path, values, line)
    load(tmp_path, "csv")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("Tightening torque: 40 N m", "it gives 'tightening_torque: 40 N m', and torque is 20 N m"),
        ("torque: 29.5 ft-lb", "'torque: 29.5 ft-lb' is not understood as a quantity in N m"),
    ],
)
def test_what_may_be_another_value_gives_a_warning(tmp_path, values, line, said):
    write(tmp_path, values, line)
    with pytest.warns(UserWarning, match=said):
        load(tmp_path, "csv")


def load_named(folder, name):
    (folder / "low.csv").rename(folder / name)
    return load(folder, "csv", file=name)


def test_the_name_of_a_file_is_compared_too(tmp_path, values):
    write(tmp_path, values, "no covariate")
    with pytest.raises(
        dovetail.DovetailError, match=r"its name\n  torque is '40 N m' here, and 20 N m in the test 'low'"
    ):
        load_named(tmp_path, "run torque=40 N m.csv")
    load(tmp_path, "csv", file="run torque=40 N m.csv", names={"skip": "torque"})


@pytest.mark.parametrize(("name", "warns"), [("torque_40.csv", True), ("torque_20.csv", False), ("run_40.csv", False)])
def test_a_number_behind_a_covariate_in_a_name_gives_a_warning(tmp_path, values, name, warns):
    write(tmp_path, values, "no covariate")
    if warns:
        with pytest.warns(UserWarning, match="its name has 'torque 40', and torque is 20 N m in the test 'low'"):
            load_named(tmp_path, name)
    else:
        with warnings.catch_warnings():
            warnings.simplefilter("error", UserWarning)
            load_named(tmp_path, name)


def test_another_value_in_an_attribute_of_a_dataset_is_refused(tmp_path, values):
    with h5py.File(tmp_path / "low.h5", "w") as file:
        file["frequency"], file["receptance"] = FREQUENCY, values
        file["receptance"].attrs["torque"] = "40 N m"
    with pytest.raises(dovetail.DovetailError, match="torque is '40 N m' here, and 20 N m in the test 'low'"):
        load(tmp_path, "h5")


@pytest.mark.parametrize("suffix", ["npz", "csv", "uff"])
def test_a_copy_of_the_measurement_of_another_test_is_refused(tmp_path, values, suffix):
    frf = dovetail.Frf(FREQUENCY, 1.1 * values, "receptance")
    dovetail.write_frf(frf.to("accelerance"), tmp_path / f"low.{suffix}")
    with pytest.raises(dovetail.DovetailError, match="the test 'high' has the same values as 'low'"):
        load(tmp_path, suffix)


@pytest.mark.parametrize("suffix", ["npz", "mat", "h5", "uff"])
@pytest.mark.parametrize(("value", "fits"), [("40 N m", False), ("20 N m", True)])
def test_another_value_in_other_formats_is_refused(tmp_path, values, suffix, value, fits):
    arrays = {"frequency": FREQUENCY, "values": values, "quantity": "receptance", "torque": value}
    if suffix == "npz":
        np.savez(tmp_path / "low.npz", **arrays)
    elif suffix == "mat":
        scipy.io.savemat(tmp_path / "low.mat", arrays)
    elif suffix == "uff":
        averaged = {"coherence": np.full(len(values), 0.9), "averages": 10}  # in a set of its own
        frf = dovetail.Frf(FREQUENCY, values, "receptance", note=f"bench; torque: {value}", **averaged)
        dovetail.write_frf(frf, tmp_path / "low.uff")
    else:
        with h5py.File(tmp_path / "low.h5", "w") as file:
            file["frequency"], file["values"] = FREQUENCY, values
            file.attrs["quantity"], file.attrs["torque"] = "receptance", value
    if fits:
        load(tmp_path, suffix)
    else:
        with pytest.raises(dovetail.DovetailError, match="torque is '40 N m' here, and 20 N m in the test 'low'"):
            load(tmp_path, suffix)


def test_each_file_is_read_once(tmp_path, values, monkeypatch):
    write(tmp_path, values, "torque: 20 N m")
    read, bounded = [], frf_files.read_bounded
    monkeypatch.setattr(frf_files, "read_bounded", lambda path: read.append(path.name) or bounded(path))
    load(tmp_path, "csv")
    assert sorted(read) == ["high.csv", "low.csv"]
