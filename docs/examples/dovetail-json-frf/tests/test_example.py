"""An export is read by its suffix and signature, chosen from by DOF, and named in YAML."""

from pathlib import Path

import numpy as np
import pytest

import dovetail
import dovetail_bench

FOLDER = Path(__file__).parents[1]


def test_an_frf_is_chosen_and_converted():
    frf = dovetail.read_frf(FOLDER / "block.json", response="2+x")
    assert (frf.quantity, frf.response, frf.frequency.size) == ("receptance", "2+x", 176)
    omega = 2 * np.pi * frf.frequency
    np.testing.assert_allclose(frf.values, 1 / (2.3e6 + 60j * omega - omega**2), rtol=0.05)


def test_one_of_several_has_to_be_chosen():
    with pytest.raises(dovetail.MeasurementError, match="holds 2 FRFs; choose one"):
        dovetail.read_frf(FOLDER / "block.json")


def test_json_of_another_kind_is_not_taken(tmp_path):
    file = tmp_path / "other.json"
    file.write_text("{}")
    with pytest.raises(dovetail.MeasurementError, match="recognises the format"):
        dovetail.read_frf(file)


def test_it_is_read_where_yaml_names_it():
    (case,) = dovetail_bench.validate(dovetail_bench.read_cases(FOLDER / "cases.yaml")).cases
    assert case.measured.label == "block.json"
