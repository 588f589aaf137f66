"""Units, quantities and numbers in every place of every format: used, contradicted, or refused with the place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dovetail.measurement import read_frf
from support.measured_files import fault_of, set_58, write_sets
from support.statement_files import COLUMNS, FREQUENCY, LINES, TEXTS, VALUES, Said, npy

pytestmark = [pytest.mark.usefixtures("unguarded"), pytest.mark.sweep]

G, POUND = 9.80665, 4.4482216152605
UNITS = {
    "g/N": ("accelerance", G),
    "m/s^2/N": ("accelerance", 1.0),
    "(mm/s²)/N": ("accelerance", 1e-3),
    "um/N": ("receptance", 1e-6),
    "mil/lbf": ("receptance", 2.54e-5 / POUND),
    "mm/s/N": ("mobility", 1e-3),
}
LINE_SPELLINGS = [
    "Unit: {}", "# unit: {}", "# units: {}", "% Einheit: {}", "Units = {}", "Y-Axis unit: {}", "unit,{}", "unit;{}",
    "# H unit : {}", "AmplitudeUnit:\t{}", "FRF [{}]", "FRF ({})", "# in [{}]", "{}",
]  # fmt: skip
NAMES = ["unit", "units", "H_unit", "y_unit", "Unit", "frf_unit", "amplitude_unit", "unit_of_H", "einheit", "info"]
QUANTITIES = {
    "receptance": "receptance",
    "compliance": "receptance",
    "mobility": "mobility",
    "inertance": "accelerance",
}
INVERSE = ["impedance", "mechanical impedance", "apparent mass", "dynamic mass", "dynamic stiffness"]


def written(tmp_path: Path, formats: dict, form: str, said: Said) -> Path:
    name, write = formats[form]
    return write(tmp_path / name, said)


def check(path: Path, unit: str, **arguments: object) -> None:
    quantity, factor = UNITS[unit]
    frf = read_frf(path, **arguments)
    assert frf.quantity == quantity
    np.testing.assert_allclose(frf.values, VALUES * factor, rtol=1e-9)


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("spelling", LINE_SPELLINGS)
@pytest.mark.parametrize("form", LINES)
def test_a_unit_in_a_line_is_used(tmp_path: Path, form: str, spelling: str, unit: str) -> None:
    path = written(tmp_path, LINES, form, Said(lines=(spelling.format(unit),)))
    check(path, unit)


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("form", TEXTS)
def test_a_unit_under_a_name_is_used(tmp_path: Path, form: str, name: str, unit: str) -> None:
    check(written(tmp_path, TEXTS, form, Said(texts={name: unit})), unit)


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("below", [False, True])
@pytest.mark.parametrize("form", COLUMNS)
def test_a_unit_of_a_column_is_used(tmp_path: Path, form: str, below: bool, unit: str) -> None:
    check(written(tmp_path, COLUMNS, form, Said(units=(unit, unit), below=below)), unit)


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("key", ["ordinate_axis_lab", "ordinate_axis_units_lab"])
@pytest.mark.parametrize("form", ["uff", "binary uff"])
def test_a_unit_in_a_label_of_a_universal_file_is_used(tmp_path: Path, form: str, key: str, unit: str) -> None:
    text = f"FRF ({unit})" if key.endswith("lab") and "units" not in key else unit
    check(written(tmp_path, LINES, form, Said(texts={key: text})), unit)


PAIRS = {
    ("g", "lbf"): ("accelerance", G / POUND),
    ("mm/s", "kN"): ("mobility", 1e-6),
    ("mil", "N"): ("receptance", 2.54e-5),
}


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("names", [("motion_unit", "force_unit"), ("response_unit", "excitation unit")])
@pytest.mark.parametrize("form", [*TEXTS, *LINES])
def test_the_units_of_motion_and_force_are_combined(
    tmp_path: Path, form: str, names: tuple[str, str], pair: tuple[str, str]
) -> None:
    given = dict(zip(names, pair, strict=True))
    if form in TEXTS:
        path = written(tmp_path, TEXTS, form, Said(texts=given))
    else:
        path = written(tmp_path, LINES, form, Said(lines=tuple(f"{key}: {text}" for key, text in given.items())))
    quantity, factor = PAIRS[pair]
    frf = read_frf(path)
    assert frf.quantity == quantity
    np.testing.assert_allclose(frf.values, VALUES * factor, rtol=1e-9)


@pytest.mark.parametrize("unit", ["smoots", "kg/N", "EU", "V/N", "N/m", "N*s/m", "kg", "1 ton/N", "%", "strain/N"])
@pytest.mark.parametrize("name", ["unit", "H_unit", "y_units"])
@pytest.mark.parametrize("form", [*TEXTS, *LINES])
def test_a_unit_that_is_not_understood_is_refused(tmp_path: Path, form: str, name: str, unit: str) -> None:
    if form in TEXTS:
        path = written(tmp_path, TEXTS, form, Said(texts={name: unit}))
    else:
        path = written(tmp_path, LINES, form, Said(lines=(f"{name}: {unit}",)))
    message = fault_of(path, quantity="receptance")
    assert unit in message
    assert path.name in message


@pytest.mark.parametrize("form", [*TEXTS, *LINES])
@pytest.mark.parametrize(("one", "other"), [("g/N", "m/s^2/N"), ("um/N", "mm/N"), ("g/N", "mm/s/N"), ("m/N", "rad/N")])
def test_two_units_that_contradict_each_other_are_refused(tmp_path: Path, form: str, one: str, other: str) -> None:
    if form in TEXTS:
        path = written(tmp_path, TEXTS, form, Said(texts={"unit": one, "H_unit": other}))
    else:
        path = written(tmp_path, LINES, form, Said(lines=(f"Unit: {one}", f"H unit: {other}")))
    assert "contradicts itself" in fault_of(path)


@pytest.mark.parametrize("form", COLUMNS)
def test_a_column_and_a_line_that_contradict_each_other_are_refused(tmp_path: Path, form: str) -> None:
    said = Said(units=("g/N", "g/N"), lines=("# Unit: um/N",), texts={"H_unit": "um/N"})
    if form == "cutpro":
        pytest.skip("no other place in this format")
    message = fault_of(written(tmp_path, COLUMNS, form, said))
    assert "g/N" in message or "contradicts itself" in message


@pytest.mark.parametrize("unit", ["kHz", "khz", "rad/s"])
@pytest.mark.parametrize("name", ["frequency_unit", "f_unit", "x_unit", "freq units", "xlabel"])
@pytest.mark.parametrize("form", [*TEXTS, *LINES])
def test_the_unit_of_the_frequency_is_used(tmp_path: Path, form: str, name: str, unit: str) -> None:
    text = f"Frequency [{unit}]" if name == "xlabel" else unit
    said = Said(texts={name: text, "unit": "g/N"}, lines=(f"{name}: {text}", "unit: g/N"))
    if form == "lvm":
        pytest.skip("the format has a field of its own for the unit of the abscissa")
    if form in TEXTS:
        path = written(tmp_path, TEXTS, form, said)
    else:
        path = written(tmp_path, LINES, form, said._replace(texts={}))
    factor = 1 / (2 * np.pi) if unit == "rad/s" else 1e3
    np.testing.assert_allclose(read_frf(path).frequency, FREQUENCY * factor, rtol=1e-6)


@pytest.mark.parametrize("unit", ["ms", "rpm", "orders", "km"])
@pytest.mark.parametrize("form", [*TEXTS, *LINES])
def test_a_frequency_in_another_unit_is_refused(tmp_path: Path, form: str, unit: str) -> None:
    said = Said(texts={"frequency_unit": unit}, lines=(f"frequency unit: {unit}",))
    path = (
        written(tmp_path, TEXTS, form, said)
        if form in TEXTS
        else written(tmp_path, LINES, form, said._replace(texts={}))
    )
    assert unit in fault_of(path, quantity="accelerance")


@pytest.mark.parametrize("word", QUANTITIES)
@pytest.mark.parametrize("key", ["quantity", "function", "type"])
@pytest.mark.parametrize("form", [*TEXTS, *LINES])
def test_the_word_of_a_quantity_is_used(tmp_path: Path, form: str, key: str, word: str) -> None:
    if key == "quantity" and word not in ("receptance", "mobility") and form not in LINES:
        pytest.skip("an entry called quantity has one of three words")
    said = Said(texts={key: word}, lines=(f"{key}: {word}",))
    path = (
        written(tmp_path, TEXTS, form, said)
        if form in TEXTS
        else written(tmp_path, LINES, form, said._replace(texts={}))
    )
    assert read_frf(path).quantity == QUANTITIES[word]
    other = "mobility" if QUANTITIES[word] != "mobility" else "accelerance"
    assert QUANTITIES[word] in fault_of(path, quantity=other)


@pytest.mark.parametrize("word", INVERSE)
@pytest.mark.parametrize("key", ["quantity", "function", "type", "H_name"])
@pytest.mark.parametrize("form", [*TEXTS, *LINES])
def test_the_word_of_an_inverse_is_refused(tmp_path: Path, form: str, key: str, word: str) -> None:
    if key == "H_name":
        pytest.skip("a name is running text")
    said = Said(texts={key: word}, lines=(f"{key}: {word}",))
    path = (
        written(tmp_path, TEXTS, form, said)
        if form in TEXTS
        else written(tmp_path, LINES, form, said._replace(texts={}))
    )
    assert word in fault_of(path, quantity="mobility")


COLUMN_WORDS = [
    "Impedance", "Mechanical Impedance", "Apparent mass", "Dynamic mass", "Dynamic stiffness", "Strain", "Microstrain",
    "Stress", "Pressure", "Sound pressure", "Voltage", "Transmissibility", "Inverse", "Scaled", "Conjugate",
    "Normalized",
]  # fmt: skip


@pytest.mark.parametrize("word", COLUMN_WORDS)
@pytest.mark.parametrize("pattern", ["{} {}", "{} ({})", "{1} {0}", "{0}_{1}"])
@pytest.mark.parametrize("form", ["csv", "tsv", "lvm", "npy"])
def test_a_column_of_another_quantity_is_refused(tmp_path: Path, form: str, pattern: str, word: str) -> None:
    names = tuple(pattern.format(word, part) for part in ("Real", "Imag"))
    said = Said(names=names)
    path = npy(tmp_path / "a.npy", said) if form == "npy" else written(tmp_path, COLUMNS, form, said)
    fault_of(path, quantity="mobility")


CHANGED = [
    ("Real", "-Imag"), ("Real", "- Imag"), ("Real", "(-Imag)"), ("Real", "minus Imag"), ("Real*1e6", "Imag*1e6"),
    ("Real x1000", "Imag x1000"), ("1/Real", "1/Imag"), ("Point 1 (Real)", "Point 2 (Imag)"), ("1z Real", "2z Imag"),
    ("Tool Real", "Holder Imag"), ("H1 Real (log)", "H1 Imag (log)"), ("Real, conj", "Imag, conj"),
]  # fmt: skip


@pytest.mark.parametrize("names", CHANGED)
@pytest.mark.parametrize("form", ["csv", "tsv", "lvm", "cutpro"])
def test_columns_that_are_not_the_two_parts_of_an_frf_are_refused(
    tmp_path: Path, form: str, names: tuple[str, str]
) -> None:
    quoted = tuple(f'"{name}"' for name in names) if form == "csv" else names
    path = written(tmp_path, COLUMNS, form, Said(names=quoted))
    fault_of(path, quantity="mobility")


SANE_LINES = [
    "Test of 2026-03-01, hammer 086C03", "Accelerometer 352C22, 10 mV/g, calibrated 2025-11-02", "Operator: A",
    "Overload: N", "Gain: 1", "Window: Hanning", "Sampling rate: 51200 Hz", "Averages: 10", "Torque: 60 Nm",
    "Date: 25.03.2026 10:15", "Spindle 7, tool 16 mm, overhang 60 mm", "Record length: 1 s", "H1(f) = Gxy/Gxx",
    "Title: mobility of the spindle", "Trigger delay: -10 ms", "Software version 3.14", "X-Axis delta: 1.5625",
    "Inverted: no", "Preload: 1.5 kN", "Humidity: 45.5 %", "Signal 1 / Signal 2", "Amplifier: no",
    "impedance head 288D01", "10 averages, 66.7 % overlap", "Temperature: 21.5 °C",
]  # fmt: skip


@pytest.mark.parametrize("line", SANE_LINES)
@pytest.mark.parametrize("form", LINES)
def test_a_line_about_the_test_does_not_stop_reading(tmp_path: Path, form: str, line: str) -> None:
    path = written(tmp_path, LINES, form, Said(lines=(line,)))
    np.testing.assert_allclose(read_frf(path, quantity="accelerance").values, VALUES, rtol=1e-9)


ACTING = [("gain", 10.0), ("delay", 5e-4), ("scale", 1e-3), ("sensitivity", 0.0102), ("calibration_factor", 1.02),
          ("window_correction", 1.5), ("K", 2.5), ("mV_per_g", 10.2), ("time_shift", 1e-3), ("attenuation_dB", 20.0),
          ("multiplier", 1000.0), ("Verstaerkung", 10.0), ("offset", 0.3)]  # fmt: skip


@pytest.mark.parametrize(("name", "value"), ACTING)
@pytest.mark.parametrize("form", TEXTS)
def test_a_number_that_may_act_on_the_values_is_refused_unless_skipped(
    tmp_path: Path, form: str, name: str, value: float
) -> None:
    if name in ("K", "mV_per_g") and (form.startswith("attribute") or form == "lvm"):
        pytest.skip("numbers of headers are settings unless their names or units say more")
    path = written(tmp_path, TEXTS, form, Said(texts={name: value}))
    message = fault_of(path, quantity="accelerance")
    assert name in message
    assert "'skip':" in message
    frf = read_frf(path, quantity="accelerance", names={"skip": name})
    np.testing.assert_allclose(frf.values, VALUES, rtol=1e-9)


ACTING_LINES = ["Gain: 10", "gain 20 dB", "# delay = 0.5 ms", "Latency: 0.2 ms", "Calibration factor: 0.98",
                "all values times 1000", "Kalibrierfaktor: 0,98", "Scale factor;9.81",
                "Window correction: 1.5", "K = 2.5", "Tau,0.0002", "preamp +20dB", "Polarity: -1", "phase inverted",
                "values in 1e-6 m/N", "1e6*m/N"]  # fmt: skip


@pytest.mark.parametrize("line", ACTING_LINES)
@pytest.mark.parametrize("form", LINES)
def test_a_number_in_a_line_that_may_act_on_the_values_is_refused(tmp_path: Path, form: str, line: str) -> None:
    message = fault_of(written(tmp_path, LINES, form, Said(lines=(line,))), quantity="accelerance")
    assert "the values" in message


SETTINGS = {"fs": 2048.0, "N": 4096.0, "df": 2.5, "nfft": 1024.0, "n_averages": 3.0, "overlap": 66.7,
            "date": "2026-03-01",
            "operator": "A", "sensor": "352C22", "temperature": 21.5, "mass_kg": 1.5, "gain": 1.0, "delay": 0.0,
            "serial": 12345.0, "window": "Hanning", "torque_Nm": 60.0, "node": 3.0, "direction": "z"}  # fmt: skip


@pytest.mark.parametrize("name", SETTINGS)
@pytest.mark.parametrize("form", TEXTS)
def test_a_setting_of_the_measurement_does_not_stop_reading(tmp_path: Path, form: str, name: str) -> None:
    path = written(tmp_path, TEXTS, form, Said(texts={name: SETTINGS[name]}))
    np.testing.assert_allclose(read_frf(path, quantity="accelerance").values, VALUES, rtol=1e-9)


@pytest.mark.parametrize("number", [8, 11, 12])
@pytest.mark.parametrize("word", ["Displacement", "Velocity", "Acceleration", "Accelerance", "Mobility", "Impedance"])
@pytest.mark.parametrize("unit", ["NONE", "m", "m/s", "m/s^2"])
def test_type_label_and_unit_of_a_universal_file_agree_or_are_refused(
    tmp_path: Path, number: int, word: str, unit: str
) -> None:
    words = {"displacement": 8, "velocity": 11, "acceleration": 12, "accelerance": 12, "mobility": 11}
    units = {"NONE": number, "m": 8, "m/s": 11, "m/s^2": 12}
    fields = {"ordinate_spec_data_type": number, "ordinate_axis_lab": word, "ordinate_axis_units_lab": unit}
    path = write_sets(tmp_path / "a.uff", set_58(FREQUENCY, VALUES, **fields))
    if words.get(word.lower()) == number == units[unit]:
        np.testing.assert_allclose(read_frf(path).values, VALUES, rtol=1e-9)
    else:
        fault_of(path)


@pytest.mark.parametrize(("given", "unit"), [("response_unit", "g"), ("force_unit", "lbf"), ("motion unit", "um")])
@pytest.mark.parametrize("form", [*TEXTS, "csv", "tsv"])
def test_half_a_unit_has_to_be_completed_by_the_caller(tmp_path: Path, form: str, given: str, unit: str) -> None:
    said = Said(texts={given: unit}, lines=(f"{given}: {unit}",))
    path = written(tmp_path, TEXTS if form in TEXTS else LINES, form, said)
    quantity, whole = ("receptance", "um/lbf") if unit == "um" else ("accelerance", "g/lbf")
    assert "does not give the unit of the" in fault_of(path, quantity=quantity)
    factor = (1e-6 if unit == "um" else G) / POUND
    np.testing.assert_allclose(read_frf(path, unit=whole).values, VALUES * factor, rtol=1e-9)
    assert "contradicts itself" in fault_of(path, unit="mm/kN" if unit == "um" else "m/s^2/kN")
