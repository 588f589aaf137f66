"""What a file says of its frequencies, its estimator and the parts of its values, compared with its numbers."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from dovetail.measurement import read_frf
from support.measured_files import fault_of
from support.statement_files import FREQUENCY, LINES, TEXTS, VALUES, Said

pytestmark = [pytest.mark.usefixtures("unguarded"), pytest.mark.sweep]


def written(tmp_path: Path, form: str, name: str, text: str | float) -> Path:
    """Write 12 lines from 10 Hz, 2.5 Hz apart, with a line or a text that states something."""
    file, write = (LINES | TEXTS)[form]
    said = Said(lines=(f"{name}: {text}",)) if form in LINES else Said(texts={name: text})
    return write(tmp_path / file, said)


IMPOSSIBLE = [("df", "1.25 Hz"), ("frequency step", "0.0025 Hz"), ("Frequency resolution", "15.708 Hz")]


@pytest.mark.parametrize(("name", "text"), IMPOSSIBLE)
@pytest.mark.parametrize("form", [*LINES, *TEXTS])
def test_a_step_that_the_frequencies_cannot_have_is_refused(tmp_path: Path, form: str, name: str, text: str) -> None:
    path = written(tmp_path, form, name.replace(" ", "_") if form in TEXTS else name, text)
    if text != "1.25 Hz":  # of which every second line may have been exported
        assert "step" in fault_of(path, quantity="accelerance")
        skip = {"skip": name.replace(" ", "_") if form in TEXTS else name}
        np.testing.assert_allclose(read_frf(path, quantity="accelerance", names=skip).values, VALUES, rtol=1e-9)
    else:
        with pytest.warns(UserWarning, match="a step of 1.25 Hz, and the lines are 2.5 Hz apart"):
            read_frf(path, quantity="accelerance")


DOUBTFUL = [
    ("Number of lines", "400", "400 lines, and there are 12"), ("Start frequency", "20 Hz", "begin at 10 Hz"),
    ("Stop frequency", "0.03 kHz", "end at 37.5 Hz"), ("Frequency range", "0 - 30 Hz", "end at 37.5 Hz"),
    ("Frequency range", "5 Hz to 200 kHz", "an end at 200000 Hz"), ("Sampling rate", "70 Hz", "above half of it"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "text", "said"), DOUBTFUL)
@pytest.mark.parametrize("form", [*LINES, *TEXTS])
def test_a_setting_that_the_frequencies_contradict_gives_a_warning(
    tmp_path: Path, form: str, name: str, text: str, said: str
) -> None:
    path = written(tmp_path, form, name.replace(" ", "_") if form in TEXTS else name, text)
    with pytest.warns(UserWarning, match=said):
        np.testing.assert_allclose(read_frf(path, quantity="accelerance").values, VALUES, rtol=1e-9)


SOUND = [
    ("df", "2.5 Hz"), ("Frequency resolution", "2.51 Hz"), ("Lines", "12"), ("Frequency lines", "13"),
    ("Start frequency", "0 Hz"), ("Stop frequency", "1 kHz"), ("Frequency range", "0 - 1000 Hz"), ("fs", "5.12"),
    ("Sampling rate", "51200 Hz"), ("Resolution", "24 bit"), ("Sample", "5"), ("Range", "10"), ("max", "3"),
    ("First natural frequency", "1000 Hz"), ("Cutoff frequency", "20 Hz"), ("Start", "08:15"), ("Line", "7"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "text"), SOUND)
@pytest.mark.parametrize("form", [*LINES, *TEXTS])
def test_settings_that_agree_or_are_of_something_else_give_none(
    tmp_path: Path, form: str, name: str, text: str
) -> None:
    path = written(tmp_path, form, name.replace(" ", "_") if form in TEXTS else name, text)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        np.testing.assert_allclose(read_frf(path, quantity="accelerance").values, VALUES, rtol=1e-9)


@pytest.mark.parametrize(("name", "number"), [("n_lines", 400.0), ("f_max", 30.0), ("stop_frequency", 30.0)])
@pytest.mark.parametrize("form", ["npz", "mat 5", "hdf5"])
def test_numbers_of_an_archive_are_compared_too(tmp_path: Path, form: str, name: str, number: float) -> None:
    path = written(tmp_path, form, name, number)
    with pytest.warns(UserWarning, match=f"{name}: the file gives"):
        read_frf(path, quantity="accelerance")


@pytest.mark.parametrize(
    "text", ["values in dB", "data: dB", "Real and imaginary part in dB", "data format: Magnitude (dB)/Phase (deg)"]
)
@pytest.mark.parametrize("form", LINES)
def test_decibels_of_complex_values_are_refused(tmp_path: Path, form: str, text: str) -> None:
    file, write = LINES[form]
    path = write(tmp_path / file, Said(lines=(text,)))
    assert "complex numbers" in fault_of(path, quantity="accelerance")
    read_frf(path, quantity="accelerance", names={"skip": text})


@pytest.mark.parametrize("text", ["Format: amplitude, phase", "data format: Magnitude/Phase (deg)"])
@pytest.mark.parametrize("form", LINES)
def test_other_parts_than_those_of_the_columns_give_a_warning(tmp_path: Path, form: str, text: str) -> None:
    file, write = LINES[form]
    with pytest.warns(UserWarning, match="the parts of the values are amplitude and phase here"):
        read_frf(write(tmp_path / file, Said(lines=(text,))), quantity="accelerance")
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        read_frf(write(tmp_path / file, Said(lines=("Format: Real/Imag",))), quantity="accelerance")


def test_an_estimator_is_compared_with_the_names_of_the_columns(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = "\n".join(f"{f},{v.real},{v.imag}" for f, v in zip(FREQUENCY, VALUES, strict=True))
    path.write_text(f"# Estimator: H1\nfrequency_Hz,H2 real,H2 imag\n{rows}\n")
    with pytest.warns(UserWarning, match="estimated as H1 here, and as H2"):
        read_frf(path, quantity="accelerance")
