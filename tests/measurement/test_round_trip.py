"""An FRF that is written is read back unchanged."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dovetail import atomic_files
from dovetail.errors import FileError, MeasurementError
from dovetail.frf import QUANTITIES, Frf
from dovetail.measurement import read_frf, write_frf

EXACT = [("a.csv", {}), ("a.npz", {}), ("a.uff", {"binary": True}), ("A.UNV", {"binary": True}), ("a.CSV", {})]


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize(("name", "options"), EXACT)
def test_every_digit_comes_back(tmp_path: Path, measured: Frf, quantity: str, name: str, options: dict) -> None:
    frf = measured.to(quantity)
    write_frf(frf, tmp_path / name, **options)
    back = read_frf(tmp_path / name)
    np.testing.assert_array_equal(back.frequency, frf.frequency)
    np.testing.assert_array_equal(back.values, frf.values)
    np.testing.assert_array_equal(back.coherence, frf.coherence)
    assert (back.quantity, back.has_phase, back.label) == (quantity, True, name)


@pytest.mark.parametrize("unit", [None, "um/N", "g/lbf"])
@pytest.mark.parametrize(("name", "options"), EXACT)
def test_all_that_is_known_comes_back(
    tmp_path: Path, measured: Frf, name: str, options: dict, unit: str | None
) -> None:
    variance = np.linspace(1, 2, measured.frequency.size)
    frf = replace(measured, averages=10, variance=variance, response="Tool:2+x", force="nut, left", note="bench 5")
    write_frf(frf, tmp_path / name, unit=unit, **options)
    back = read_frf(tmp_path / name)
    np.testing.assert_array_equal(back.frequency, frf.frequency)
    same = back.to("accelerance")
    np.testing.assert_allclose(same.values, frf.values, rtol=1e-14)
    np.testing.assert_allclose(same.variance, frf.variance, rtol=1e-14)
    np.testing.assert_array_equal(back.coherence, frf.coherence)
    assert (back.averages, back.response, back.force, back.note) == (10, "Tool:2+x", "nut, left", "bench 5")
    assert back.quantity == ("receptance" if unit == "um/N" else "accelerance")


@pytest.mark.parametrize(("name", "options"), EXACT)
def test_a_rotation_stays_one(tmp_path: Path, measured: Frf, name: str, options: dict) -> None:
    for path, unit in ((tmp_path / name, None), (tmp_path / f"b{name}", "mrad/(N m)")):
        write_frf(replace(measured, rotation=True), path, unit=unit, **options)
        back = read_frf(path)
        assert back.rotation
        np.testing.assert_allclose(back.to("accelerance").values, measured.values, rtol=1e-14)
    with pytest.raises(MeasurementError, match="'um/N' is not one of its units"):
        write_frf(replace(measured, rotation=True), tmp_path / "c.csv", unit="um/N")


@pytest.mark.parametrize(("name", "options"), EXACT)
@pytest.mark.parametrize(("rotation", "moment", "unit"), [(True, False, "mrad/N"), (False, True, "um/(N m)")])
def test_a_rotation_per_force_keeps_its_kind_in_every_format(
    tmp_path: Path, measured: Frf, name: str, options: dict, rotation: bool, moment: bool, unit: str
) -> None:
    frf = replace(measured, rotation=rotation, moment=moment, response="", force="")
    for path, written in ((tmp_path / name, None), (tmp_path / f"b{name}", unit)):
        write_frf(frf, path, unit=written, **options)
        back = read_frf(path)
        assert (back.rotation, back.by_moment, back.kind, back.to("accelerance").unit) == (
            rotation,
            moment,
            frf.kind,
            frf.unit,
        )
        np.testing.assert_allclose(back.to("accelerance").values, measured.values, rtol=1e-14)
    with pytest.raises(MeasurementError, match=f"is a {frf.kind}, and 'um/N' is not one of its units"):
        write_frf(frf, tmp_path / "c.csv", unit="um/N")


@pytest.mark.parametrize("name", ["a.csv", "a.npz", "a.uff"])
def test_an_amplitude_stays_one(tmp_path: Path, measured: Frf, name: str) -> None:
    write_frf(replace(measured, values=measured.amplitude, has_phase=False, coherence=None), tmp_path / name)
    back = read_frf(tmp_path / name)
    np.testing.assert_allclose(back.values, measured.amplitude, rtol=1e-11)
    assert not back.has_phase
    assert back.coherence is None


def test_ascii_uff_holds_twelve_digits(tmp_path: Path, measured: Frf) -> None:
    write_frf(measured, tmp_path / "a.uff")
    assert (tmp_path / "a.uff").read_bytes().isascii()
    back = read_frf(tmp_path / "a.uff")
    np.testing.assert_array_equal(back.frequency, measured.frequency)
    np.testing.assert_allclose(back.values, measured.values, rtol=1e-11)
    np.testing.assert_allclose(back.coherence, measured.coherence, rtol=1e-11)


def test_uneven_frequencies_of_six_digits_stay_ascii(tmp_path: Path) -> None:
    frf = Frf(np.array([10.0, 12.5, 1234.56]), np.array([1 + 2j, 3 - 4j, 5j]), "mobility")
    write_frf(frf, tmp_path / "a.uff")
    assert b"58b" not in (tmp_path / "a.uff").read_bytes()
    np.testing.assert_array_equal(read_frf(tmp_path / "a.uff").frequency, frf.frequency)


@pytest.mark.parametrize("frequency", [np.arange(1, 4000) / 3, 100 + 1.2345678 * np.arange(500.0) ** 1.5])
def test_frequencies_beyond_six_digits_are_written_binary(tmp_path: Path, frequency: np.ndarray) -> None:
    frf = Frf(frequency, np.ones(frequency.size), "mobility")
    write_frf(frf, tmp_path / "a.uff")
    np.testing.assert_array_equal(read_frf(tmp_path / "a.uff").frequency, frequency)
    with pytest.raises(MeasurementError, match="six digits that ASCII gives to frequencies cannot hold these"):
        write_frf(frf, tmp_path / "b.uff", binary=False)
    assert os.listdir(tmp_path) == ["a.uff"]


def test_overwriting_must_be_requested(tmp_path: Path, measured: Frf) -> None:
    for options in ({}, {"binary": True}):
        path = tmp_path / "a.uff"
        write_frf(measured, path, overwrite=True)
        with pytest.raises(FileError, match=r"a\.uff\n  the file already exists\.\n  Choose another name"):
            write_frf(measured.to("mobility"), path, **options)
        assert read_frf(path).quantity == "accelerance"
        write_frf(measured.to("mobility"), path, overwrite=True, **options)
        assert read_frf(path).quantity == "mobility"
    assert os.listdir(tmp_path) == ["a.uff"]


@pytest.mark.parametrize("name", ["a.csv", "a.npz", "a.uff"])
def test_a_coherence_that_is_not_finite_is_not_written(tmp_path: Path, measured: Frf, name: str) -> None:
    coherence = measured.coherence.copy()
    coherence[3] = np.nan
    with pytest.raises(MeasurementError, match="nothing is written"):
        write_frf(replace(measured, coherence=coherence), tmp_path / name)
    assert not os.listdir(tmp_path)


def test_one_line_goes_to_csv_and_not_to_uff(tmp_path: Path) -> None:
    frf = Frf(np.array([10.0]), np.array([1j]), "mobility")
    with pytest.raises(MeasurementError, match="needs two lines or more"):
        write_frf(frf, tmp_path / "a.uff")
    write_frf(frf, tmp_path / "a.csv")
    assert read_frf(tmp_path / "a.csv").values[0] == 1j


def test_a_write_that_fails_leaves_the_old_file(tmp_path: Path, measured: Frf, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.csv"
    write_frf(measured, path)

    def broken(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(atomic_files.os, "replace", broken)
    with pytest.raises(FileError, match="the file cannot be written: No space left on device"):
        write_frf(measured.to("mobility"), path, overwrite=True)
    assert os.listdir(tmp_path) == ["a.csv"]
    assert read_frf(path).quantity == "accelerance"


def test_a_missing_folder_is_reported(tmp_path: Path, measured: Frf) -> None:
    with pytest.raises(FileError, match="the file cannot be written: No such file or directory"):
        write_frf(measured, tmp_path / "missing" / "a.csv")


def test_binary_is_refused_for_other_files_than_uff(tmp_path: Path, measured: Frf) -> None:
    with pytest.raises(MeasurementError, match=r"binary=True is for UFF files, not for \.csv"):
        write_frf(measured, tmp_path / "a.csv", binary=True)


def test_the_quantity_must_be_known_or_given(tmp_path: Path, refused) -> None:
    text = "frequency_Hz,real,imag\n1,2,3\n2,3,4\n"
    assert refused("a.csv", text) == (
        "a.csv\n  the file does not say which quantity it holds.\n  "
        "Give it: `quantity='accelerance'` or `unit='g/N'`.  "
        "Accepted: a quantity of receptance, mobility, accelerance, "
        "or a line '# quantity: accelerance' before the header"
    )
    assert read_frf(tmp_path / "a.csv", quantity="mobility").quantity == "mobility"
    assert refused("a.csv", text, quantity="acelerance") == (
        "the argument quantity\n  'acelerance' is not a quantity.\n"
        "  Did you mean 'accelerance'?  Accepted: receptance, mobility, accelerance"
    )


@pytest.mark.parametrize("name", ["a.csv", "a.npz", "a.uff"])
def test_the_quantity_must_not_contradict_the_file(tmp_path: Path, measured: Frf, name: str) -> None:
    write_frf(measured, tmp_path / name)
    assert read_frf(tmp_path / name, quantity="accelerance").quantity == "accelerance"
    with pytest.raises(MeasurementError, match="the file says that it holds accelerance, the argument says mobility"):
        read_frf(tmp_path / name, quantity="mobility")


@pytest.mark.parametrize("unit", ["\N{MICRO SIGN}m/N", "\N{GREEK SMALL LETTER MU}m/N", "mm/s²/N"])
def test_a_unit_with_signs_beyond_ascii_comes_back_from_a_universal_file(
    tmp_path: Path, measured: Frf, unit: str
) -> None:
    frf = measured.to("accelerance" if "s" in unit else "receptance")
    write_frf(frf, tmp_path / "a.uff", unit=unit, binary=True)
    np.testing.assert_allclose(read_frf(tmp_path / "a.uff").values, frf.values, rtol=1e-12)
