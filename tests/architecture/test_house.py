"""Limits of the source code: no circular imports, short files, small packages, telling names, short call paths."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import house
import measurement_path
import pytest

LONGEST_FUNCTION = 60
"""Most lines of code of a function, without its docstring."""
LARGEST_SHARE = 0.18
"""Largest share of the code that one package of the framework may hold."""

MOST_STOPS, MOST_RETURNS, MOST_SEPARATE = 15, 2, 8
"""Modules that a measurement enters, returns to a module that it had left, and functions with both as parameters."""


def test_there_are_no_circular_imports():
    assert house.circles() == []


def test_no_file_is_longer_than_400_lines():
    lengths = {file.name: len(file.read_text(encoding="utf-8").splitlines()) for file in house.source_files()}
    assert {name: length for name, length in lengths.items() if length > 400} == {}


def test_no_file_is_named_like_its_folder():
    assert [str(file) for file in house.source_files() if file.stem == file.parent.name] == []


def test_no_function_or_class_hides_a_module_of_its_name():
    assert list(house.hidden_modules()) == []


def test_no_function_is_longer_than_the_limit():
    lengths = {name: length for file in house.source_files() for name, length in house.function_lengths(file).items()}
    assert {name: length for name, length in lengths.items() if length > LONGEST_FUNCTION} == {}


def test_no_package_holds_too_large_a_share_of_the_code():
    shares = house.shares()
    assert {package: share for package, share in shares.items() if share > LARGEST_SHARE} == {}


def test_names_that_say_nothing_are_used_within_few_lines_only():
    assert [use for file in house.source_files() for use in house.empty_names(file)] == []


@pytest.fixture(scope="module")
def code() -> measurement_path.Code:
    return measurement_path.Code(house.ROOT)


def test_a_measurement_stops_at_few_modules_on_its_way_through_the_posterior_method(code):
    walk = measurement_path.posterior_walk(code)
    assert len(walk.places) > 10
    assert len(walk.modules) <= MOST_STOPS, walk.modules
    assert len(walk.returns) <= MOST_RETURNS, walk.returns


def test_few_functions_take_an_assembly_and_a_measurement(code):
    places = measurement_path.separate_parameters(code)
    assert len(places) <= MOST_SEPARATE, "\n".join(map(str, places))


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
        ("identification", "dovetail/measurement/frf_files.py", "dovetail/report/html_report.py", 72),
        ("synthesis", "dovetail/assembly/model.py", "dovetail/synthesis/codegen/compiler.py", 10),
    ],
)
def test_following_a_measurement_or_theta_through_the_code_enters_few_files(trips, trip, first, last, most):
    files = trips[trip]
    assert files[0] == first
    assert last in files
    assert len(files) <= most, "\n".join(files)


def test_a_module_defines_each_of_its_names_once():
    """Two files that are merged may each bring a constant of the same name, and the second silently wins."""
    twice = {file.name: list(house.names_defined_twice(file)) for file in house.source_files()}
    assert {name: names for name, names in twice.items() if names} == {}
