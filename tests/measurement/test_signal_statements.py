"""Every way of stating unit, quantity and times in every format of time records: right, or refused, never otherwise."""

from __future__ import annotations

import numpy as np
import pytest

from dovetail.errors import MeasurementError
from dovetail.measurement.impact_test.signal_files import read_signals
from dovetail_plugins.readers import guarded_arrays as guarded
from support.signal_writers import (
    FORCE,
    HERTZ,
    MOTIONS,
    NEWTONS,
    RATE,
    RESPONSE,
    SECONDS,
    TYPES,
    WORDS,
    WRITERS,
    Labels,
)

pytestmark = pytest.mark.sweep


@pytest.fixture(autouse=True)
def in_this_process(monkeypatch):
    """Read HDF5 and MATLAB files without the time that a guarded process takes to start."""
    monkeypatch.setattr(guarded, "call_guarded", lambda call, *arguments, **_: call(*arguments))


def written(tmp_path, way, labels):
    name = way.split()[0]
    WRITERS[way](tmp_path / name, labels)
    return tmp_path / name


def check(signals, quantity):
    np.testing.assert_allclose(signals.force, FORCE[np.newaxis], rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(signals.response, RESPONSE[np.newaxis], rtol=1e-5, atol=1e-9)
    assert signals.rate == pytest.approx(RATE, rel=1e-4)
    assert signals.quantity == quantity


def labels_with_units(force, response, **other):
    quantity, scale = MOTIONS[response]
    return quantity, Labels(force, response, force_scale=NEWTONS[force], response_scale=scale, **other)


@pytest.mark.parametrize("response", [unit for unit in MOTIONS if unit])
@pytest.mark.parametrize("way", WRITERS)
def test_a_unit_of_the_response_is_that_of_its_numbers(tmp_path, way, response):
    quantity, labels = labels_with_units("N", response, word="velocity" if "word only" in way and "/s" in response
                                    and "^2" not in response else "")  # fmt: skip
    check(read_signals(written(tmp_path, way, labels)), quantity)


@pytest.mark.parametrize("force", [unit for unit in NEWTONS if unit])
@pytest.mark.parametrize("way", WRITERS)
def test_a_unit_of_the_force_is_that_of_its_numbers(tmp_path, way, force):
    quantity, labels = labels_with_units(force, "g")
    check(read_signals(written(tmp_path, way, labels)), quantity)


@pytest.mark.parametrize("unit", [unit for unit in MOTIONS if unit])
@pytest.mark.parametrize("way", WRITERS)
def test_the_unit_of_an_option_is_that_of_numbers_without_one(tmp_path, way, unit):
    quantity, scale = MOTIONS[unit]
    labels = Labels(word=WORDS[quantity], response_scale=scale, force_scale=NEWTONS["lbf"])
    if way.endswith("ascii unit") or way.endswith("binary unit"):
        pytest.skip("this way states units only")
    check(read_signals(written(tmp_path, way, labels), force_unit="lbf", response_unit=unit), quantity)


@pytest.mark.parametrize("word", TYPES)
@pytest.mark.parametrize("way", [way for way in WRITERS if not way.endswith(" unit")])
def test_a_quantity_without_a_unit_is_in_si(tmp_path, way, word):
    quantity = next(quantity for quantity, name in WORDS.items() if name == word)
    check(read_signals(written(tmp_path, way, Labels(word=word))), quantity)


@pytest.mark.parametrize("unit", [*[(word, unit) for word in TYPES for unit in MOTIONS if unit
                                    and WORDS[MOTIONS[unit][0]] != word]])  # fmt: skip
@pytest.mark.parametrize("way", [way for way in WRITERS if not way.endswith(" unit")])
def test_a_quantity_that_contradicts_the_unit_is_refused(tmp_path, way, unit):
    with pytest.raises(MeasurementError, match=r"contradicts|states"):
        read_signals(written(tmp_path, way, Labels("N", unit[1], unit[0])))


@pytest.mark.parametrize("unit", ["V", "mV", "xyz", "%", "N", "m/s^3", "Pa", "um/N", "strain", "rad/s", "kg"])
@pytest.mark.parametrize("way", WRITERS)
def test_a_unit_that_is_not_one_of_a_motion_is_refused(tmp_path, way, unit):
    if unit == "xyz" and "suffix" in way:
        pytest.skip("a word at the end of a name may be that of a sensor")
    labels = Labels("N", unit, "velocity")
    with pytest.raises(MeasurementError):
        read_signals(written(tmp_path, way, labels))


@pytest.mark.parametrize("unit", ["V", "xyz", "g", "m", "N m", "g/N", "kg", "psi"])
@pytest.mark.parametrize("way", WRITERS)
def test_a_unit_that_is_not_one_of_a_force_is_refused(tmp_path, way, unit):
    if unit == "xyz" and "suffix" in way:
        pytest.skip("a word at the end of a name may be that of a sensor")
    with pytest.raises(MeasurementError):
        read_signals(written(tmp_path, way, Labels(unit, "m/s^2")))


@pytest.mark.parametrize("option", [{"response_unit": "m/s^2"}, {"response_unit": "mm/s"}, {"force_unit": "lbf"}])
@pytest.mark.parametrize("way", WRITERS)
def test_an_option_that_contradicts_the_file_is_refused(tmp_path, way, option):
    _, labels = labels_with_units("N", "g")
    with pytest.raises(MeasurementError, match="the file states"):
        read_signals(written(tmp_path, way, labels), **option)


AXES = [("time", unit) for unit in SECONDS] + [("rate", unit) for unit in HERTZ] + [("step", unit) for unit in SECONDS]
NO_STEP = ("hit.uff", "hit.npy")


def axis_of(kind, unit):
    return (HERTZ if kind == "rate" else SECONDS)[unit]


@pytest.mark.parametrize(("kind", "unit"), AXES)
@pytest.mark.parametrize("way", WRITERS)
def test_times_and_rates_are_in_the_unit_that_the_file_states(tmp_path, way, kind, unit):
    if kind != "time" and way.startswith("hit.uff"):
        pytest.skip("these formats state times")
    _, labels = labels_with_units("N", "m/s^2", axis=kind, axis_unit=unit, axis_scale=axis_of(kind, unit))
    if way.startswith("hit.lvm") and kind == "rate":
        pytest.skip("this format states a step")
    check(read_signals(written(tmp_path, way, labels)), "accelerance")


@pytest.mark.parametrize(("kind", "unit"), AXES)
@pytest.mark.parametrize("way", WRITERS)
def test_a_rate_of_the_caller_that_contradicts_the_file_is_refused(tmp_path, way, kind, unit):
    if kind != "time" and way.startswith("hit.uff"):
        pytest.skip("these formats state times")
    _, labels = labels_with_units("N", "m/s^2", axis=kind, axis_unit=unit, axis_scale=axis_of(kind, unit))
    if way.startswith("hit.lvm") and kind == "rate":
        pytest.skip("this format states a step")
    path = written(tmp_path, way, labels)
    check(read_signals(path, rate=RATE), "accelerance")
    with pytest.raises(MeasurementError, match="the sampling rate is"):
        read_signals(path, rate=1000.0)


@pytest.mark.parametrize("unit", ["V", "Hz", "m", "xyz"])
@pytest.mark.parametrize("way", WRITERS)
def test_an_axis_that_is_not_a_time_is_refused(tmp_path, way, unit):
    _, labels = labels_with_units("N", "m/s^2", axis_unit=unit)
    with pytest.raises(MeasurementError):
        read_signals(written(tmp_path, way, labels))


OTHER_ENTRIES = [way for way in WRITERS if not way.startswith(("hit.lvm", "hit.uff")) and "suffix" not in way]


@pytest.mark.parametrize("key", ["gain", "calibration_factor", "scale", "sensitivity"])
@pytest.mark.parametrize("way", OTHER_ENTRIES)
def test_a_number_that_may_act_on_the_samples_is_refused(tmp_path, way, key):
    path = written(tmp_path, way, Labels(extra=((key, 10.0),)))
    with pytest.raises(MeasurementError, match="may act on the values"):
        read_signals(path)
    check(read_signals(path, names={"skip": key if "struct" not in way else f"Test {key}"}), "accelerance")


@pytest.mark.parametrize("extra", [("rate", 1000.0), ("fs_kHz", 1.0), ("dt", 0.001), ("sampling rate", "51.2 kHz")])
@pytest.mark.parametrize("way", OTHER_ENTRIES)
def test_a_rate_that_contradicts_the_times_is_refused(tmp_path, way, extra):
    key = extra[0].replace(" ", "_") if way.startswith(("hit.mat", "hit.npz")) else extra[0]
    with pytest.raises(MeasurementError, match=r"the sampling rate is|number"):
        read_signals(written(tmp_path, way, Labels(extra=((key, extra[1]),))))


SENSITIVITIES = [("100 mV/g", "V", 0.1 / 9.80665, "accelerance"), ("10.2 mV/(m/s^2)", "mV", 10.2, "accelerance"),
                 ("4 V/(m/s)", "", 4.0, "mobility"), ("20 um/V", "V", 1 / 2e-5, "receptance")]  # fmt: skip


@pytest.mark.parametrize(("text", "unit", "scale", "quantity"), SENSITIVITIES)
@pytest.mark.parametrize("way", [way for way in WRITERS if not way.startswith("hit.uff") or "type" in way])
def test_voltages_become_motions_by_the_sensitivity(tmp_path, way, text, unit, scale, quantity):
    volts = 1e3 if unit == "mV" else 1.0
    labels = Labels(unit, unit, WORDS[quantity], force_scale=1.0 / (2.25e-3 * volts), response_scale=1.0 / scale)
    path = written(tmp_path, way, labels)
    options = {"force_sensitivity": "2.25 mV/N", "response_sensitivity": text}
    check(read_signals(path, **options), quantity)
    with pytest.raises(MeasurementError):
        read_signals(path, **options, response_unit="m/s^2")


@pytest.mark.parametrize("way", WRITERS)
def test_a_sensitivity_of_numbers_that_are_not_voltages_is_refused(tmp_path, way):
    _, labels = labels_with_units("N", "g")
    path = written(tmp_path, way, labels)
    with pytest.raises(MeasurementError, match="sensitivity"):
        read_signals(path, response_sensitivity="100 mV/g")
    with pytest.raises(MeasurementError, match="sensitivity"):
        read_signals(path, force_sensitivity="2.25 mV/N")
