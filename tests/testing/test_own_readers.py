"""The readers that ship with Dovetail, tested as anybody's: by the conformance kit, and in a package of their own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import dovetail
import dovetail_plugins
from dovetail.registry import installed_components
from dovetail.testing import check_component, check_names
from dovetail.testing.kit import each_check

READERS = [offer.component for offer in installed_components().offers("reader")]
GUARDED = ("hdf5", "matlab")
MOVED = {"cutpro": "cutpro", "labview": "labview", "npz": "numpy_files", "npy": "numpy_files", "text": "text"}
"""Readers in a single file."""
OFFER = """

import dovetail

@dovetail.hookimpl
def dovetail_components():
    own = [one for one in globals().values() if isinstance(one, type) and one.__module__ == __name__]
    return [one for one in own if issubclass(one, dovetail.FrfReader)]
"""
QUANTITIES = {"npy": "mobility"}
"""Of samples that do not state it."""


def faults(results):
    return [f"{one.name}: {one.problem}" for one in results if one.outcome in ("failed", "warning", "not run")]


def test_every_format_has_a_reader():
    suffixes = {suffix for reader in READERS for suffix in reader.default_for}
    assert {".uff", ".unv", ".csv", ".txt", ".npz", ".npy", ".mat", ".h5", ".hdf5", ".frf", ".lvm"} <= suffixes
    assert {suffix for reader in READERS for suffix in reader.written} == {".uff", ".unv", ".csv", ".npz"}


@pytest.mark.parametrize("reader", [one for one in READERS if one.name not in GUARDED], ids=lambda one: one.name)
def test_a_reader_conforms(reader):
    results = check_component(reader)
    assert faults(results) == []
    assert sum(result.passed for result in results) >= 10
    assert [result.name for result in results] == list(check_names("reader"))


@pytest.mark.parametrize("reader", [one for one in READERS if one.name in GUARDED], ids=lambda one: one.name)
def test_a_reader_in_a_guarded_process_conforms_with_intact_files(reader):
    """Without the damaged copies, each of which starts a process."""
    names = (
        "sample_files_are_read",
        "other_files_are_not_taken",
        "reading_twice_gives_the_same",
        "written_files_are_read",
    )
    assert faults(each_check(reader, names)) == []


@pytest.mark.slow
@pytest.mark.parametrize("reader", [one for one in READERS if one.name in GUARDED], ids=lambda one: one.name)
def test_a_reader_in_a_guarded_process_conforms(reader):
    assert faults(check_component(reader)) == []


@pytest.mark.parametrize("name", MOVED)
def test_a_reader_moved_to_another_package_works_unchanged(tmp_path, name):
    source = Path(dovetail_plugins.__file__).parent / "readers" / f"{MOVED[name]}.py"
    package = tmp_path / "my_lab.py"
    package.write_text(source.read_text(encoding="utf-8") + OFFER, encoding="utf-8")
    own = next(one for one in READERS if one.name == name)
    for sample in own().samples(tmp_path):
        expected = dovetail.read_frf(sample, quantity=QUANTITIES.get(name))
        frf = dovetail.read_frf(sample, reader=f"my_lab:{name}", plugins=package, quantity=QUANTITIES.get(name))
        np.testing.assert_array_equal(frf.frequency, expected.frequency)
        np.testing.assert_array_equal(frf.values, expected.values)
        assert frf.quantity == expected.quantity
