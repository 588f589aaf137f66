"""LabVIEW measurement files, written by hand as National Instruments specifies them."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from dovetail.measurement import read_frf
from dovetail.measurement.impact_test.signal_files import read_signals
from support.labview_files import HEADER, SEGMENT

FREQUENCY = np.array([10.0, 12.5, 15.0])
VALUES = np.array([1.5 - 2j, 3 + 0.25j, -4.125j])


def check(frf) -> None:
    np.testing.assert_array_equal(frf.frequency, FREQUENCY)
    np.testing.assert_allclose(frf.values, VALUES, rtol=1e-14, atol=1e-15)
    assert frf.quantity == "accelerance"


def test_a_labview_file_may_be_called_txt(tmp_path: Path) -> None:
    path = tmp_path / "frf.TXT"
    path.write_text("\ufeff" + HEADER + SEGMENT, encoding="utf-8")
    check(read_frf(path))


def test_a_single_channel_is_read_with_a_shared_or_an_own_abscissa(tmp_path: Path) -> None:
    """Of one channel LabVIEW writes the same, whether each has an abscissa of its own or all have one."""
    one = "\n".join(
        "\t".join(line.split("\t")[:2]) for line in SEGMENT.replace("Channels\t2", "Channels\t1").splitlines()
    )
    magnitude = one.replace("FRF (Real)", "FRF Magnitude").replace("-", "")
    (tmp_path / "a.lvm").write_text(HEADER.replace("Columns\tOne", "Columns\tMulti") + magnitude + "\n")
    frf = read_frf(tmp_path / "a.lvm", names={"amplitude": "FRF Magnitude"})
    np.testing.assert_allclose(frf.amplitude, [1.5, 3.0, 0.0])
    np.testing.assert_array_equal(frf.frequency, FREQUENCY)


def without_axis(text: str) -> str:
    """The same file with X_Columns No: the first cell of each row is empty."""
    above, header, rows = text.partition("X_Value\tFRF (Real)\tFRF (Imag)\tComment\n")
    rows = "".join("\t" + row.partition("\t")[2] + "\n" for row in rows.splitlines())
    return above.replace("X_Columns\tOne", "X_Columns\tNo") + header + rows


VARIANTS = {
    "as specified": HEADER + SEGMENT,
    "line ends of Windows": (HEADER + SEGMENT).replace("\n", "\r\n"),
    "no axis": without_axis(HEADER + SEGMENT),
    "decimal comma": (HEADER + SEGMENT).replace("Separator\t.", "Separator\t,").replace(".", ","),
    "separator comma": (HEADER.replace("Separator\tTab", "Separator\tComma") + SEGMENT).replace("\t", ","),
    "kHz": (HEADER + SEGMENT)
    .replace("\tHz\tHz", "\tkHz\tkHz")
    .replace("X0\t10.0\t10.0", "X0\t0.01\t0.01")
    .replace("Delta_X\t2.5\t2.5", "Delta_X\t0.0025\t0.0025")
    .replace("\n10.0\t", "\n0.01\t")
    .replace("\n12.5\t", "\n0.0125\t")
    .replace("\n15.0\t", "\n0.015\t"),
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_an_frf_is_read_from_every_variant(tmp_path: Path, variant: str) -> None:
    (tmp_path / "a.lvm").write_bytes(VARIANTS[variant].encode())
    check(read_frf(tmp_path / "a.lvm"))


def test_amplitude_phase_and_coherence_are_read(tmp_path: Path) -> None:
    text = (HEADER + SEGMENT).replace("FRF (Real)\tFRF (Imag)\tComment", "FRF (Magnitude)\tFRF (Phase)\tCoherence")
    text = text.replace("m/s^2/N\tm/s^2/N\t", "g/N\tdeg\t")
    text = text.partition("10.0\t1.5")[0] + "10\t2\t90\t0.5\n20\t1\t180\t1\n"
    text = text.replace("Channels\t2", "Channels\t3").replace("Samples\t3\t3", "Samples\t2\t2")
    (tmp_path / "a.lvm").write_text(text)
    frf = read_frf(tmp_path / "a.lvm")
    np.testing.assert_allclose(frf.values, [2j * 9.80665, -9.80665], atol=1e-14)
    np.testing.assert_array_equal(frf.coherence, [0.5, 1])


def test_one_of_several_segments_and_named_columns_are_chosen(tmp_path: Path, refused) -> None:
    twice = HEADER + SEGMENT.replace("3.0", "7.0") + "\n" + SEGMENT
    assert refused("a.lvm", twice) == (
        "a.lvm\n  the file holds 2 segments; choose one:\n    1: FRF (Real), FRF (Imag)\n"
        "    2: FRF (Real), FRF (Imag)\n  Choose it by its number, for example `index=1`."
    )
    check(read_frf(tmp_path / "a.lvm", index=2))
    assert "choose one" in refused("a.lvm", twice, index=3)
    assert refused("a.lvm", HEADER + SEGMENT.replace("FRF (Real)", "FRF A")).startswith(
        "a.lvm: segment 1\n  the values cannot be found by their names; the file holds:\n    frequency: Hz\n"
    )
    untitled = HEADER + SEGMENT.replace("FRF (Real)\tFRF (Imag)", "Untitled\tUntitled 1")
    assert "`columns=['frequency', 'real', 'imag', 'skip']`" in refused("a.lvm", untitled)
    check(read_frf(tmp_path / "a.lvm", columns=("frequency", "real", "imag"), quantity="accelerance"))
    names = {"real": "Untitled", "imag": "Untitled 1"}
    check(read_frf(tmp_path / "a.lvm", names=names))
    assert refused("a.lvm", untitled, columns=("frequency", "amplitude")) == (
        "a.lvm: segment 1\n  the segment has 3 columns, and 2 are named.\n  Accepted: frequency,amplitude"
    )


TIME = (HEADER + SEGMENT).replace("\tFrequency\tFrequency", "\tTime\tTime")
FAULTS = {
    HEADER + SEGMENT.replace("Samples\t3\t3", "Samples\t3\t4"): (
        "a.lvm: segment 1\n  the header announces 4 samples, and there are 3 rows.\n  The file is truncated"
    ),
    HEADER + SEGMENT.replace("Delta_X\t2.5\t2.5", "Delta_X\t4\t4"): (
        "a.lvm: segment 1  Delta_X\n  the file gives a step of 4 Hz, and the lines are 2.5 Hz apart."
    ),
    "hello\n": "a.lvm\n  this is not a LabVIEW measurement file",
    HEADER: "a.lvm\n  the LabVIEW file is damaged: ",
    HEADER + SEGMENT.partition("10.0\t1.5")[0]: "a.lvm: segment 1\n  there is no line of numbers.",
    HEADER + SEGMENT.replace("0.25", "x"): "a.lvm: segment 1, line 2\n  the value is (3+nanj), which is not finite.",
    HEADER + SEGMENT.replace("\t0.25", ""): "a.lvm: segment 1, line 2\n  the value is (3+nanj), which is not finite.",
    HEADER + SEGMENT.replace("12.5", "1.25"): "a.lvm: segment 1, line 2\n  the frequency 1.25 Hz comes after 10 Hz.",
    HEADER + SEGMENT.replace("Channels\t2", "Channels\t9" * 3000): "a.lvm",
    HEADER + SEGMENT.replace("Samples\t3", "Samples\t" + "(" * 9000): "a.lvm\n  the LabVIEW file is damaged: ",
    (HEADER + SEGMENT).replace("Columns\tOne", "Columns\tMulti"): "a.lvm: segment 1\n  the file has X_Columns 'Multi'.",
    without_axis(HEADER + SEGMENT).replace("Delta_X\t2.5", "Delta_X\t0"): (
        "a.lvm: segment 1\n  the abscissa has X0 = 10 and Delta_X = 0."
    ),
    (HEADER + SEGMENT).replace("\tHz", "\trpm"): "a.lvm: segment 1\n  the frequency is in 'rpm'.",
    TIME: "a.lvm: segment 1\n  the abscissa is time, the channels are FRF (Real), FRF (Imag).\n",
}


@pytest.mark.parametrize("text", FAULTS, ids=range(len(FAULTS)))
def test_faulty_input_is_refused_with_its_message(refused, text: str) -> None:
    assert refused("a.lvm", text).startswith(FAULTS[text])


def test_a_start_behind_the_first_row_gives_a_warning(tmp_path: Path) -> None:
    (tmp_path / "a.lvm").write_text(HEADER + SEGMENT.replace("X0\t10.0", "X0\t20.0"))
    with pytest.warns(UserWarning, match="X0: the file gives a start at 20 Hz, and the frequencies begin at 10 Hz"):
        check(read_frf(tmp_path / "a.lvm"))
    (tmp_path / "b.lvm").write_text((HEADER + SEGMENT).replace("X0\t10.0", "X0\t0.0").replace("X\t2.5", "X\t1.0"))
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        check(read_frf(tmp_path / "b.lvm"))  # as LabVIEW writes them of signals without a start and a step


def test_dofs_are_refused_and_a_missing_package_is_named(
    refused, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert refused("a.lvm", HEADER + SEGMENT, response="1").startswith("a.lvm\n  DOFs choose no FRF of this file.")
    monkeypatch.setitem(sys.modules, "lvm_read", None)
    with pytest.raises(Exception, match=r'pip install "dovetail-frf\[lvm\]"'):
        read_frf(tmp_path / "a.lvm")


def test_time_records_are_read(tmp_path: Path) -> None:
    rows = "".join(f"\t{n % 5},5\t{n},25\n" for n in range(8))
    segment = (
        "Channels\t2\t\t\nSamples\t8\t8\t\nY_Unit_Label\tNewtons\tg\t\nX_Dimension\tTime\tTime\t\nX0\t0,0\t0,0\t\n"
        "Delta_X\t3,906250E-5\t3,906250E-5\t\n***End_of_Header***\t\t\t\n"
        f"X_Value\tExcitation (Trigger)\tResponse (Trigger)\tComment\n{rows}"
    )
    header = HEADER.replace("Separator\t.", "Separator\t,").replace("X_Columns\tOne", "X_Columns\tNo")
    (tmp_path / "a.lvm").write_text(f"{header}{segment}\n{segment}")
    signals = read_signals(tmp_path / "a.lvm")
    assert signals.rate == pytest.approx(25600)
    assert signals.quantity == "accelerance"
    np.testing.assert_allclose(signals.force, [np.arange(8) % 5 + 0.5] * 2)
    np.testing.assert_allclose(signals.response, np.array([np.arange(8) + 0.25] * 2) * 9.80665)
    (tmp_path / "b.lvm").write_text(f"{header}{segment.replace('Excitation', 'Sensor')}")
    with pytest.raises(Exception, match="the abscissa is time, the channels are Sensor"):
        read_signals(tmp_path / "b.lvm")
