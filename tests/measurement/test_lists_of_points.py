"""Lists of names of another length than the array's axes, rates that contradict each other, a unit of the z axis."""

from __future__ import annotations

import warnings
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from dovetail.measurement import read_frf
from support.measured_files import fault_of, set_58, write_sets

pytestmark = pytest.mark.usefixtures("unguarded")

FREQUENCY = 10.0 + 2.5 * np.arange(12)
VALUES = (1 + 2j) / FREQUENCY
THREE = np.stack([VALUES, 2 * VALUES, 3 * VALUES], axis=1)
NINE = np.stack([THREE, 4 * THREE, 5 * THREE], axis=1)


def written(folder: Path, form: str, **arrays: object) -> Path:
    path = folder / f"a.{form}"
    said = {"frequency": FREQUENCY, **arrays}
    if form == "npz":
        np.savez(path, **{name: np.array(value) for name, value in said.items()})
    elif form == "mat":
        cells = {name: np.array(value, dtype=object) for name, value in said.items() if isinstance(value, list)}
        savemat(path, {**said, **cells})
    else:
        with h5py.File(path, "w") as file:
            for name, value in said.items():
                file[name] = value
    return path


LISTS = [
    (THREE, {"responses": ["tip", "mid", "nut", "root"]}, {"index": 2}, "responses: the list names 4 points"),
    (THREE, {"response_names": ["tip", "mid"]}, {"index": 2}, "response_names: the list names 2 points"),
    (THREE, {"dofs": ["1+x", "2+x"]}, {"index": 2}, "dofs: the list names 2 points"),
    (NINE, {"inputs": ["a", "b", "c", "d"]}, {"response": "2", "force": "1"}, "holds 3 x 3 FRFs; it is not used"),
    (VALUES, {"responses": ["tip", "mid"]}, {}, "holds one FRF; it is not used"),
]  # fmt: skip


@pytest.mark.parametrize("form", ["npz", "mat", "h5"])
@pytest.mark.parametrize(("values", "names", "chosen", "said"), LISTS)
def test_a_list_of_another_length_is_reported_and_not_used(tmp_path, form, values, names, chosen, said):
    path = written(tmp_path, form, accelerance=values, **names)
    with pytest.warns(UserWarning, match=said):
        frf = read_frf(path, **chosen)
    assert frf.response == ""


@pytest.mark.parametrize("form", ["npz", "mat", "h5"])
def test_a_list_of_the_right_length_names_the_chosen_point(tmp_path, form):
    path = written(tmp_path, form, accelerance=THREE, response_dofs=["1+x", "2+x", "3+x"], channels=["a", "b", "c"])
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        assert read_frf(path, index=2).response == "2+x"


@pytest.mark.parametrize("form", ["npz", "mat", "h5"])
def test_coherences_of_another_number_of_frfs_are_refused(tmp_path, form):
    path = written(tmp_path, form, accelerance=THREE, coherence=np.full((12, 2), 0.9))
    assert "'accelerance' holds 3, 'coherence' holds 2" in fault_of(path, index=2)


RATES = [
    ({"fs": 60.0, "dt": 1 / 70}, "above half of it"), ({"fs": 500.0, "dt": 1e-3}, "a sampling rate of"),
    ({"fs": 2048.0, "sampling_rate": 5120.0}, "Check the unit of the frequencies, and which of the two is right"),
    ({"dt": 0.02}, "a sampling rate of 50 Hz, and the frequencies reach 37.5 Hz"),
]  # fmt: skip


@pytest.mark.parametrize("form", ["npz", "mat", "h5"])
@pytest.mark.parametrize(("settings", "said"), RATES)
def test_rates_that_contradict_each_other_or_the_frequencies_are_reported(tmp_path, form, settings, said):
    path = written(tmp_path, form, accelerance=VALUES, **settings)
    with pytest.warns(UserWarning, match=said):
        read_frf(path)


@pytest.mark.parametrize("settings", [{"fs": 2048.0, "dt": 1 / 2048}, {"fs": 51.2}, {"dt": 1e-3}])
def test_rates_that_agree_or_may_be_in_kilohertz_give_no_warning(tmp_path, settings):
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        read_frf(written(tmp_path, "npz", accelerance=VALUES, **settings))


def test_a_unit_of_the_values_on_the_z_axis_of_a_universal_file_counts(tmp_path):
    si = {"ordinate_spec_data_type": 12, "orddenom_spec_data_type": 13}
    units = {"ordinate_axis_units_lab": "m/s^2", "orddenom_axis_units_lab": "N"}
    path = tmp_path / "a.uff"
    write_sets(path, set_58(FREQUENCY, VALUES, **si, z_axis_axis_units_lab="rpm"))
    np.testing.assert_allclose(read_frf(path).values, VALUES, rtol=1e-5)
    write_sets(path, set_58(FREQUENCY, VALUES, **si, z_axis_axis_units_lab="g/N"))
    np.testing.assert_allclose(read_frf(path).values, 9.80665 * VALUES, rtol=1e-5)
    write_sets(path, set_58(FREQUENCY, VALUES, **si, **units, z_axis_axis_units_lab="g/N"))
    assert "unit of the z axis" in fault_of(path)
