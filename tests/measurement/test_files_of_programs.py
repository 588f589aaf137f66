"""Files as programs write them that state things in places of their own: PULSE, Testlab, MATLAB, CutPro."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from dovetail.measurement import read_frf
from support.matlab_files import matlab_7_3
from support.measured_files import fault_of, set_58, write_sets
from support.statement_files import FREQUENCY, VALUES

pytestmark = pytest.mark.usefixtures("unguarded")

PULSE = """\
Header Size:\t 8\t \t
Data Type:\tComplex\t \t
X-Axis size:\t4\t \t
X-Axis unit:\tHz\t \t
X-Axis delta:\t 1.0\t \t
AmplitudeUnit:\t(mm/s²)/N\t \t
Function:\tFrequency Response\t \t
Z-axis:\t \t 0.0\t
1\t 10.0\t 1.0\t-0.1
2\t 11.0\t 1.2\t-0.2
3\t 12.0\t 1.4\t-0.3
TagsBegin:\t \t \t
TagsEnd:\t \t \t
"""


def test_pulse_text_with_a_footer_is_read(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text(PULSE, encoding="utf-8")
    frf = read_frf(tmp_path / "a.txt", columns=("skip", "frequency", "real", "imag"))
    np.testing.assert_allclose(frf.values, np.array([1 - 0.1j, 1.2 - 0.2j, 1.4 - 0.3j]) * 1e-3)
    assert frf.quantity == "accelerance"


@pytest.mark.parametrize("last", ["3\t 12.0\t 1.4", "3\t 12.0", "3", "3\t 12.0\t 1.4\tx"])
def test_a_damaged_row_is_not_taken_for_a_footer(tmp_path: Path, last: str) -> None:
    (tmp_path / "a.txt").write_text(PULSE.replace("3\t 12.0\t 1.4\t-0.3", last), encoding="utf-8")
    fault_of(tmp_path / "a.txt", columns=("skip", "frequency", "real", "imag"))


def struct_of_testlab(label: str, factor: float) -> dict[str, Any]:
    x = {"start_value": 10.0, "increment": 2.5, "number_of_values": 12.0}
    x["quantity"] = {"label": "Hz", "quantity_terms": "FREQUENCY", "unit_transformation": {"factor": 1.0}}
    unit = {"label": label, "quantity_terms": "ACCELERATION/FORCE", "unit_transformation": {"factor": factor}}
    record = {"name": "FRF Point2:+Z/Point1:+Z", "type": "FRF"}
    return {"x_values": x, "y_values": {"values": VALUES, "quantity": unit}, "function_record": record}


@pytest.mark.parametrize(
    ("label", "factor", "si"),
    [("g/N", 9.80665, 9.80665), ("g/N", 1 / 9.80665, 1.0), ("m/s^2/N", 1.0, 1.0), ("g/N", 1.0, 9.80665)],
)
def test_a_struct_of_testlab_is_read(tmp_path: Path, label: str, factor: float, si: float) -> None:
    """The factor is that to SI, or that by which Testlab multiplies SI values to show them in the label's unit."""
    savemat(tmp_path / "a.mat", {"FRF_1": struct_of_testlab(label, factor)})
    frf = read_frf(tmp_path / "a.mat")
    np.testing.assert_allclose(frf.frequency, FREQUENCY)
    np.testing.assert_allclose(frf.values, VALUES * si)


def test_a_factor_of_testlab_that_the_label_does_not_explain_is_refused(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"FRF_1": struct_of_testlab("g/N", 3.0)})
    assert "unit_transformation.factor' = 3 is not understood" in fault_of(tmp_path / "a.mat")


def test_one_of_several_structs_of_testlab_is_chosen_by_its_frequency(tmp_path: Path) -> None:
    other = struct_of_testlab("g/N", 1 / 9.80665)
    savemat(tmp_path / "a.mat", {"FRF_1": struct_of_testlab("m/s^2/N", 1.0), "FRF_2": other})
    assert "may each be the frequency" in fault_of(tmp_path / "a.mat")
    names = {"frequency": "FRF_2.x_values.frequency", "values": "FRF_2.y_values.values"}
    np.testing.assert_allclose(read_frf(tmp_path / "a.mat", names=names).values, VALUES)


