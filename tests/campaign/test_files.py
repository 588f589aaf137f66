"""The files of the synthetic campaign: present, readable, labelled, and equal to what the script writes."""

from __future__ import annotations

import json

import numpy as np
import pytest
from make_campaign import TESTS
from models import ACCELEROMETER

import dovetail
from dovetail.frf.resonance_peaks import resonance_peaks
from dovetail_bench import read_cases
from support.scripts import run_script

NAMES = [test.name for test in TESTS]
LINE = 1.5625
"""Hz between two lines."""


@pytest.fixture(scope="module")
def truth(campaign):
    return json.loads((campaign / "measurements" / "truth.json").read_text())


def test_every_test_has_a_file_and_a_truth_and_the_whole_is_small(campaign, truth):
    folder = campaign / "measurements"
    assert {file.stem for file in folder.glob("*.uff")} == set(NAMES) == set(truth["tests"])
    assert sum(file.stat().st_size for file in folder.iterdir()) < 5e6
    assert truth["synthetic"] is True


@pytest.mark.parametrize("name", NAMES)
def test_a_synthetic_file_is_read_with_a_note_that_it_is_synthetic(name, campaign):
    file = campaign / "measurements" / f"{name}.uff"
    assert b"SYNTHETIC" in file.read_bytes()[:400]
    frf = dovetail.read_frf(file)
    assert frf.quantity == "accelerance"
    assert "SYNTHETIC" in frf.note
    np.testing.assert_allclose(np.diff(frf.frequency), LINE, rtol=1e-9)
    assert frf.frequency[0] < 100
    assert frf.coherence is not None
    assert np.median(frf.coherence) > 0.999
    assert frf.averages == 10
    assert (frf.response == frf.force) == (name != "sf_h1_ab")


@pytest.mark.parametrize(
    ("name", "times"), [("t1", 2), ("sf_h1_ab", 1), pytest.param("sf_h1_ab", 2, marks=pytest.mark.slow)]
)
def test_the_script_writes_the_same_bytes_again(name, times, campaign, tmp_path):
    for folder in ("one", "two")[:times]:
        run_script(campaign / "make_campaign.py", "--only", name, "--to", tmp_path / folder)
    assert len({(folder / f"{name}.uff").read_bytes() for folder in tmp_path.iterdir()}) == 1
    # Another processor may round a sample of the record the other way, which changes an FRF by a millionth of its peak.
    shipped, made = (dovetail.read_frf(f / f"{name}.uff") for f in (campaign / "measurements", tmp_path / "one"))
    np.testing.assert_allclose(made.values, shipped.values, rtol=0.0, atol=1e-6 * shipped.amplitude.max())
    assert made.note == shipped.note


def test_the_truth_shows_in_the_compensated_peaks(campaign, truth):
    for name in ("t0", "t1", "t2", "t3", "h0"):
        file = campaign / "measurements" / f"{name}.uff"
        loaded = resonance_peaks(dovetail.read_frf(file))
        bare = resonance_peaks(dovetail.read_frf(file, accelerometer_mass=ACCELEROMETER))
        known = truth["tests"][name]
        np.testing.assert_allclose(bare, known["natural_frequencies_Hz"], atol=LINE)
        np.testing.assert_allclose(loaded, known["natural_frequencies_with_accelerometer_Hz"], atol=LINE)


@pytest.mark.parametrize("file", ["parts", "torques", "novel_tools", "on_spindle"])
def test_the_files_of_cases_name_existing_measurements(file, campaign):
    for case in read_cases(campaign / "cases" / f"{file}.yaml").cases:
        assert case.measured.file.exists()
        assert case.assembly.exists()
        assert case.measured.accelerometer_mass == ACCELEROMETER
        assert case.joint is None or case.joint.measured.file.exists()


def test_descriptions_run_as_they_stand(campaign):
    files = sorted(campaign.glob("*.yaml"))
    assert len(files) >= 14
    for file in files:
        assembly = dovetail.load(file)
        assert np.isfinite(assembly.frf()).all()
