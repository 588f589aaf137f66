"""Points, directions, starts and segments of time records: one FRF, right, or a refusal that lists the choice."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from dovetail.errors import MeasurementError
from dovetail.measurement.impact_test.signal_files import read_signals
from support.signal_writers import FORCE, LVM, RATE, RESPONSE, SAMPLES, Labels, uff_set

SI = Labels("N", "m/s^2")


def impact(path, *, force=(1, 3), response=(1, 3), reference=(0, 0), sizes=(1.0, 1.0), labels=SI, kind=12, **other):
    """Write a force and a motion with their nodes and directions."""
    point = {"rsp_node": force[0], "rsp_dir": force[1]}
    uff_set(path, 13, "Force", labels.force, sizes[0] * FORCE, labels, **point)
    motion(path, response, reference, sizes[1], labels, kind, **other)


def motion(path, response, reference=(0, 0), size=1.0, labels=SI, kind=12, **other):
    point = {"rsp_node": response[0], "rsp_dir": response[1], "ref_node": reference[0], "ref_dir": reference[1]}
    uff_set(path, kind, "NONE", labels.response, size * RESPONSE, labels, **point | other)


@pytest.fixture
def file(tmp_path):
    return tmp_path / "hits.uff"


def test_a_roving_hammer_is_refused_with_a_choice_of_nodes(file):
    for node in (1, 2, 3):
        impact(file, force=(node, 3), sizes=(1.0, node))
    with pytest.raises(MeasurementError) as refusal:
        read_signals(file)
    text = str(refusal.value)
    assert "impacts at 3 pairs of points; choose one pair" in text
    assert "response 1+z, force 2+z: 1 impacts" in text
    assert "`response='1+z'` `force='1+z'`" in text
    for node, wanted in ((1, "1"), (2, "2+z"), (3, "3z")):
        signals = read_signals(file, force=wanted)
        np.testing.assert_allclose(signals.response, [node * RESPONSE], rtol=1e-5, atol=1e-9)
        assert (signals.response_point, signals.force_point) == ("1+z", f"{node}+z")
    with pytest.raises(MeasurementError, match=r"no impact at these points[^$]*force 3\+z"):
        read_signals(file, force="4")


def test_a_roving_accelerometer_is_refused_with_a_choice_of_nodes(file):
    for node in (1, 2, 3):
        impact(file, response=(node, 3), sizes=(1.0, node))
    with pytest.raises(MeasurementError, match=r"response 3\+z, force 1\+z: 1 impacts"):
        read_signals(file)
    np.testing.assert_allclose(read_signals(file, response="2").response, [2 * RESPONSE], rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("order", ["by impact", "forces first", "by channel"])
def test_a_triaxial_accelerometer_is_refused_with_a_choice_of_directions(file, order):
    channels = [(number, axis) for number in (1, 2) for axis in (0, 1, 2, 3)]
    if order == "forces first":
        channels.sort(key=lambda channel: channel[1] > 0)
    elif order == "by channel":
        channels.sort(key=lambda channel: channel[1])
    for number, axis in channels:
        if axis:
            motion(file, (5, axis), size=10.0 * number + axis)
        else:
            uff_set(file, 13, "Force", "N", number * FORCE, SI, rsp_node=5, rsp_dir=3)
    with pytest.raises(MeasurementError, match=r"response 5\+y, force 5\+z: 2 impacts"):
        read_signals(file)
    signals = read_signals(file, response="5+y")
    np.testing.assert_allclose(signals.force, [FORCE, 2 * FORCE], rtol=1e-5)
    np.testing.assert_allclose(signals.response, [12 * RESPONSE, 22 * RESPONSE], rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("force", [3, -3])
@pytest.mark.parametrize("response", [3, -3])
def test_records_along_negative_axes_have_their_sign_changed(file, force, response):
    impact(file, force=(1, force), response=(2, response), sizes=(np.sign(force), np.sign(response)))
    signals = read_signals(file)
    np.testing.assert_allclose(signals.force, [FORCE], rtol=1e-5)
    np.testing.assert_allclose(signals.response, [RESPONSE], rtol=1e-5, atol=1e-9)
    assert bool(signals.warnings) == (force < 0)


def test_impacts_from_both_sides_of_a_point_belong_together(file):
    impact(file, force=(1, 3))
    impact(file, force=(1, -3), sizes=(1.0, -1.0))
    signals = read_signals(file)
    np.testing.assert_allclose(signals.force, [FORCE, -FORCE], rtol=1e-5)
    np.testing.assert_allclose(signals.response, [RESPONSE, -RESPONSE], rtol=1e-5, atol=1e-9)
    assert signals.warnings == ()


def test_a_response_that_refers_to_another_force_is_refused(file):
    impact(file, force=(1, 3), response=(5, 3), reference=(2, 3))
    with pytest.raises(MeasurementError, match=r"the force is at 1\+z, and the response refers to 2\+z"):
        read_signals(file)


def test_a_force_with_the_points_of_the_pair_acts_at_the_reference(file):
    uff_set(file, 13, "Force", "N", FORCE, SI, rsp_node=5, ref_node=2, ref_dir=3)
    motion(file, (5, 3), (2, 3))
    signals = read_signals(file)
    assert (signals.response_point, signals.force_point) == ("5+z", "2+z")


@pytest.mark.parametrize("count", [1, 3])
def test_another_number_of_forces_than_of_motions_is_refused(file, count):
    impact(file)
    for _ in range(count):
        uff_set(file, 13, "Force", "N", FORCE, SI)
    with pytest.raises(MeasurementError, match=f"{1 + count} time records of a force and 1 of a motion"):
        read_signals(file)


FAULTS = {
    "strain": ({"kind": 3}, "the data are of type 3"),
    "pressure": ({"kind": 15}, "the data are of type 15"),
    "reaction force": ({"kind": 9}, "the data are of type 9"),
    "unknown without a label": ({"kind": 0, "labels": Labels("N", "")}, "does not say whether the response is an"),
    "general with a strain": ({"kind": 1, "ordinate_axis_lab": "Strain", "labels": Labels("N", "")}, "'strain' is not"),
    "rotation": ({"response": (1, 6)}, "rotation or a moment"),
    "rotational unit": ({"labels": Labels("N", "rad/s^2")}, "rotation"),
    "impulse response": ({"orddenom_spec_data_type": 13}, "has a denominator"),
    "unit of the denominator": ({"orddenom_axis_units_lab": "N"}, "has a denominator"),
    "label against type": ({"ordinate_axis_lab": "Velocity"}, "contradicts itself"),
    "unit of an FRF": ({"labels": Labels("N", "g/N")}, "is not the response"),
    "frequency axis": ({"abscissa_spec_data_type": 18}, "the abscissa is of type 18"),
    "axis label against unit": ({"abscissa_axis_lab": "Time (ms)", "abscissa_axis_units_lab": "s"}, "sampling rate"),
    "samples": ({"abscissa_axis_units_lab": "m"}, "the time is in 'm'"),
    "another step": ({"x": np.arange(SAMPLES) / 1000.0}, "the sampling rate is 1000"),
    "another start": ({"x": 0.01 + np.arange(SAMPLES) / RATE}, "the response starts at 0.01 s, and the force at 0 s"),
    "uneven": ({"x": np.arange(SAMPLES) ** 1.5 / RATE}, "does not increase in even steps"),
    "complex": ({"data": RESPONSE * 1j}, "a time record is complex"),
    "shorter": ({"data": RESPONSE[:32], "x": np.arange(32) / RATE}, "the records have different lengths"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faulty_universal_records_are_refused(file, fault):
    options, message = FAULTS[fault]
    impact(file, **options)
    with pytest.raises(MeasurementError, match=message):
        read_signals(file)


def test_an_abscissa_that_counts_samples_needs_a_rate(file):
    labels = SI._replace(axis_unit="samples", axis_scale=1.0 / RATE)
    impact(file, labels=labels)
    with pytest.raises(MeasurementError, match="does not say the sampling rate"):
        read_signals(file)
    assert read_signals(file, rate=RATE).rate == RATE


def test_a_system_of_units_other_than_si_is_refused_or_converted(file):
    impact(file, labels=Labels())
    text = file.read_text()
    units = (
        "    -1\n   164\n         7Inch (pound f)               2\n"
        + "  3.937e+01  2.248e-01  1.0e+00\n  2.7e+02\n    -1\n"
    )
    file.write_text(units + text)
    with pytest.raises(MeasurementError, match="system of units"):
        read_signals(file)


def test_a_label_in_a_file_of_si_units_is_confirmed_by_the_caller(file):
    impact(file, labels=Labels("N", "g"))
    head = "    -1\n   164\n         1SI                           2\n  1.0e+00  1.0e+00  1.0e+00\n  2.7e+02\n    -1\n"
    file.write_text(head + file.read_text())
    with pytest.raises(MeasurementError, match="set 164 states SI units"):
        read_signals(file)
    for unit, scale in (("g", 9.80665), ("m/s^2", 1.0)):
        signals = read_signals(file, response_unit=unit)
        np.testing.assert_allclose(signals.response, [scale * RESPONSE], rtol=1e-5, atol=1e-9)
    with pytest.raises(MeasurementError, match="the file states"):
        read_signals(file, response_unit="mm/s^2")


def segments(*labels, steps=(1.0, 1.0), names=("Force", "Acceleration")):
    """A LabVIEW file with a segment for each pair of units."""
    parts = []
    for number, (force, response) in enumerate(labels):
        step = steps[number % len(steps)] / RATE
        rows = "\n".join(f"{n * step:.9g}\t{FORCE[n]}\t{RESPONSE[n]}" for n in range(SAMPLES))
        parts.append(LVM.format(columns="One", n=SAMPLES, labels=f"Y_Unit_Label\t{force}\t{response}\n", step=step,
                                force=names[0], response=names[1], rows=rows))  # fmt: skip
    first, rest = parts[0], [part[part.index("\nChannels") :] for part in parts[1:]]
    return (first + "".join(rest)).replace("Multi_Headings\tNo", "Multi_Headings\tYes")


@pytest.mark.parametrize("unit", ["g", "mm/s^2", "m/s^2"])
def test_each_segment_is_in_its_own_unit(tmp_path, unit):
    (tmp_path / "a.lvm").write_text(segments(("N", "m/s^2"), ("lbf", unit)))
    signals = read_signals(tmp_path / "a.lvm")
    scale = {"g": 9.80665, "mm/s^2": 1e-3, "m/s^2": 1.0}[unit]
    np.testing.assert_allclose(signals.response, [RESPONSE, scale * RESPONSE], rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(signals.force, [FORCE, 4.4482216152605 * FORCE], rtol=1e-6)


@pytest.mark.parametrize(
    ("labels", "steps", "message"),
    [
        ([("N", "m/s^2"), ("N", "m/s")], (1.0,), "contradicts itself"),
        ([("N", "m/s^2"), ("N", "")], (1.0,), None),
        ([("N", "m/s^2"), ("N", "V")], (1.0,), "is a voltage"),
        ([("N", "m/s^2"), ("N", "m/s^2")], (1.0, 2.0), "the sampling rate is 1024 Hz here, and 2048 Hz"),
    ],
)
def test_later_segments_that_differ_are_read_or_refused(tmp_path, labels, steps, message):
    (tmp_path / "a.lvm").write_text(segments(*labels, steps=steps))
    if message is None:
        assert read_signals(tmp_path / "a.lvm").response.shape == (2, SAMPLES)
    else:
        with pytest.raises(MeasurementError, match=message):
            read_signals(tmp_path / "a.lvm")


def test_channels_of_labview_are_chosen_by_name(tmp_path):
    text = segments(("N", "g"), names=("Hammer 1", "Velocity"))
    (tmp_path / "a.lvm").write_text(text.replace("Velocity", "Sensor 3"))
    with pytest.raises(MeasurementError, match="'response': "):
        read_signals(tmp_path / "a.lvm")
    signals = read_signals(tmp_path / "a.lvm", names={"response": "Sensor 3"})
    np.testing.assert_allclose(signals.response, [9.80665 * RESPONSE], rtol=1e-6, atol=1e-12)


def test_a_step_in_the_header_that_contradicts_the_times_is_refused(tmp_path):
    text = segments(("N", "g"))
    step = f"{1 / RATE:.12E}"
    (tmp_path / "a.lvm").write_text(text.replace(f"Delta_X\t{step}\t{step}", "Delta_X\t1E-3\t1E-3"))
    with pytest.raises(MeasurementError, match="the sampling rate is 1000 Hz"):
        read_signals(tmp_path / "a.lvm")


def table(path, header, *columns):
    rows = ["\t".join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([header, *rows]) + "\n")


TIME = np.arange(SAMPLES) / RATE
TABLES = {
    "time\tforce\tresponse x\tresponse y": "1 columns of force and 2 of response",
    "time\tforce\tresponse\tacceleration": "1 columns of force and 2 of response",
    "force 1\tresponse 1\tforce 3\tresponse 2": "numbers of the columns",
    "force 1\tforce 1\tresponse 1\tresponse 2": "numbers of the columns",
    "force p1\tresponse p1\tforce p2\tresponse p1": "impacts at 2 pairs of points",
    "force node 1\tresponse node 1\tforce node 2\tresponse node 1": "impacts at 2 pairs of points",
    "force 1\tresponse 1 x\tforce 2\tresponse 2 y": "impacts at 2 pairs of points",
    "force 1\tvelocity 1\tforce 2\tacceleration 2": "different quantities",
    "force\tacceleration velocity\ta\tb": "contradicts itself",
    "force\tresponse (counts)\ta\tb": "counts",
    "force\tresponse raw\ta\tb": "raw",
    "force\tresponse_V\ta\tb": "is a voltage",
    "force\tintegrated response\ta\tb": "integrated",
    "force\tstrain response\ta\tb": "strain",
    "force\tresponse 0.1 g\ta\tb": "0.1",
    "force [g]\tresponse [g]\ta\tb": "is not",
    "moment\tresponse\ta\tb": "rotation or a moment",
}


@pytest.mark.parametrize("header", TABLES)
def test_columns_that_are_not_pairs_of_one_point_are_refused(tmp_path, header):
    columns = [
        TIME if cell.startswith("time") else FORCE if "force" in cell else RESPONSE for cell in header.split("\t")
    ]
    table(tmp_path / "a.tsv", header, *columns)
    with pytest.raises(MeasurementError, match=TABLES[header]):
        read_signals(tmp_path / "a.tsv", rate=RATE)


def test_columns_are_chosen_by_name_or_point(tmp_path):
    table(tmp_path / "a.tsv", "time\tforce\tresponse x\tresponse y", TIME, FORCE, RESPONSE, 2 * RESPONSE)
    signals = read_signals(tmp_path / "a.tsv", names={"response": "response y"})
    np.testing.assert_allclose(signals.response, [2 * RESPONSE], rtol=1e-6, atol=1e-12)
    header = "force p1\tresponse p1\tforce p2\tresponse p1"
    table(tmp_path / "b.tsv", header, FORCE, RESPONSE, 2 * FORCE, 2 * RESPONSE)
    np.testing.assert_allclose(read_signals(tmp_path / "b.tsv", rate=RATE, force="p 2").force, [2 * FORCE], rtol=1e-6)


def test_numbered_columns_are_impacts_in_any_order(tmp_path):
    header = "time\tForce 2\tResponse 1\tForce 1\tResponse 2"
    table(tmp_path / "a.tsv", header, TIME, 2 * FORCE, RESPONSE, FORCE, 2 * RESPONSE)
    signals = read_signals(tmp_path / "a.tsv")
    size = signals.force.max(axis=1)[:, np.newaxis] / FORCE.max()
    np.testing.assert_allclose(signals.response, size * RESPONSE, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    "columns", [("time", "force", "response"), ("time [ms]", "skip", "response [g]", "force [lbf]")]
)
@pytest.mark.parametrize("transposed", [False, True])
def test_an_array_of_columns_is_read(tmp_path, columns, transposed):
    scale = 1e3 if "ms" in columns[0] else 1.0
    by_name = {"time": scale * TIME, "force": FORCE, "response": RESPONSE, "skip": TIME}
    array = np.column_stack([by_name[name.split()[0]] for name in columns])
    np.save(tmp_path / "a.npy", array.T if transposed else array)
    signals = read_signals(tmp_path / "a.npy", columns=columns)
    assert signals.rate == pytest.approx(RATE)
    np.testing.assert_allclose(signals.response, [RESPONSE * (9.80665 if scale > 1 else 1.0)])
    np.testing.assert_allclose(signals.force, [FORCE * (4.4482216152605 if scale > 1 else 1.0)])
    with pytest.raises(MeasurementError, match="0 columns are named"):
        read_signals(tmp_path / "a.npy")


def test_arrays_of_several_impacts_are_ordered_by_their_numbers(tmp_path):
    arrays = {"force1": FORCE, "response1": RESPONSE, "force2": 2 * FORCE, "response2": 2 * RESPONSE}
    np.savez(tmp_path / "a.npz", **arrays, rate=RATE)
    np.testing.assert_allclose(read_signals(tmp_path / "a.npz").response, [RESPONSE, 2 * RESPONSE])
    np.savez(tmp_path / "b.npz", **arrays, response3=RESPONSE, rate=RATE)
    with pytest.raises(MeasurementError, match="may each be the"):
        read_signals(tmp_path / "b.npz")


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ({"dt": 1 / RATE}, None),
        ({"increment_ms": 1e3 / RATE}, None),
        ({"wf_increment": 1 / RATE, "wf_start_offset": 0.0}, None),
        ({"dt": 1 / RATE, "start": 0.1}, "the response starts at 0.1 s, and the force at 0 s"),
        ({"dt": 0.001}, "the sampling rate is 1000 Hz"),
        ({"dt": 1 / RATE, "description": "gain 10"}, "may act on the values"),
        ({"dt": 1 / RATE, "quantity": "velocity"}, None),
        ({"dt": 1 / RATE, "quantity": "strain"}, "is not a quantity"),
        ({"dt": 1 / RATE, "unit": "counts"}, "'counts' is not the response"),
    ],
)
def test_attributes_of_hdf5_datasets_are_read(tmp_path, attributes, message):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["force"], file["response"] = FORCE, RESPONSE
        file["force"].attrs["dt"], file["force"].attrs["start"] = 1 / RATE, 0.0
        for name, value in attributes.items():
            file["response"].attrs[name] = value
    if message is None:
        signals = read_signals(tmp_path / "a.h5")
        assert signals.rate == pytest.approx(RATE)
        assert signals.quantity == ("mobility" if "quantity" in attributes else "accelerance")
    else:
        with pytest.raises(MeasurementError, match=message):
            read_signals(tmp_path / "a.h5")


def test_a_matlab_file_is_read_in_the_guarded_process(tmp_path):
    savemat(
        tmp_path / "a.mat", {"s": {"force": FORCE, "response": RESPONSE, "fs_kHz": RATE / 1e3, "force_unit": "lbf"}}
    )
    signals = read_signals(tmp_path / "a.mat", response_unit="g")
    assert signals.rate == RATE
    np.testing.assert_allclose(signals.force, [4.4482216152605 * FORCE])


def test_a_negative_pulse_of_the_hammer_is_reported(tmp_path):
    np.savez(tmp_path / "a.npz", force=np.array([-FORCE, FORCE]), response=np.array([RESPONSE, RESPONSE]), rate=RATE)
    (warning,) = read_signals(tmp_path / "a.npz").warnings
    assert warning.startswith("the force of impact 1 is recorded as a negative pulse.")


def test_attributes_of_a_group_hold_for_its_datasets(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["test/force"], file["test/response"] = FORCE, RESPONSE
        file["test"].attrs["fs_kHz"], file["test"].attrs["units"] = RATE / 1e3, "lbf, g"
    signals = read_signals(tmp_path / "a.h5")
    assert signals.rate == pytest.approx(RATE)
    np.testing.assert_allclose(signals.force, [4.4482216152605 * FORCE])
    np.testing.assert_allclose(signals.response, [9.80665 * RESPONSE])


def test_short_integers_without_a_unit_are_asked_for_one(tmp_path):
    counts = np.round(100 * FORCE).astype(np.int16)
    np.savez(tmp_path / "a.npz", force=counts, response=RESPONSE, rate=RATE)
    with pytest.raises(MeasurementError, match="integers without a unit"):
        read_signals(tmp_path / "a.npz")
    np.testing.assert_allclose(read_signals(tmp_path / "a.npz", force_unit="N").force, [counts])


HARMLESS = (
    *("Date: 2024-01-01", "Operator: N. N.", "Number of averages: 4", "Trigger level: 5 N", "Range: 10 V", "Units: SI"),
    *("Time: 10:15:00", "Hammer tip: steel", "Record length: 1024", "Units: N, m/s^2, s", "Sampling rate: 2048 Hz"),
    *("Channel 1: Hammer 086C03", "Sampling rate\t2.048 kHz", "Sensor, 352C22", "Test of 2 beams in a lab", "a / b"),
)


@pytest.mark.parametrize("line", HARMLESS)
def test_irrelevant_lines_above_a_table_are_skipped(tmp_path, line):
    table(tmp_path / "a.tsv", f"{line}\ntime\tforce\tresponse", TIME, FORCE, RESPONSE)
    np.testing.assert_allclose(read_signals(tmp_path / "a.tsv").response, [RESPONSE], rtol=1e-6, atol=1e-12)


STATING = {
    "Response unit: g": 9.80665,
    "unit: g": 9.80665,
    "Units: lbf; g": 9.80665,
    "All accelerations in g": 9.80665,
    "Sampling rate: 1 kHz": "the sampling rate is",
    "dt = 0.001 s": "the sampling rate is",
    "Sample interval\t0.001": "the sampling rate is",
    "Response unit: furlong": "receptance",
    "unit: xyz": "not understood",
    "Gain: 10": "may act",
    "Sensitivity: 10.2 mV/g": "may act",
    "Response: strain": "not a quantity",
    "Response: velocity": "mobility",
    "Response unit: V": "is a voltage",
}


@pytest.mark.parametrize("line", STATING)
def test_lines_above_a_table_count(tmp_path, line):
    table(tmp_path / "a.tsv", f"{line}\ntime\tforce\tresponse", TIME, FORCE, RESPONSE)
    expected = STATING[line]
    if isinstance(expected, float):
        np.testing.assert_allclose(
            read_signals(tmp_path / "a.tsv").response, [expected * RESPONSE], rtol=1e-6, atol=1e-12
        )
    elif expected in ("mobility", "receptance"):
        assert read_signals(tmp_path / "a.tsv").quantity == expected
    else:
        with pytest.raises(MeasurementError, match=expected):
            read_signals(tmp_path / "a.tsv")


def test_a_sensitivity_is_ignored_if_the_unit_is_given(tmp_path):
    table(tmp_path / "a.tsv", "Sensitivity: 10.2 mV/g\ntime\tforce [N]\tresponse [g]", TIME, FORCE, RESPONSE)
    assert read_signals(tmp_path / "a.tsv").quantity == "accelerance"


SENSORS = {
    "Accelerometer (m/s2)": "accelerance",
    "Vibrometer (mm/s)": "mobility",
    "Response laser [um]": "receptance",
    "Response velocity in mm/s": "mobility",
    "Vibrometer": "does not say whether",
    "Response laser": "does not say whether",
    "Response (dB re 1 g)": "dB",
    "Response [dB]": "dB",
    "Response rms": "rms",
    "Response (inverted)": "inverted",
    "-Response": "'-' is not understood",
    "Response x 10": "x 10",
    "Accel g X": "holds 'g'",
    "Response mm/s sensor": "holds 'mm/s'",
}


@pytest.mark.parametrize("name", SENSORS)
def test_the_name_of_a_column_may_be_that_of_a_sensor(tmp_path, name):
    table(tmp_path / "a.tsv", f"time\tforce\t{name}", TIME, FORCE, RESPONSE)
    if SENSORS[name] in ("accelerance", "mobility", "receptance"):
        assert read_signals(tmp_path / "a.tsv").quantity == SENSORS[name]
    else:
        with pytest.raises(MeasurementError, match=SENSORS[name]):
            read_signals(tmp_path / "a.tsv")


@pytest.mark.parametrize("name", ["Response -z", "response 5-z", "Response (-z)", "acceleration_-z"])
def test_a_negative_axis_in_a_name_changes_the_sign(tmp_path, name):
    table(tmp_path / "a.tsv", f"time\tforce +z\t{name}", TIME, FORCE, RESPONSE)
    np.testing.assert_allclose(read_signals(tmp_path / "a.tsv").response, [-RESPONSE], rtol=1e-6, atol=1e-12)


def test_an_archive_may_list_points_and_directions(tmp_path):
    np.savez(tmp_path / "a.npz", force=FORCE, response=RESPONSE, rate=RATE, response_dof="5-z", force_dof="1+z")
    signals = read_signals(tmp_path / "a.npz")
    np.testing.assert_allclose(signals.response, [-RESPONSE])
    assert (signals.response_point, signals.force_point) == ("5-z", "1+z")
    np.savez(tmp_path / "b.npz", force=[FORCE] * 3, response=[RESPONSE] * 3, rate=RATE, nodes=[1, 2, 3])
    with pytest.raises(MeasurementError, match="impacts at 3 pairs of points"):
        read_signals(tmp_path / "b.npz")
    assert read_signals(tmp_path / "b.npz", force="2").force.shape == (1, SAMPLES)


@pytest.mark.parametrize("suffix", ["npz", "mat", "h5"])
@pytest.mark.parametrize(
    ("name", "values", "message"),
    [("units", ["lbf", "g"], None), ("gain", [1.0, 10.0], "may act"), ("node", [1, 2], "2 pairs of points")],
)
def test_a_list_in_an_archive_counts(tmp_path, suffix, name, values, message):
    entries = {"force": [FORCE, FORCE], "response": [RESPONSE, RESPONSE], "rate": RATE, name: values}
    path = tmp_path / f"a.{suffix}"
    if suffix == "npz":
        np.savez(path, **entries)
    elif suffix == "mat":
        savemat(path, entries | {name: np.array(values, dtype=object) if name == "units" else values})
    else:
        with h5py.File(path, "w") as file:
            for key, value in entries.items():
                file[key] = value
    if message:
        with pytest.raises(MeasurementError, match=message):
            read_signals(path)
    else:
        signals = read_signals(path)
        np.testing.assert_allclose(signals.force, [4.4482216152605 * FORCE] * 2)
        np.testing.assert_allclose(signals.response, [9.80665 * RESPONSE] * 2)


@pytest.mark.parametrize(
    "name", ["Response (g) CH2", "CH2 Response [g]", "Response (g)_2", "Response_g (CH2)", "CH2: Response (g)"]
)
def test_a_unit_within_a_name_counts(tmp_path, name):
    table(tmp_path / "a.tsv", f"time\tforce\t{name}", TIME, FORCE, RESPONSE)
    np.testing.assert_allclose(read_signals(tmp_path / "a.tsv").response, [9.80665 * RESPONSE], rtol=1e-6, atol=1e-12)
    np.savez(tmp_path / "a.npz", **{"force": FORCE, name: RESPONSE, "rate": RATE})
    np.testing.assert_allclose(read_signals(tmp_path / "a.npz").response, [9.80665 * RESPONSE], rtol=1e-6, atol=1e-12)


def test_nodes_of_the_hammer_as_references_of_the_responses(file):
    for node in (1, 2):
        impact(file, force=(0, 0), reference=(node, 3), sizes=(1.0, node))
    with pytest.raises(MeasurementError, match=r"response 1\+z, force 2\+z: 1 impacts"):
        read_signals(file)
    np.testing.assert_allclose(read_signals(file, force="2").response, [2 * RESPONSE], rtol=1e-5, atol=1e-9)


ID_LINES = {
    "Response unit: g": 9.80665,
    "Measured 24-Nov-26 10:00:00": 1.0,
    "Channel 2: Point 1+Z": 1.0,
    "averages: 10": 1.0,
    "Gain: 10": "may act",
    "10 mV/g, gain 10": "may act",
    "Sampling rate: 1 kHz": "the sampling rate is",
    "Response: velocity": "contradicts itself",
}


@pytest.mark.parametrize("line", ID_LINES)
def test_id_lines_of_a_universal_file_count(file, line):
    impact(file, labels=Labels(), id2=line)
    if isinstance(ID_LINES[line], float):
        np.testing.assert_allclose(read_signals(file).response, [ID_LINES[line] * RESPONSE], rtol=1e-5, atol=1e-9)
    else:
        with pytest.raises(MeasurementError, match=ID_LINES[line]):
            read_signals(file)


@pytest.mark.parametrize(
    "line", ["Start time: 10:00:00", "Start: 2024-01-01", "Step: 3", "Sampling: continuous", "T: 20"]
)
def test_words_of_a_log_are_not_times_of_samples(tmp_path, line):
    table(tmp_path / "a.tsv", f"{line}\ntime\tforce\tresponse", TIME, FORCE, RESPONSE)
    assert read_signals(tmp_path / "a.tsv").rate == pytest.approx(RATE)


def test_channels_of_labview_that_start_at_different_times_are_refused(tmp_path):
    (tmp_path / "a.lvm").write_text(segments(("N", "g")).replace("X0\t0\t0", "X0\t0\t0.01"))
    with pytest.raises(MeasurementError, match="start at different times"):
        read_signals(tmp_path / "a.lvm")


def test_several_entries_are_skipped(tmp_path):
    np.savez(tmp_path / "a.npz", force=FORCE, response=RESPONSE, rate=RATE, gain=10.0, offset=3.0)
    with pytest.raises(MeasurementError, match="may act"):
        read_signals(tmp_path / "a.npz", names={"skip": "gain"})
    assert read_signals(tmp_path / "a.npz", names={"skip": "gain,offset"}).rate == RATE


def test_two_motions_of_one_force_at_the_same_point_are_refused(file):
    impact(file, response=(0, 0))
    motion(file, (0, 0), size=2.0)
    with pytest.raises(MeasurementError, match="2 time records of a motion for 1 of a force at the same point"):
        read_signals(file)


def test_channels_called_voltage_are_read_with_their_sensitivities(tmp_path):
    text = segments(("Volts", "Volts"), names=("Voltage_0", "Voltage_1"))
    (tmp_path / "a.lvm").write_text(text)
    names = {"force": "Voltage_0", "response": "Voltage_1"}
    with pytest.raises(MeasurementError, match="is a voltage"):
        read_signals(tmp_path / "a.lvm", names=names)
    options = {"names": names, "force_sensitivity": "10 mV/N", "response_sensitivity": "100 mV/g"}
    signals = read_signals(tmp_path / "a.lvm", **options)
    np.testing.assert_allclose(signals.force, [100 * FORCE])
    np.testing.assert_allclose(signals.response, [98.0665 * RESPONSE], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("name", ["sensor_g", "sensor (g)", "test/sensor_g"])
def test_a_name_that_the_caller_chooses_still_states_a_unit(tmp_path, name):
    np.savez(tmp_path / "a.npz", **{"force": FORCE, name: RESPONSE, "rate": RATE})
    signals = read_signals(tmp_path / "a.npz", names={"response": name})
    np.testing.assert_allclose(signals.response, [9.80665 * RESPONSE])
    table(tmp_path / "a.tsv", f"time\tforce\t{name}", TIME, FORCE, RESPONSE)
    signals = read_signals(tmp_path / "a.tsv", names={"response": name})
    np.testing.assert_allclose(signals.response, [9.80665 * RESPONSE], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("name", ["-", "()", "[ ]", "in", "//", "  "])
def test_a_name_without_a_word_is_skipped(tmp_path, name):
    table(tmp_path / "a.tsv", f"time\tforce\tresponse\t{name}", TIME, FORCE, RESPONSE, RESPONSE)
    assert read_signals(tmp_path / "a.tsv").rate == pytest.approx(RATE)