STEPS = [("df", "f_start"), ("delta_f", "f0"), ("increment", "start_value"), ("freq_step", "fmin")]


@pytest.mark.parametrize("names", STEPS)
@pytest.mark.parametrize("form", ["npz", "mat", "mat 7.3", "h5"])
def test_start_and_step_are_an_axis(tmp_path: Path, form: str, names: tuple[str, str]) -> None:
    arrays = {"H1": VALUES, names[0]: 2.5, names[1]: 10.0, "unit": "um/N"}
    frf = read_frf(archive(tmp_path, form, arrays))
    np.testing.assert_allclose(frf.frequency, FREQUENCY)
    np.testing.assert_allclose(frf.values, VALUES * 1e-6)


@pytest.mark.parametrize("form", ["npz", "mat", "h5"])
def test_a_step_without_a_start_is_refused(tmp_path: Path, form: str) -> None:
    message = fault_of(archive(tmp_path, form, {"H1": VALUES, "df": 2.5}), quantity="mobility")
    assert "'df' is the step of the frequency, and there is no start." in message


def archive(tmp_path: Path, form: str, arrays: dict[str, Any]) -> Path:
    path = tmp_path / f"a.{form.split()[0]}"
    if form == "npz":
        np.savez(path, **arrays)
    elif form == "mat":
        savemat(path, arrays)
    elif form == "mat 7.3":
        matlab_7_3(path, **arrays)
    else:
        with h5py.File(path, "w") as file:
            for name, array in arrays.items():
                file[name] = array
    return path


@pytest.mark.parametrize("form", ["npz", "mat", "mat 7.3", "h5"])
def test_the_columns_of_a_matrix_are_read(tmp_path: Path, form: str) -> None:
    path = archive(tmp_path, form, {"data": np.column_stack([FREQUENCY, VALUES.real, VALUES.imag]), "unit": "um/N"})
    frf = read_frf(path, columns=("frequency", "real", "imag"))
    np.testing.assert_allclose(frf.frequency, FREQUENCY)
    np.testing.assert_allclose(frf.values, VALUES * 1e-6)
    amplitudes = archive(tmp_path, form, {"data": np.column_stack([FREQUENCY / 1e3, np.abs(VALUES)])})
    frf = read_frf(amplitudes, columns=("frequency [kHz]", "amplitude [g/N]"))
    np.testing.assert_allclose(frf.values, np.abs(VALUES) * 9.80665)
    pair = archive(tmp_path, form, {"M": np.column_stack([FREQUENCY + 0j, VALUES])})
    np.testing.assert_allclose(read_frf(pair, quantity="mobility").values, VALUES)
    with_gain = archive(tmp_path, form, {"data": np.column_stack([FREQUENCY, np.abs(VALUES)]), "gain": 2.0})
    assert "'gain' = 2" in fault_of(with_gain, columns=("frequency", "amplitude"), quantity="mobility")


@pytest.mark.parametrize("form", ["mat", "mat 7.3"])
def test_an_element_of_an_array_of_structs_is_chosen_by_its_frequency(tmp_path: Path, form: str) -> None:
    path = tmp_path / "a.mat"
    if form == "mat":
        kind = [("frequency", object), ("H", object), ("unit", object)]
        elements = [(FREQUENCY, VALUES, "um/N"), (FREQUENCY, VALUES * 2, "mm/N")]
        savemat(path, {"data": np.array(elements, dtype=kind)})
        names = {"frequency": "data(2).frequency"}
    else:
        with h5py.File(path, "w", userblock_size=512) as file:
            for field, arrays in (("frequency", [FREQUENCY] * 2), ("amplitude", [abs(VALUES), abs(VALUES) * 2])):
                targets = [file.create_dataset(f"#refs#/{field}{number}", data=a) for number, a in enumerate(arrays)]
                for target in targets:
                    target.attrs["MATLAB_class"] = np.bytes_("double")
                references = np.array([[target.ref] for target in targets], dtype=h5py.ref_dtype)
                file.create_dataset(f"data/{field}", data=references)
        with path.open("r+b") as stream:
            stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
        names = {"frequency": "data(2)/frequency"}
    frf = read_frf(path, names=names, **({} if form == "mat" else {"unit": "mm/N"}))
    expected = VALUES * 2e-3
    np.testing.assert_allclose(frf.values, expected if form == "mat" else abs(expected))


