"""What a file states twice and differently, or where no reader looked: used, contradicted or refused with its place."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from dovetail.errors import MeasurementError
from dovetail.measurement import read_frf
from dovetail.measurement.impact_test.signal_files import read_signals
from dovetail.measurement.modal_parameters import read_modal_parameters
from support.measured_files import fault_of, set_58, write_sets
from support.statement_files import FREQUENCY, LINES, TEXTS, VALUES, Said

pytestmark = [pytest.mark.usefixtures("unguarded"), pytest.mark.sweep]

AMPLITUDE, DEGREES = np.abs(VALUES), np.degrees(np.angle(VALUES))


def written(tmp_path: Path, form: str, said: Said) -> Path:
    name, write = (LINES | TEXTS)[form]
    return write(tmp_path / name, said)


def with_statement(tmp_path: Path, form: str, name: str, text: str) -> Path:
    said = Said(lines=(f"{name}: {text}" if name else text,)) if form in LINES else Said(texts={name or "info": text})
    return written(tmp_path, form, said)


CHANGED = [
    ("time convention", "exp(-iwt)"), ("convention", "e^{-j omega t}"), ("", "time dependence exp(-1i*w*t)"),
    ("", "values doubled"), ("", "made twice as large"), ("", "divide by 2 to get accelerance"),
    ("", "multiply by 0.001"), ("", "factor two included"), ("", "half amplitude"), ("", "reciprocal of the FRF"),
    ("", "inverse"), ("", "imaginary part negative"), ("", "H = conj(X/F)"), ("", "normalized to static stiffness"),
    ("", "scaled by mass"), ("", "phase lag positive"), ("", "phase shifted by 180 degrees"), ("", "magnitude squared"),
    ("type", "PSD"), ("", "impulse response"), ("", "channels swapped"), ("", "cross spectrum"),
    ("", "normalized frequency"), ("", "values: |H|^2"),
    ("", "values are complex conjugates"), ("", "data multiplied by two"), ("", "Werte skaliert"),
]  # fmt: skip
UPSIDE_DOWN = [
    ("output", "force"), ("input", "acceleration"), ("numerator", "Force"), ("denominator", "displacement"),
    ("excitation", "velocity"), ("reference quantity", "acceleration"), ("", "H = force / acceleration"),
    ("", "FRF = F/X"), ("", "Force per displacement"), ("title", "apparent mass"), ("description", "dynamic stiffness"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "text"), [*CHANGED, *UPSIDE_DOWN])
@pytest.mark.parametrize("form", [*LINES, *TEXTS])
def test_values_that_were_changed_according_to_the_file_are_refused(
    tmp_path: Path, form: str, name: str, text: str
) -> None:
    path = with_statement(tmp_path, form, name, text)
    assert path.name in fault_of(path, quantity="accelerance")
    np.testing.assert_allclose(read_frf(path, quantity="accelerance", names={"skip": text}).values, VALUES, rtol=1e-9)


SOUND = [
    ("scale", "linear"), ("y axis", "dB"), ("x axis", "log"), ("data type", "double"), ("pulse", "half sine"),
    ("", "half-power bandwidth evaluated later"), ("log file", "run.log"), ("force", "hammer 086C03"),
    ("response", "accelerometer 352C22"), ("estimator", "H1"), ("estimator", "Hv"), ("normalized", "no"),
    ("", "impulse hammer with steel tip"), ("", "Reciprocity was checked on two points"), ("scaling", "none"),
    ("convention", "exp(+iwt)"), ("", "calibrated by A. Smith"), ("reference", "channel 1"), ("", "not inverted"),
    ("description", "holder of high dynamic stiffness"), ("peak", "rms"), ("", "Acceleration/Force"),
    ("", "all frequencies in Hz"), ("", "accelerometer mass removed"), ("spectrum", "two-sided"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "text"), SOUND)
@pytest.mark.parametrize("form", [*LINES, *TEXTS])
def test_remarks_that_do_not_change_the_values_are_accepted(tmp_path: Path, form: str, name: str, text: str) -> None:
    path = with_statement(tmp_path, form, name, text)
    np.testing.assert_allclose(read_frf(path, quantity="accelerance").values, VALUES, rtol=1e-9)


@pytest.mark.parametrize("form", [*LINES, *TEXTS])
def test_an_excitation_by_a_moment_is_one(tmp_path: Path, form: str) -> None:
    path = with_statement(tmp_path, form, "excitation", "moment")
    if form == "uff" or form == "binary uff":
        fault_of(path, quantity="accelerance")  # its label says force
    else:
        assert read_frf(path, quantity="accelerance").moment


SENTENCES = ["values in {}", "Values are in {}.", "FRF in {}", "amplitudes given in [{}]", "all data stored in {}"]


@pytest.mark.parametrize("sentence", SENTENCES)
@pytest.mark.parametrize("form", [*LINES, *TEXTS])
def test_a_unit_in_a_sentence_counts_against_one_elsewhere(tmp_path: Path, form: str, sentence: str) -> None:
    def said(unit: str) -> Path:
        text = sentence.format(unit)
        lines = ("Unit: g/N", text)
        texts: dict[str, str | float] = {"unit": "g/N", "info": text}
        return written(tmp_path, form, Said(lines=lines) if form in LINES else Said(texts=texts))

    assert "contradicts itself" in fault_of(said("m/s^2/N"))
    np.testing.assert_allclose(read_frf(said("g/N")).values, 9.80665 * VALUES, rtol=1e-9)


@pytest.mark.parametrize("text", ['{"unit": "g/N"}', '{"H": {"unit": "g/N"}, "date": "2026-03-01"}'])
@pytest.mark.parametrize("form", ["npz", "mat 5", "hdf5", "attribute", "attribute of the file", "csv", "uff"])
def test_statements_in_json_are_used(tmp_path: Path, form: str, text: str) -> None:
    path = with_statement(tmp_path, form, "" if form in LINES else "metadata", text)
    np.testing.assert_allclose(read_frf(path).values, 9.80665 * VALUES, rtol=1e-9)
    path = with_statement(tmp_path, form, "" if form in LINES else "metadata", text[:-1] + ', "gain": 10}')
    assert "gain" in fault_of(path)


FLAGS = ["conjugated", "inverted", "sign_flipped", "swapped", "reciprocal", "is_squared", "isInverse", "in_rad_per_s"]


@pytest.mark.parametrize("flag", FLAGS)
@pytest.mark.parametrize("suffix", [".npz", ".mat", ".h5", "attribute"])
def test_a_flag_that_changes_the_values_is_refused_if_it_is_set(tmp_path: Path, suffix: str, flag: str) -> None:
    def saved(is_set: bool) -> Path:
        entries = {"frequency": FREQUENCY, "H": VALUES, flag: is_set}
        path = tmp_path / f"a{suffix if suffix != 'attribute' else '.h5'}"
        if suffix == ".npz":
            np.savez(path, **entries)
        elif suffix == ".mat":
            savemat(path, entries)
        else:
            with h5py.File(path, "w") as file:
                for name in ("frequency", "H") if suffix == "attribute" else entries:
                    file[name] = entries[name]
                if suffix == "attribute":
                    file["H"].attrs[flag] = is_set
        return path

    if suffix in (".mat", "attribute") and flag == "in_rad_per_s":
        pytest.skip("a number there, or the attribute of the values")
    fault_of(saved(True), quantity="accelerance")
    np.testing.assert_allclose(read_frf(saved(False), quantity="accelerance").values, VALUES, rtol=1e-9)


ARRAYS_OF_TEXTS = [["unit", "g/N"], [["operator", "A"], ["unit", "g/N"]], ["date: 2026-03-01", "unit: g/N"],
                   ["unit: g/N", "a", "b"]]  # fmt: skip


@pytest.mark.parametrize("texts", ARRAYS_OF_TEXTS)
def test_every_text_of_an_array_is_read(tmp_path: Path, texts: Any) -> None:
    np.savez(tmp_path / "a.npz", frequency=FREQUENCY, H=VALUES, info=np.array(texts))
    np.testing.assert_allclose(read_frf(tmp_path / "a.npz").values, 9.80665 * VALUES, rtol=1e-9)


@pytest.mark.parametrize("name", ["channel_units", "y_units", "axis_units"])
@pytest.mark.parametrize("units", [("g", "N"), ("N", "g"), ("Hz", "g/N")])
def test_units_in_an_array_are_combined(tmp_path: Path, units: tuple[str, str], name: str) -> None:
    np.savez(tmp_path / "a.npz", frequency=FREQUENCY, H=VALUES, **{name: np.array(units)})
    np.testing.assert_allclose(read_frf(tmp_path / "a.npz").values, 9.80665 * VALUES, rtol=1e-9)


def amplitude_file(tmp_path: Path, form: str, columns: dict[str, np.ndarray], name: str, text: str) -> Path:
    if form == "csv":
        rows = [",".join(f"{x:.17g}" for x in row) for row in zip(FREQUENCY, *columns.values(), strict=True)]
        lines = [f"# {name}: {text}" if name else f"# {text}", ",".join(["frequency_Hz", *columns]), *rows]
        (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
        return tmp_path / "a.csv"
    texts = {name or "info": text}
    if form == "npz":
        np.savez(tmp_path / "a.npz", frequency=FREQUENCY, **columns, **texts)
        return tmp_path / "a.npz"
    if form == "mat":
        savemat(tmp_path / "a.mat", {"frequency": FREQUENCY, **columns, **texts})
        return tmp_path / "a.mat"
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["frequency"] = FREQUENCY
        for key, column in columns.items():
            file[key] = column
        file.attrs[name or "info"] = text
    return tmp_path / "a.h5"


PHASES = [("phase unit", "{}"), ("phase", "{}"), ("angle_unit", "{}"), ("", "phase in {}"),
          ("", "phases are given in {}"), ("Phase", "[{}]")]  # fmt: skip


@pytest.mark.parametrize(("name", "text"), PHASES)
@pytest.mark.parametrize(("right", "wrong"), [("deg", "rad"), ("rad", "degrees"), ("deg", "radians")])
@pytest.mark.parametrize("form", ["csv", "npz", "mat", "attribute"])
def test_the_unit_of_the_phase_is_compared_with_the_name_of_its_numbers(
    tmp_path: Path, form: str, right: str, wrong: str, name: str, text: str
) -> None:
    angle = DEGREES if right == "deg" else np.radians(DEGREES)
    columns = {"amplitude": AMPLITUDE, f"phase_{right}": angle}
    key = name.replace(" ", "_") if form == "mat" else name
    path = amplitude_file(tmp_path, form, columns, key, text.format(wrong))
    assert f"the phase is read in {right}" in fault_of(path, quantity="mobility")
    path = amplitude_file(tmp_path, form, columns, key, text.format(right))
    np.testing.assert_allclose(read_frf(path, quantity="mobility").values, VALUES, rtol=1e-9)


SCALES = [("scale", "dB"), ("amplitude_scale", "dB"), ("y_scale", "log10"), ("magnitude", "log10"), ("", "dB"),
          ("", "amplitude in dB"), ("", "values in decibels"), ("amplitude", "natural logarithm"),
          ("", "power spectrum")]  # fmt: skip


@pytest.mark.parametrize(("name", "text"), SCALES)
@pytest.mark.parametrize("form", ["csv", "npz", "mat", "attribute"])
def test_an_amplitude_on_another_scale_is_refused(tmp_path: Path, form: str, name: str, text: str) -> None:
    if form in ("npz", "mat") and name in ("amplitude", "magnitude"):
        pytest.skip("the name of the numbers")
    path = amplitude_file(tmp_path, form, {"amplitude": AMPLITUDE, "phase_deg": DEGREES}, name, text)
    assert "scale" in fault_of(path, quantity="mobility")


REFERENCES = [("", "dB re 1e-6"), ("dB reference", "1e-6"), ("", "dB = 10 log10"), ("reference_dB", "1e-6 m/s/N")]


@pytest.mark.parametrize(("name", "text"), REFERENCES)
@pytest.mark.parametrize("form", ["csv", "npz", "mat", "attribute"])
def test_decibels_over_another_reference_are_refused(tmp_path: Path, form: str, name: str, text: str) -> None:
    key = name.replace(" ", "_") if form == "mat" else name
    columns = {"amplitude_db": 20 * np.log10(AMPLITUDE), "phase_deg": DEGREES}
    fault_of(amplitude_file(tmp_path, form, columns, key, text), quantity="mobility")
    sound = amplitude_file(tmp_path, form, columns, key, "dB re 1" if "re" in text + name else "dB = 20 log10")
    np.testing.assert_allclose(read_frf(sound, quantity="mobility").values, VALUES, rtol=1e-9)


@pytest.mark.parametrize("name", ["coherence [%]", "sqrt coherence", "1-coherence", "variance [dB]", "variance [g/N]"])
def test_a_coherence_or_a_variance_in_another_unit_is_refused(tmp_path: Path, name: str) -> None:
    rows = [f"{f},{v.real},{v.imag},0.5" for f, v in zip(FREQUENCY, VALUES, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join([f"frequency_Hz,real [m/s^2/N],imag [m/s^2/N],{name}", *rows]) + "\n")
    fault_of(tmp_path / "a.csv")


@pytest.mark.parametrize("unit", ["(m/s^2/N)^2", "[m/s^2/N]²", "m/s^2/N**2", "1"])
def test_a_variance_in_the_square_of_the_unit_is_read(tmp_path: Path, unit: str) -> None:
    rows = [f"{f},{v.real},{v.imag},0.5" for f, v in zip(FREQUENCY, VALUES, strict=True)]
    header = f"frequency_Hz,real [m/s^2/N],imag [m/s^2/N],variance [{unit}]"
    (tmp_path / "a.csv").write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    np.testing.assert_allclose(read_frf(tmp_path / "a.csv").variance, 0.5)


AXES = ["frequency_Hz", "f_Hz", "Frequency [Hz]"]
OTHER_AXES = ["Frequency unit: kHz", "frequency in rad/s", "x axis: angular frequency", "abscissa: omega",
              "freq: kHz", "frequencies are given in kilohertz", "X-Axis unit: rad/s", "x axis: rpm",
              "frequency: orders"]  # fmt: skip


@pytest.mark.parametrize("line", OTHER_AXES)
@pytest.mark.parametrize("header", AXES)
@pytest.mark.parametrize("below", [False, True])
def test_a_frequency_in_hertz_by_its_name_and_in_another_unit_elsewhere_is_refused(
    tmp_path: Path, below: bool, header: str, line: str
) -> None:
    rows = [f"{f},{v.real},{v.imag}" for f, v in zip(FREQUENCY, VALUES, strict=True)]
    unit = "kHz" if "k" in line else "rad/s"
    lines = [f"{header},real,imag", f"{unit},m/s^2/N,m/s^2/N"] if below else [f"# {line}", f"{header},real,imag"]
    (tmp_path / "a.csv").write_text("\n".join([*lines, *rows]) + "\n")
    fault_of(tmp_path / "a.csv", quantity="accelerance")


OTHERS = [({"omega": FREQUENCY}, True), ({"omega": 2 * np.pi * FREQUENCY}, False), ({"f_kHz": FREQUENCY / 1e3}, False),
          ({"f_kHz": FREQUENCY}, True), ({"df": 5.0}, True), ({"df": 2.5}, False), ({"frequency_step": 0.1}, True),
          ({"freq_resolution": 2.5}, False), ({"omega_rad_s": 6.2832 * FREQUENCY}, False)]  # fmt: skip


@pytest.mark.parametrize(("entries", "is_wrong"), OTHERS)
@pytest.mark.parametrize("suffix", [".npz", ".mat"])
def test_frequencies_given_twice_have_to_agree(
    tmp_path: Path, suffix: str, entries: dict[str, Any], is_wrong: bool
) -> None:
    path, content = tmp_path / f"a{suffix}", {"frequency": FREQUENCY, "H": VALUES, **entries}
    (np.savez(path, **content) if suffix == ".npz" else savemat(path, content))
    if is_wrong:
        assert next(iter(entries)) in fault_of(path, quantity="accelerance")
    else:
        np.testing.assert_allclose(read_frf(path, quantity="accelerance").values, VALUES, rtol=1e-9)


@pytest.mark.parametrize(("end", "is_wrong"), [(37.5, False), (40.0, False), (80.0, True), (0.0375, True)])
def test_start_step_and_end_have_to_agree(tmp_path: Path, end: float, is_wrong: bool) -> None:
    savemat(tmp_path / "a.mat", {"H": VALUES, "f_start": 10.0, "df": 2.5, "f_end": end})
    if is_wrong:
        assert "f_end" in fault_of(tmp_path / "a.mat", quantity="accelerance")
    else:
        np.testing.assert_allclose(read_frf(tmp_path / "a.mat", quantity="accelerance").frequency, FREQUENCY)


LABELS = {
    "abscissa_axis_lab": ["Time", "Order", "RPM", "Time [s]", "Rotation angle"],
    "orddenom_axis_lab": ["Acceleration", "Displacement", "Velocity (m/s)"],
    "ordinate_axis_lab": ["Force/Acceleration", "F/A", "Conj FRF", "Log Mag", "N/m", "Impedance [N s/m]"],
}


@pytest.mark.parametrize(("field", "label"), [(field, label) for field in LABELS for label in LABELS[field]])
@pytest.mark.parametrize("binary", [0, 1])
def test_a_label_of_a_universal_file_that_contradicts_its_types_is_refused(
    tmp_path: Path, binary: int, field: str, label: str
) -> None:
    path = write_sets(tmp_path / "a.uff", set_58(FREQUENCY, VALUES, binary=binary, **{field: label}))
    fault_of(path)


@pytest.mark.parametrize("label", ["Phase", "Mag (dB)", "Real part", "Acceleration/Force phase", "log mag"])
def test_real_values_of_a_universal_file_that_are_no_amplitudes_are_refused(tmp_path: Path, label: str) -> None:
    path = write_sets(tmp_path / "a.uff", set_58(FREQUENCY, AMPLITUDE, ordinate_axis_lab=label))
    fault_of(path)


@pytest.mark.parametrize("unit", ["g/N", "m/s^2/N", "mm/s^2/N"])
def test_a_unit_in_front_of_the_name_of_a_column_is_used(tmp_path: Path, unit: str) -> None:
    factor = {"g/N": 9.80665, "mm/s^2/N": 1e-3}.get(unit, 1.0)
    rows = [f"{f},{v.real:.17g},{v.imag:.17g}" for f, v in zip(FREQUENCY, VALUES, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join([f"frequency_Hz,{unit} real,{unit} imag", *rows]) + "\n")
    np.testing.assert_allclose(read_frf(tmp_path / "a.csv").values, factor * VALUES, rtol=1e-9)


@pytest.mark.parametrize("names", ["H1 real,H2 imag", "N/m real,N/m imag", "F/A (Real),F/A (Imag)"])
def test_columns_of_two_estimators_or_of_an_inverse_are_refused(tmp_path: Path, names: str) -> None:
    rows = [f"{f},{v.real},{v.imag}" for f, v in zip(FREQUENCY, VALUES, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join([f"frequency_Hz,{names}", *rows]) + "\n")
    fault_of(tmp_path / "a.csv", quantity="accelerance")


FRD = [{"FrequencyUnit": "Hz", "Units": "rad/s"}, {"OutputName": "force", "InputName": "acceleration"},
       {"OutputName": "Velocity"}, {"InputName": "Displacement"}, {"Name": "dynamic stiffness"}, {"UserData": "conj"},
       {"Notes": "values doubled"}]  # fmt: skip


@pytest.mark.parametrize("wrong", FRD)
def test_entries_of_frequency_response_data_that_contradict_each_other_are_refused(
    tmp_path: Path, wrong: dict[str, str]
) -> None:
    names = {"InputUnit": "N", "OutputUnit": "m/s^2", "InputName": "hammer", "OutputName": "tip"}
    data = {"ResponseData": VALUES.reshape(1, 1, -1), "Frequency": FREQUENCY, "FrequencyUnit": "Hz", **names}
    savemat(tmp_path / "sound.mat", {"sys": data})
    np.testing.assert_allclose(read_frf(tmp_path / "sound.mat").values, VALUES, rtol=1e-9)
    savemat(tmp_path / "a.mat", {"sys": {**data, **wrong}})
    fault_of(tmp_path / "a.mat")


@pytest.mark.parametrize("entry", [{"response": "velocity"}, {"force": "acceleration"}, {"response": "force"}])
@pytest.mark.parametrize("form", ["csv", "npz"])
def test_an_entry_for_a_point_that_names_a_quantity_is_compared_with_the_others(
    tmp_path: Path, form: str, entry: dict[str, str]
) -> None:
    ((name, text),) = entry.items()
    fault_of(with_statement(tmp_path, form, name, text), quantity="accelerance")


MODAL_LINES = [
    "frequency unit: kHz", "frequencies in kHz", "f in rad/s", "angular frequencies", "Frequency unit,kHz", "unit: kHz",
    "units: rad/s, -", "damping: loss factor", "damping is the loss factor eta",
    "damping in %", "damping unit: %", "damping: percent of critical", "logarithmic decrement",
    "damping = half-power bandwidth in Hz", "scale factor 2", "frequencies divided by 2", "frequency correction: 1.01",
    "sd: 2 sigma", "standard deviations of 95 % intervals", "values doubled",
]  # fmt: skip
MODAL_SOUND = [
    "undamped natural frequencies", "damped natural frequencies",
    "operator: A", "test of 2026-03-01 at 51200 Hz", "FRF in g/N", "frequencies in Hz",
    "temperature 21.5 °C", "frequency unit: Hz", "damping: -", "Polyreference, model order 40", "sd: 1 sigma",
]  # fmt: skip


def modal_table(path: Path, header: str, line: str, where: str) -> Path:
    rows = ["100,0.01,0.1", "250,0.02,0.2"]
    lines = [f"# {line}", header, *rows] if where == "above" else [header, *rows, f"# {line}"]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("line", MODAL_LINES)
@pytest.mark.parametrize("where", ["above", "below"])
def test_a_line_that_contradicts_a_table_of_natural_frequencies_is_refused(
    tmp_path: Path, where: str, line: str
) -> None:
    path = modal_table(tmp_path / "a.csv", "frequency_Hz,damping_ratio,frequency_sd_Hz", line, where)
    with pytest.raises(MeasurementError, match=r"a\.csv:[14]"):
        read_modal_parameters(path)


@pytest.mark.parametrize("line", MODAL_SOUND)
@pytest.mark.parametrize("where", ["above", "below"])
def test_other_lines_around_a_table_of_natural_frequencies_are_accepted(tmp_path: Path, where: str, line: str) -> None:
    path = modal_table(tmp_path / "a.csv", "frequency_Hz,damping_ratio,frequency_sd_Hz", line, where)
    np.testing.assert_array_equal(read_modal_parameters(path).frequency, [100, 250])


def test_damped_frequencies_of_strongly_damped_modes_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("# damped natural frequencies\nfrequency_Hz,damping_ratio\n100,0.01\n250,0.2\n")
    with pytest.raises(MeasurementError, match=r"divide damped ones by sqrt"):
        read_modal_parameters(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("header", "below"),
    [("frequency_Hz,damping_ratio", "kHz,-"), ("Frequency [Hz],damping_ratio", "rad/s,-"), ("f_Hz [kHz],zeta", ""),
     ("frequency_Hz,damping_percent", "Hz,-"), ("frequency_Hz,damping_ratio", "Hz,%"),
     ("frequency_Hz,Damping [-]", "Hz,%")],
)  # fmt: skip
def test_units_in_name_and_row_of_a_table_of_natural_frequencies_have_to_agree(
    tmp_path: Path, header: str, below: str
) -> None:
    (tmp_path / "a.csv").write_text("\n".join([header, *([below] if below else []), "100,0.1", "200,0.2"]) + "\n")
    with pytest.raises(MeasurementError, match="has the units"):
        read_modal_parameters(tmp_path / "a.csv")


TIME = np.arange(256) / 2048.0
PULSE, RING = np.where(TIME < 0.003, 100 * np.sin(np.pi * TIME / 0.003), 0.0), np.exp(-20 * TIME) * np.sin(600 * TIME)
SIGNAL_LINES = [
    "force in lbf", "response in g", "response is a velocity", "response is velocity in mm/s", "time in ms",
    "values doubled", "made twice as large", "multiply by 0.001", "divide force by 2", "channels swapped",
    "response scaled", "normalized to 1", "response in counts",
]  # fmt: skip


@pytest.mark.parametrize("line", SIGNAL_LINES)
@pytest.mark.parametrize("form", ["csv", "npz"])
def test_a_sentence_that_contradicts_time_records_is_refused(tmp_path: Path, form: str, line: str) -> None:
    if form == "csv":
        rows = [f"{t:.9g},{f:.9g},{a:.9g}" for t, f, a in zip(TIME, PULSE, RING, strict=True)]
        path = tmp_path / "a.csv"
        path.write_text("\n".join([f"# {line}", "time_s,force_N,response_m/s^2", *rows]) + "\n")
    else:
        path = tmp_path / "a.npz"
        units = {"force_unit": "N", "response_unit": "m/s^2", "time_unit": "s"}
        np.savez(path, force=PULSE, response=RING, time=TIME, note=line, **units)
    with pytest.raises(MeasurementError):
        read_signals(path)


ENTRIES: list[dict[str, Any]] = [
    {"inverted": True}, {"force_inverted": True}, {"force_sign": -1.0}, {"swapped": True},
    {"response_delay": "3 samples"},
    {"response_kind": "velocity"}, {"meta": '{"response_unit": "g"}'}, {"info": ["force unit: lbf", "x"]},
    {"response_gain": 10.0},
]  # fmt: skip


@pytest.mark.parametrize("entry", ENTRIES)
def test_an_entry_next_to_time_records_that_contradicts_them_is_refused(tmp_path: Path, entry: dict[str, Any]) -> None:
    known = {"force": PULSE, "response": RING, "rate": 2048.0, "force_unit": "N", "response_unit": "m/s^2"}
    np.savez(tmp_path / "sound.npz", **known)
    assert read_signals(tmp_path / "sound.npz").quantity == "accelerance"
    np.savez(tmp_path / "a.npz", **known, **entry)
    with pytest.raises(MeasurementError):
        read_signals(tmp_path / "a.npz")


def test_a_time_in_one_unit_by_its_name_and_another_in_the_row_below_is_refused(tmp_path: Path) -> None:
    rows = [f"{t:.9g},{f:.9g},{a:.9g}" for t, f, a in zip(TIME, PULSE, RING, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join(["time_s,force_N,response_m/s^2", "ms,N,m/s^2", *rows]) + "\n")
    with pytest.raises(MeasurementError, match="'ms'"):
        read_signals(tmp_path / "a.csv")
