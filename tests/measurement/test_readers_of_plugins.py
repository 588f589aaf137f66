"""Readers of plugins: which one takes a file, how its result is checked, and the messages."""

from __future__ import annotations

import numpy as np
import pytest

import dovetail
from dovetail import MeasurementError, PluginError

HEAD = """\
import numpy as np
import dovetail

class Lab(dovetail.FrfReader):
    '''Two FRFs.'''
    name = "lab"
    summary = "a format of the laboratory"
    suffixes = (".lab", ".csv")

    def sniff(self, content):
        return content.startswith(b"LAB")

"""
TAIL = """
@dovetail.hookimpl
def dovetail_components():
    return [Lab]
"""
LINES = "np.array([10.0, 20.0, 30.0])"
TWO = f"""
    def read(self, path, content):
        values = np.array([1.0, 2.0j, 3.0])
        first = dovetail.RecordedFrf({LINES}, values, "g/N", response="3+x", force="1-x", averages=4)
        return [first, dovetail.RecordedFrf({LINES}, values, "um/N", response="2+x", force="1+x")]
"""


def plugin(tmp_path, body, name="lab.py"):
    file = tmp_path / name
    file.write_text(HEAD + body + TAIL)
    return file


@pytest.fixture
def measured(tmp_path):
    file = tmp_path / "block.lab"
    file.write_bytes(b"LAB 1")
    return file


def test_an_frf_is_chosen_by_its_dof_and_converted_to_si(tmp_path, measured):
    frf = dovetail.read_frf(measured, response="3+x", plugins=plugin(tmp_path, TWO))
    assert (frf.quantity, frf.response, frf.averages, frf.label) == ("accelerance", "3+x", 4, "block.lab")
    np.testing.assert_allclose(frf.values, -9.80665 * np.array([1.0, 2.0j, 3.0]))  # against the force's direction
    assert dovetail.read_frf(measured, index=2, plugins=plugin(tmp_path, TWO)).quantity == "receptance"


def test_one_of_several_has_to_be_chosen(tmp_path, measured):
    with pytest.raises(MeasurementError) as error:
        dovetail.read_frf(measured, plugins=plugin(tmp_path, TWO))
    fault = error.value.faults[0]
    assert fault.problem == ("the file holds 2 FRFs; choose one:\n    1: 3+x over 1-x\n    2: 2+x over 1+x")


def test_a_file_of_another_format_is_left_to_dovetail(tmp_path):
    file = tmp_path / "table.csv"
    file.write_text("frequency_Hz,real,imag\n10,1,0\n20,2,0\n")
    frf = dovetail.read_frf(file, quantity="mobility", plugins=plugin(tmp_path, TWO))
    assert frf.values.tolist() == [1.0, 2.0]
    file.write_text("LAB 1")
    assert dovetail.read_frf(file, index=1, plugins=plugin(tmp_path, TWO)).averages == 4


def test_several_readers_of_a_file_are_listed_and_one_can_be_chosen(tmp_path, measured):
    files = [plugin(tmp_path, TWO), plugin(tmp_path, TWO.replace('"um/N"', '"mm/N"'), "other.py")]
    with pytest.raises(MeasurementError) as error:
        dovetail.read_frf(measured, index=2, plugins=files)
    fault = error.value.faults[0]
    assert (fault.problem, fault.accepted) == ("several readers take this file.", "lab:lab, other:lab")
    frf = dovetail.read_frf(measured, index=2, plugins=files, reader="other:lab")
    np.testing.assert_allclose(frf.values, 1e-3 * np.array([1.0, 2.0j, 3.0]))


@pytest.mark.parametrize(
    ("body", "error", "problem"),
    [
        ("raise ValueError('line 3 is cut.')", MeasurementError, "line 3 is cut."),
        ("raise KeyError('f')", PluginError, "reader 'lab' failed: KeyError: 'f'"),
        ("return []", MeasurementError, "the file holds no FRF."),
        ("return [1.0]", PluginError, "read returned [1.0]."),
        (f"return [dovetail.RecordedFrf({LINES}, [1, 2, 3])]", PluginError, "its values are list."),
        (
            f"return [dovetail.RecordedFrf({LINES}, np.ones(2))]",
            PluginError,
            "its values are shape (2,), float64.",
        ),
        (
            f"return [dovetail.RecordedFrf({LINES}, np.array([1, np.nan, 1j]), 'um/N')]",
            MeasurementError,
            "the value is (nan+0j), which is not finite.",
        ),
        (
            f"return [dovetail.RecordedFrf({LINES}[::-1], np.ones(3), 'um/N')]",
            MeasurementError,
            "the frequency 20 Hz comes after 30 Hz.",
        ),
        (f"return [dovetail.RecordedFrf({LINES}, np.ones(3), 'um')]", MeasurementError, None),
    ],
)
def test_the_contents_returned_by_a_reader_are_checked(tmp_path, measured, body, error, problem):
    read = f"\n    def read(self, path, content):\n        {body}\n"
    with pytest.raises(error) as raised:
        dovetail.read_frf(measured, plugins=plugin(tmp_path, read))
    if problem is not None:
        assert raised.value.faults[0].problem == problem


def test_a_silent_file_asks_for_the_quantity(tmp_path, measured):
    read = f"\n    def read(self, path, content):\n        return [dovetail.RecordedFrf({LINES}, np.ones(3))]\n"
    file = plugin(tmp_path, read)
    with pytest.raises(MeasurementError, match="quantity"):
        dovetail.read_frf(measured, plugins=file)
    frf = dovetail.read_frf(measured, quantity="mobility", plugins=file)
    assert (frf.quantity, frf.has_phase) == ("mobility", False)


def test_an_unknown_suffix_lists_those_of_plugins(tmp_path):
    with pytest.raises(MeasurementError) as error:
        dovetail.read_frf(tmp_path / "a.xyz", plugins=plugin(tmp_path, TWO))
    fault = error.value.faults[0]
    assert fault.accepted.endswith(", .lab")
    assert fault.remedy == "For the format of a plugin file, add `plugins=`."


def one_frf(unit, note):
    return f"""
    def read(self, path, content):
        values = np.array([1.0, 2.0j, 3.0])
        return [dovetail.RecordedFrf({LINES}, values, {unit!r}, note={note!r})]
"""


@pytest.mark.parametrize(
    ("unit", "note", "message"),
    [
        ("g/N", "unit: um/N", "contradicts itself"),
        ("", "values in um/N", "is mentioned, and no unit of the values is given"),
        ("g/N", "gain 10 dB", "may act on the values"),
        ("N/m", "", "the unit 'N/m' is not understood"),
        ("1 ton/N", "", "the unit '1 ton/N' is not understood"),
        ("g/N", "quantity: mobility", "contradicts itself"),
    ],
)
def test_the_note_of_a_plugins_reader_is_held_against_its_unit(tmp_path, measured, unit, note, message):
    with pytest.raises(MeasurementError, match=message):
        dovetail.read_frf(
            measured, plugins=plugin(tmp_path, one_frf(unit, note)), quantity=None if unit else "mobility"
        )


def test_a_unit_in_the_note_of_a_plugins_reader_is_used(tmp_path, measured):
    frf = dovetail.read_frf(measured, plugins=plugin(tmp_path, one_frf("", "Unit: g/N")))
    np.testing.assert_allclose(frf.values, 9.80665 * np.array([1.0, 2.0j, 3.0]))