@pytest.mark.parametrize("delay", ["InputDelay", "OutputDelay", "IODelay"])
@pytest.mark.parametrize("value", [0.0, 1e-3])
def test_a_delay_of_frequency_response_data_is_refused_unless_zero(tmp_path: Path, delay: str, value: float) -> None:
    data = {"ResponseData": VALUES.reshape(1, 1, -1), "Frequency": FREQUENCY, "FrequencyUnit": "Hz", delay: [[value]]}
    savemat(tmp_path / "a.mat", {"sys": data})
    if value:
        assert delay in fault_of(tmp_path / "a.mat", quantity="mobility")
    else:
        np.testing.assert_allclose(read_frf(tmp_path / "a.mat", quantity="mobility").values, VALUES)


@pytest.mark.parametrize("labels", ["Freq Hz Imag m/N Real m/N", "Freq (Hz) Im (m/N) Re (m/N)"])
def test_imaginary_before_real_part_in_cutpro_files(tmp_path: Path, labels: str) -> None:
    (tmp_path / "a.frf").write_text(f"10 1 2 {labels}\n11 3 4\n")
    np.testing.assert_array_equal(read_frf(tmp_path / "a.frf").values, [2 + 1j, 4 + 3j])


@pytest.mark.parametrize("labels", ["Freq Hz Real m/N Real m/N", "Freq Hz Real m/N Scatter m/N", "Freq Hz Imag m/N"])
def test_other_labels_of_cutpro_files_are_refused(tmp_path: Path, labels: str) -> None:
    (tmp_path / "a.frf").write_text(f"10 1 2 {labels}\n11 3 4\n")
    fault_of(tmp_path / "a.frf")


def test_a_coherence_on_an_axis_with_other_rounding_is_kept(tmp_path: Path) -> None:
    frequency = 10.0 + np.arange(60) / 3.0
    rounded = np.array([float(f"{f:.5e}") for f in frequency])
    coherence = set_58(frequency, np.full(60, 0.9), func_type=6, ordinate_spec_data_type=0, orddenom_spec_data_type=0)
    path = write_sets(tmp_path / "a.uff", set_58(rounded, np.ones(60) + 1j), coherence | {"binary": 1})
    assert read_frf(path).coherence is not None
    shifted = coherence | {"x": frequency + 0.1, "binary": 1}
    path = write_sets(tmp_path / "b.uff", set_58(rounded, np.ones(60) + 1j), shifted)
    assert read_frf(path).coherence is None


def test_a_unit_that_set_164_contradicts_is_settled_by_the_caller(tmp_path: Path) -> None:
    units = {"type": 164, "units_code": 1, "length": 1.0, "force": 1.0, "temp": 1.0, "temp_offset": 0.0}
    frf = set_58(FREQUENCY, VALUES, ordinate_axis_units_lab="g", orddenom_axis_units_lab="N")
    path = write_sets(tmp_path / "a.uff", units, frf)
    assert "by its label and in SI by set 164" in fault_of(path)
    np.testing.assert_allclose(read_frf(path, unit="g/N").values, VALUES * 9.80665, rtol=1e-9)
    np.testing.assert_allclose(read_frf(path, unit="m/s^2/N").values, VALUES, rtol=1e-9)
    factors = write_sets(tmp_path / "b.uff", units | {"length": 39.37}, set_58(FREQUENCY, VALUES))
    assert "the factors to SI are not 1" in fault_of(factors)
