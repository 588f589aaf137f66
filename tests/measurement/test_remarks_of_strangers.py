"""Remarks in the words of strangers: what they say of the values is used or refused, in every format."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from dovetail.errors import MeasurementError
from dovetail.measurement import read_frf
from dovetail.measurement.impact_test.signal_files import read_signals
from support.measured_files import fault_of
from support.statement_files import LINES, TEXTS, VALUES, Said

pytestmark = [pytest.mark.usefixtures("unguarded"), pytest.mark.sweep]

NAMED = ("csv", "footer", "npz", "mat 5", "attribute", "attribute of the file")
"""Forms in which a name and a text can be anything; the others have labels of their own."""


def with_statement(tmp_path: Path, form: str, name: str, text: str) -> Path:
    suffix, write = (LINES | TEXTS)[form]
    if form in LINES:
        return write(tmp_path / suffix, Said(lines=(f"{name}: {text}" if name else text,)))
    return write(tmp_path / suffix, Said(texts={name.replace(" ", "_") or "info": text}))


REFUSED = [
    ("", "all amplitudes scaled to mm"), ("exponent", "-3"), ("", "# 10^-3"), ("", "x 10**-6"), ("prefix", "milli"),
    ("unit prefix", "micro"), ("", "values in thousandths"), ("polarity", "negative"), ("", "reversed polarity"),
    ("mounting", "upside down"), ("", "accelerometer mounted upside down"), ("response direction", "-x"),
    ("sensor orientation", "-z"), ("", "sensor points in -x"), ("integration", "twice"), ("", "integrated twice"),
    ("", "double integrated to displacement"), ("", "differentiated"), ("", "divided by (j omega)^2"),
    ("", "multiplied by omega^2"), ("frequency shift", "+5 Hz"), ("phase shift", "180 deg"), ("", "phase zeroed"),
    ("phase reference", "response"), ("", "phase of the force relative to the response"), ("", "rectified"),
    ("", "difference between two FRFs"), ("", "ratio of FRFs"), ("", "H/H(0)"), ("", "H / Hmax"), ("", "strain FRF"),
    ("type", "strain"), ("quantity type", "sound pressure"), ("", "pressure/force"), ("response type", "rotation"),
    ("", "rotational acceleration"), ("", "angular response"), ("calibrated", "no"), ("", "uncalibrated sensors"),
    ("invert", "yes"), ("", "in milli-g per newton"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "text"), REFUSED)
@pytest.mark.parametrize("form", NAMED)
def test_a_remark_that_the_values_are_something_else_is_refused(
    tmp_path: Path, form: str, name: str, text: str
) -> None:
    path = with_statement(tmp_path, form, name, text)
    assert path.name in fault_of(path, quantity="accelerance")
    np.testing.assert_allclose(read_frf(path, quantity="accelerance", names={"skip": text}).values, VALUES, rtol=1e-9)


USED = [
    ("", "Force [kN]", 1e-3), ("", "Acceleration (g)", 9.80665), ("accelerometer", "g", 9.80665),
    ("", "Response unit is g, force unit is N", 9.80665), ("", "The acceleration unit is mm/s^2.", 1e-3),
    ("", "force unit is lbf", 1 / 4.4482216152605),
]  # fmt: skip


@pytest.mark.parametrize(("name", "text", "factor"), USED)
@pytest.mark.parametrize("form", NAMED)
def test_a_unit_in_a_remark_is_used(tmp_path: Path, form: str, name: str, text: str, factor: float) -> None:
    path = with_statement(tmp_path, form, name, text)
    unit = {"unit": "g/N"} if factor == 9.80665 else {"unit": "mm/s^2/N"} if "mm" in text else {}
    unit = unit or {"unit": "m/s^2/kN" if "kN" in text else "m/s^2/lbf"}
    np.testing.assert_allclose(read_frf(path, **unit).values, factor * VALUES, rtol=1e-9)
    assert path.name in fault_of(path, unit="in/s^2/N")


@pytest.mark.parametrize("text", ["microphone Pa/N", "V/lbf"])
@pytest.mark.parametrize("form", NAMED)
def test_something_per_load_that_is_not_understood_is_asked_for(tmp_path: Path, form: str, text: str) -> None:
    path = with_statement(tmp_path, form, "", text)
    assert path.name in fault_of(path, quantity="accelerance")
    np.testing.assert_allclose(read_frf(path, unit="m/s^2/N").values, VALUES, rtol=1e-9)


@pytest.mark.parametrize("text", ["torque excitation", "moment excitation"])
@pytest.mark.parametrize("form", NAMED)
def test_excitation_by_a_moment_is_recognised_in_a_remark(tmp_path: Path, form: str, text: str) -> None:
    assert read_frf(with_statement(tmp_path, form, "", text), quantity="accelerance").moment


SOUND = [
    ("ambient pressure", "1013 hPa"), ("", "air pressure 1013 hPa"), ("sound card", "RME"), ("current date", "Monday"),
    ("integration time", "1 s"), ("phase shift", "0"), ("shift", "early"), ("signal to noise ratio", "40 dB"),
    ("direction", "x"), ("axis", "Z"), ("", "X - Y plot"), ("rotational speed", "1000 rpm"),
    ("tightening torque", "60 N m"), ("prefix", "run"), ("path", "/home/w/data"), ("url", "http://w3.org"),
    ("response", "1+x"), ("", "transfer FRF from 2-x to 1+x"), ("", "stress relieved holder"),
    ("", "calibrated sensors"),
    ("calibrated", "yes"), ("polarity", "positive"), ("", "not differentiated"), ("Force", "PCB 086C03"),
    ("", "difference frequency 5 Hz"), ("mode", "0"), ("exponent", "0"), ("", "hammer of one kilo"),
    ("voltage", "24 V"), ("", "spindle not rotating"),
    ("", "SI units are used"), ("", "Force (hammer)"), ("", "mean of 10 impacts"), ("angular position", "0 deg"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "text"), SOUND)
@pytest.mark.parametrize("form", NAMED)
def test_a_remark_on_something_else_is_accepted(tmp_path: Path, form: str, name: str, text: str) -> None:
    path = with_statement(tmp_path, form, name, text)
    np.testing.assert_allclose(read_frf(path, quantity="accelerance").values, VALUES, rtol=1e-9)


@pytest.mark.parametrize("flag", ["is_dB", "isInverted", "is_conjugated", "has_swapped_channels"])
def test_a_flag_of_one_counts_as_set(tmp_path: Path, flag: str) -> None:
    frequency = 10.0 + 2.5 * np.arange(VALUES.size)
    for value, sound in ((1, False), (0, True), (True, False), (1.0, False)):
        parts = {"amplitude": np.abs(VALUES), "phase_deg": np.degrees(np.angle(VALUES))}
        np.savez(tmp_path / "a.npz", frequency=frequency, **parts, **{flag: value})
        if sound:
            read_frf(tmp_path / "a.npz", quantity="accelerance")
        else:
            fault_of(tmp_path / "a.npz", quantity="accelerance")


@pytest.mark.parametrize("text", ["Accelerance (g/N)", "acceleration [g/N]", "inertance [g/N]"])
@pytest.mark.parametrize("form", NAMED)
def test_a_unit_behind_a_quantity_is_used(tmp_path: Path, form: str, text: str) -> None:
    read = read_frf(with_statement(tmp_path, form, "type", text))
    np.testing.assert_allclose(read.values, 9.80665 * VALUES, rtol=1e-9)


CURVES = ["sensor_frf", "H_sensor", "cal", "transducer_response", "calibration_curve"]


@pytest.mark.parametrize("name", CURVES)
@pytest.mark.parametrize("form", ["npz", "mat 5", "hdf5"])
def test_the_response_of_a_sensor_next_to_the_values_is_refused(tmp_path: Path, form: str, name: str) -> None:
    suffix, write = TEXTS[form]
    path = write(tmp_path / suffix, Said(texts={name: np.exp(1j * np.arange(VALUES.size))}))
    assert name in fault_of(path, quantity="accelerance")
    read_frf(path, quantity="accelerance", names={"skip": name})


@pytest.mark.parametrize("key", ["_FillValue", "missing_value", "fill_value"])
@pytest.mark.parametrize("as_array", [False, True])
def test_numbers_that_stand_for_missing_ones_are_refused(tmp_path: Path, key: str, as_array: bool) -> None:
    for filled in (False, True):
        real, imag = VALUES.real.copy(), VALUES.imag.copy()
        if filled:
            real[3] = imag[3] = -999.0
        with h5py.File(tmp_path / "a.h5", "w") as file:
            file["frequency"] = 10.0 + 2.5 * np.arange(VALUES.size)
            file["real"], file["imag"] = real, imag
            for name in ("real", "imag"):
                file[name].attrs[key] = [-999.0] if as_array else -999.0
        if filled:
            assert "missing" in fault_of(tmp_path / "a.h5", quantity="accelerance")
        else:
            read_frf(tmp_path / "a.h5", quantity="accelerance")


TIME = np.arange(256) / 2048.0
PULSE, RING = np.where(TIME < 0.003, 100 * np.sin(np.pi * TIME / 0.003), 0.0), np.exp(-20 * TIME) * np.sin(600 * TIME)


def signals(tmp_path: Path, form: str, name: str, text: str) -> Path:
    if form == "npz":
        said = {name.replace(" ", "_") or "info": text}
        np.savez(tmp_path / "a.npz", force=PULSE, response=RING, rate=2048.0, **said)
        return tmp_path / "a.npz"
    rows = [f"{t:.12g},{f:.12g},{a:.12g}" for t, f, a in zip(TIME, PULSE, RING, strict=True)]
    line = f"{name}: {text}" if name else text
    (tmp_path / "a.csv").write_text("\n".join([f"# {line}", "time,force,response", *rows]) + "\n")
    return tmp_path / "a.csv"


REFUSED_SIGNALS = [
    ("", "strain"), ("type", "strain"), ("", "accelerometer mounted upside down"), ("sensor", "upside down"),
    ("polarity", "negative"), ("", "integrated twice"), ("", "sound pressure"), ("exponent", "-3"), ("", "10 mV/g"),
    ("calibrated", "no"), ("", "uncalibrated"), ("sensor direction", "-z"), ("", "response differentiated"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "text"), REFUSED_SIGNALS)
@pytest.mark.parametrize("form", ["csv", "npz"])
def test_a_remark_that_records_are_something_else_is_refused(tmp_path: Path, form: str, name: str, text: str) -> None:
    with pytest.raises(MeasurementError):
        read_signals(signals(tmp_path, form, name, text))


USED_SIGNALS = [
    ("", "Force [kN]", 1e3, 1.0), ("", "Acceleration (g)", 1.0, 9.80665), ("accelerometer", "g", 1.0, 9.80665),
    ("hammer", "lbf", 4.4482216152605, 1.0),
]  # fmt: skip


@pytest.mark.parametrize(("name", "text", "force", "response"), USED_SIGNALS)
@pytest.mark.parametrize("form", ["csv", "npz"])
def test_a_unit_in_a_remark_on_records_is_used(
    tmp_path: Path, form: str, name: str, text: str, force: float, response: float
) -> None:
    read = read_signals(signals(tmp_path, form, name, text))
    np.testing.assert_allclose(read.force.ravel(), force * PULSE, atol=1e-9)
    np.testing.assert_allclose(read.response.ravel(), response * RING, atol=1e-9)


@pytest.mark.parametrize("text", ["high-pass filtered", "AC coupled", "trigger level 10 N", "DC offset removed"])
@pytest.mark.parametrize("form", ["csv", "npz"])
def test_a_remark_on_the_settings_of_records_is_accepted(tmp_path: Path, form: str, text: str) -> None:
    np.testing.assert_allclose(read_signals(signals(tmp_path, form, "", text)).force.ravel(), PULSE, atol=1e-9)


WINDOWS = [("window", "exponential"), ("", "exponential window"), ("response window", "Exponential"),
           ("", "Window of the response: exp")]  # fmt: skip


@pytest.mark.parametrize(("name", "text"), WINDOWS)
@pytest.mark.parametrize("form", NAMED)
def test_the_damping_of_an_exponential_window_is_reported(tmp_path: Path, form: str, name: str, text: str) -> None:
    with pytest.warns(UserWarning, match="adds to the damping of every mode"):
        read_frf(with_statement(tmp_path, form, name, text), quantity="accelerance")


@pytest.mark.parametrize(("name", "text"), WINDOWS)
@pytest.mark.parametrize("form", ["csv", "npz"])
def test_the_damping_of_an_exponential_window_of_records_is_reported(
    tmp_path: Path, form: str, name: str, text: str
) -> None:
    with pytest.warns(UserWarning, match="adds to the damping of every mode"):
        read_signals(signals(tmp_path, form, name, text))


@pytest.mark.parametrize(("name", "text"), [("window", "none"), ("", "no exponential window"), ("window", "Hann")])
@pytest.mark.parametrize("form", NAMED)
def test_other_windows_are_not_reported(
    tmp_path: Path, form: str, name: str, text: str, recwarn: pytest.WarningsRecorder
) -> None:
    read_frf(with_statement(tmp_path, form, name, text), quantity="accelerance")
    assert not recwarn
