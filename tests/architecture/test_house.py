"""Limits of the source code: no circular imports, short files, small packages, telling names, short call paths."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import house
import pytest

LARGEST_SHARE = 0.18
"""Largest share of the code that one package of the framework may hold."""


def test_there_are_no_circular_imports():
    assert house.circles() == []


def test_no_file_is_longer_than_400_lines():
    lengths = {file.name: len(file.read_text(encoding="utf-8").splitlines()) for file in house.source_files()}
    assert {name: length for name, length in lengths.items() if length > 400} == {}


def test_no_package_holds_too_large_a_share_of_the_code():
    shares = house.shares()
    assert {package: share for package, share in shares.items() if share > LARGEST_SHARE} == {}


def test_names_that_say_nothing_are_used_within_few_lines_only():
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
        ("identification", "dovetail/measurement/frf_files.py", "dovetail/report/html_report.py", 70),
        ("synthesis", "dovetail/assembly/model.py", "dovetail/synthesis/codegen/compiler.py", 10),
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
