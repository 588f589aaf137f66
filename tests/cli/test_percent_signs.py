"""Levels of noise: a fraction, or a number with a percent sign; what may mean either is asked for."""

from __future__ import annotations

import json

import pytest

import dovetail
from dovetail.errors import DescriptionError, UnitError
from dovetail.units import to_fraction

COMMANDS = {
    "simulate": ["--noise"],
    "plan": ["--noise"],
    "calibrate": ["--noise", "--model-error"],
    "robustness": ["--levels"],
    "identify": ["--model-error"],
}


@pytest.mark.parametrize("text", ["1", "2", "0.6", "5", "1e3", " 1 "])
@pytest.mark.parametrize(("command", "option"), [(name, option) for name in COMMANDS for option in COMMANDS[name]])
def test_a_fraction_that_may_be_a_percentage_needs_the_percent_sign(run, assemblies, command, option, text):
    measured = [assemblies / "measurements" / "hammer_test.uff"] if command == "identify" else []
    value = f"0,{text}" if command == "robustness" else text
    message = " ".join(run(command, assemblies / "sdof.yaml", *measured, option, value, code=2).stderr.split())
    assert f"'{text.strip()}' may mean {float(text):.6g} % or {100 * float(text):.6g} %." in message
    assert "Write it with a percent sign." in message


@pytest.mark.parametrize(
    ("value", "number"),
    [("1%", 0.01), ("100 %", 1.0), ("0.01", 0.01), ("0.5", 0.5), (0.2, 0.2), ("0", 0.0), ("250%", 2.5), (" 2% ", 0.02)],
)
def test_unambiguous_fractions_are_accepted(value, number):
    assert to_fraction(value) == pytest.approx(number)


@pytest.mark.parametrize(
    "value", ["much", "%", "", "1%%", "-1%", "nan", "inf", "1e999", True, None, [], 10**400, 1, 0.51]
)
def test_a_text_that_is_not_a_fraction_is_refused(value):
    with pytest.raises(UnitError):
        to_fraction(value)


@pytest.mark.parametrize("key", ["additive", "multiplicative", "gain"])
def test_the_augmentation_of_a_description_asks_too(sdof, key):
    described = json.loads(sdof.description.text)

    def with_level(level):
        described["identification"]["augmentation"] = {key: level}
        return dovetail.load(described).description.identification.augmentation

    assert getattr(with_level("20%"), key) == pytest.approx(0.2)
    assert getattr(with_level(0.5), key) == 0.5
    assert getattr(with_level("100%"), key) == 1.0
    with pytest.raises(DescriptionError, match=rf"augmentation.{key}\n.*'1' may mean 1 % or 100 %"):
        with_level(1)
