"""What can be counted of the house: no circles, few and short files, names that say something, and short trips."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import house
import pytest

LINES_OF_CODE = 29_400
"""Of framework and plugins, without blank lines and docstrings.

There were 18,611 before the floor plan, and fewer after it. Measurements on their own lines, searches that see every
resonance, and how wrong a model is, with causes, came after that in a thousand lines. Files as laboratories have them
(tables without a header, LabVIEW, MATLAB's cells and frd, modal parameters) took eight hundred more; FRFs between any
points by one elimination, unknown options of parts, measurement chains, ties, priors and masks another fourteen
hundred. Readers in guarded processes, hostile texts, folders that are whole or not there, locks and targets that are
tried first took seven hundred. One table of results everywhere, batches, data frames and inference data, a look at
measured files, completion and what looks wrong in a description took nine hundred. Readers and methods as plugins
with defaults that plugins give took six hundred, parameters from modal tables five hundred, drawings and new
descriptions as much, progress, logs and tables in notebooks three hundred and fifty, and a network that tells
intervals, endless data and shards three hundred and fifty. Charts that answer, a report that begins with its verdict,
and the explorer with its server took seven hundred. A study of settings that several processes share, with its
tables and figures, took eight hundred and fifty; chains that all responses share, values that follow others and
results of modal tables read back two hundred. Causes of a misfit with several responses and levels of the force, and
noise over variances of few averages, took a hundred and twenty; samples made while the network learns, and a training
that says how long it will take, ninety. The report of a validation took fifty-five, those of a batch and of a
calibration a hundred. The workers of a cluster, with what is wrong with them said, took a hundred and thirty, noise
like that of a measurement eighty, a normalising flow a hundred and sixty; starts along one parameter, a training of
one cycle and neighbours on several threads seventy. Units as laboratories write them and calls that a plugin refuses
took twenty-five, causes whose amounts are as precise as the measurement too, and parameters that a cause moves fifteen.
Layers of gated units took sixty. A feature that is worth more code raises the limit,
and says here what it was. The conformance kit is left out: it grows with every mistake that it learns to see.
Answers of plugins refused with their file, responses in exchanged order, and a phase that looks like radians took
a hundred more, a GPU on request and neighbours ranked in groups twenty-five. Corrections of a network's answer by the
assembly's FRF there took two hundred and seventy, their thinned lines forty, and studies that the workers of a
cluster share sixty. Power that a structure gives out, which tells a wrong sign whatever the model, took forty, and a
squared error, bfloat16 and AdamW for networks with intervals thirty-five, their calibration forty-five. Corrections
that keep to their time took ten, and sizes of errors that are plausible if any are ten more. Parts that are not as
described, in intervals, took fifty, and averages from a few lines of the FRF forty-five. Coherences
that a file rounds away, measurements with nothing left to judge by, and parameters of which best fit and interval
disagree took twenty-five, units and options that were dropped in silence twenty. Joints damped structurally, in
descriptions and among the causes, and damping that is far off took ninety,
settings, sensors and files that were lost on the way thirty-five, ties, windows and parts that were taken wrongly
forty-five, samples about the best fit twenty-five, FRFs of which half is a rotation fifty,
materials that several parts have alike twenty-five,
and parts known by their FRFs, inverted between the DOFs in use, thirty.
"""


def test_no_module_imports_itself_round_about():
    assert house.circles() == []


def test_the_identification_has_fewer_than_50_files():
    assert sum("identification" in file.parts for file in house.source_files()) < 50


def test_no_file_is_longer_than_400_lines():
    lengths = {file.name: len(file.read_text(encoding="utf-8").splitlines()) for file in house.source_files()}
    assert {name: length for name, length in lengths.items() if length > 400} == {}


def test_there_is_no_more_code_than_its_features_are_worth():
    files = [file for file in house.source_files() if "testing" not in file.parts]
    assert sum(map(house.code_lines, files)) < LINES_OF_CODE


def test_no_name_lives_long_that_says_nothing_of_what_it_holds():
    assert [use for file in house.source_files() for use in house.empty_names(file)] == []


@pytest.fixture(scope="module")
def trips() -> dict[str, list[str]]:
    """Return the files that each trip enters."""
    script = Path(__file__).with_name("trips.py")
    printed = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True).stdout
    trips = re.findall(r"^(\w+): \d+ files\n((?:  .+\n)+)", printed, flags=re.M)
    return {name: files.split() for name, files in trips}


@pytest.mark.parametrize(
    ("trip", "first", "last", "most"),
    [
        ("identification", "dovetail/measurement/frf_files.py", "dovetail/report/report.py", 70),
        ("synthesis", "dovetail/assembly/assembly.py", "dovetail/synthesis/codegen/compiler.py", 10),
    ],
)
def test_a_trip_through_the_house_enters_few_files(trips, trip, first, last, most):
    files = trips[trip]
    assert files[0] == first
    assert last in files
    assert len(files) <= most, "\n".join(files)


@pytest.mark.parametrize("file", house.source_files(), ids=house.module_name)
def test_a_module_defines_each_of_its_names_once(file):
    """Two files that are merged may each bring a constant of the same name, and the second silently wins."""
    assert list(house.names_defined_twice(file)) == []
