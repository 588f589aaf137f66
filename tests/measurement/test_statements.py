"""What the statements of a file mean together, and what free text states."""

from __future__ import annotations

import pytest

from dovetail.errors import MeasurementError
from dovetail.measurement.free_text import read_texts
from dovetail.measurement.statements import Statement, interpret

INCH_PER_POUND = 0.0254 / 4.4482216152605


@pytest.mark.parametrize(
    ("statements", "quantity", "factor"),
    [
        ([("unit", "g/N")], "accelerance", 9.80665),
        ([("motion unit", "in"), ("load unit", "lbf")], "receptance", INCH_PER_POUND),
        ([("unit", "in/lbf"), ("load unit", "lbf"), ("label", "Receptance")], "receptance", INCH_PER_POUND),
        ([("label", "FRF (mm/s/N)"), ("quantity", "mobility")], "mobility", 1e-3),
        ([("label", "Acceleration/Force")], "accelerance", 1.0),
        ([("motion quantity", "displacement"), ("load label", "Force [kN]")], "receptance", 1e-3),
    ],
)
def test_statements_that_agree_give_quantity_and_factor(
    statements: list[tuple[str, str]], quantity: str, factor: float
) -> None:
    meaning = interpret(Statement(about, text, "a") for about, text in statements)
    assert meaning.quantity == quantity
    assert meaning.factor == pytest.approx(factor)
    assert meaning.per_load


@pytest.mark.parametrize(
    "statements",
    [
        [("unit", "g/N"), ("label", "FRF (m/s^2/N)")],
        [("unit", "g/N"), ("quantity", "mobility")],
        [("motion quantity", "displacement"), ("label", "Acceleration")],
        [("unit", "g/N"), ("load unit", "lbf")],
        [("unit", "m/N"), ("load label", "Moment")],
        [("axis unit", "Hz"), ("axis label", "Frequency [kHz]")],
        [("motion unit", "m"), ("label", "FRF (rad/N)")],
    ],
)
def test_a_contradiction_is_refused_with_both_places(statements: list[tuple[str, str]]) -> None:
    with pytest.raises(MeasurementError, match="the file contradicts itself") as caught:
        interpret(Statement(about, text, f"place {number}") for number, (about, text) in enumerate(statements))
    assert "place 0" in str(caught.value)
    assert "place 1" in str(caught.value)


def test_a_time_axis_is_converted_to_seconds() -> None:
    statements = [Statement("axis label", "Time [ms]", "a"), Statement("motion unit", "g", "b")]
    meaning = interpret(statements, axis="s")
    assert (meaning.axis_factor, meaning.motion_factor, meaning.per_load) == (1e-3, 9.80665, False)


UNITS = [
    "Unit: g/N", "# units: g/N", "% Einheit: g/N", "unit,g/N", "Unit;g/N", '"Unit","g/N"', "Y-Axis unit: g/N", "g/N",
    "AmplitudeUnit:\tg/N\t \t ", "FRF [g/N]", "Units: Hz, g/N", "unit = g/N", "H_unit: g/N", "Hz;g/N;g/N",
]  # fmt: skip


@pytest.mark.parametrize("line", UNITS)
def test_a_line_with_a_unit_states_it(line: str) -> None:
    assert interpret(read_texts([("", line, "a:1")]).statements).factor == pytest.approx(9.80665)


HARMLESS = [
    "Test of 2026-03-01, hammer 086C03", "Accelerometer 352C22, 10 mV/g, calibrated 2025-11-02", "Operator: A",
    "Overload: N", "Gain: 1", "Delay: 0", "Calibration date: 2025-11-02", "Calibrated Mar 2026", "Record length: 1 s",
    "Window: Hanning", "Sampling rate: 51200 Hz", "Range 0 to 3.2 kHz", "Temperature: 21.5 °C", "Torque: 60 Nm",
    "Date: 25.03.2026 10:15", "unit under test: spindle 7", "10 averages, Hanning, 66.7 % overlap", "scale: linear",
    "Project: C:/data/test 1/frf.txt", "H1(f) = Gxy/Gxx", "Spindle 7, speed 3000 rpm, tool 16 mm, overhang 60 mm",
    "Input range: 10 V", "Dynamic range: 120 dB", "Test after recalibration, serial 4711", "Trigger level: 5.5 %",
]  # fmt: skip


@pytest.mark.parametrize("line", HARMLESS)
def test_a_line_about_the_test_states_nothing(line: str) -> None:
    found = read_texts([("", line, "a:1")])
    assert (found.statements, found.mentions) == ([], [])


ACTING = [
    "Gain: 10", "gain 10 dB", "Delay: 0.5 ms", "Calibration factor = 0.98", "all values times 1000", "values x1000",
    "Kalibrierfaktor: 0,98", "Latency: 0.2 ms", "Window correction: 1.5", "Sensitivity: 10.2 mV/g",
    "Scale factor: 9.81",
    "exponential window, 0.1 s", "Skew: 12 us", "multiplied by 9.81", "# attenuation: 20 dB",
]  # fmt: skip


@pytest.mark.parametrize("line", ACTING)
def test_a_number_that_may_act_on_the_values_is_refused(line: str) -> None:
    with pytest.raises(MeasurementError, match=r"may (act on|be a factor of) the values"):
        read_texts([("", line, "a:1")])


def test_a_number_is_accepted_if_its_name_is_skipped() -> None:
    assert read_texts([("", "Gain: 10", "a:1")], skip=["gain"]).statements == []
