"""Numbers and units as they are written for readers."""

from __future__ import annotations

import math

import pytest

from dovetail.plain_text import display_unit, fixed, number, readable, unit_text

MINUS, TIMES, DASH = "\N{MINUS SIGN}", "\N{MULTIPLICATION SIGN}", "\N{EN DASH}"


@pytest.mark.parametrize(
    ("unit", "shown"),
    [("m/(N s^2)", "m/(N·s²)"), ("N m s/rad", "N·m·s/rad"), ("1", ""), ("kg*m**2", "kg·m²"), ("Hz^-1", "Hz⁻¹")],
)
def test_units_are_typeset(unit: str, shown: str) -> None:
    assert unit_text(unit) == shown


@pytest.mark.parametrize(
    ("unit", "lower", "upper", "factor", "shown"),
    [
        ("m", 26e-3, 40e-3, 1e3, "mm"),
        ("kg", 0.02, 0.2, 1e3, "g"),
        ("kg", 2.0, 20.0, 1.0, "kg"),
        ("N/m", 1e8, 2e9, 1e-6, "MN/m"),
        ("N/m", 3e8, 5e9, 1e-9, "GN/m"),
        ("N m/rad", 2e3, 6e4, 1e-3, "kN·m/rad"),
        ("N s/m", 10.0, 1e3, 1.0, "N·s/m"),
        ("N m s/rad", 0.01, 5.0, 1.0, "N·m·s/rad"),
        ("N^2", 1e6, 1e8, 1.0, "N²"),
        ("1", -1e6, 1e6, 1.0, ""),
    ],
)
def test_values_get_the_unit_that_is_easiest_to_read(
    unit: str, lower: float, upper: float, factor: float, shown: str
) -> None:
    chosen = display_unit(unit, lower, upper)
    assert chosen.factor == pytest.approx(factor)
    assert chosen.text == shown


@pytest.mark.parametrize(
    ("value", "padded", "text"),
    [
        (35.18, True, "35.18"),
        (400.0, True, "400.0"),
        (400.0, False, "400"),
        (2000.0, True, "2000"),
        (12345.6, True, "12346"),
        (1.2e-7, True, f"1.200 {TIMES} 10⁻⁷"),
        (-7.3e8, False, f"{MINUS}7.3 {TIMES} 10⁸"),
        (0.0, True, "0.000"),
        (math.nan, True, DASH),
        (None, True, DASH),
        (math.inf, True, DASH),
    ],
)
def test_numbers_are_written_with_significant_digits(value: float | None, padded: bool, text: str) -> None:
    assert number(value, padded=padded) == text


def test_numbers_are_written_with_decimals() -> None:
    assert fixed(1352.04, 1) == "1352.0"
    assert fixed(-1.056, 2, signed=True) == f"{MINUS}1.06"
    assert fixed(0.8, 2, signed=True) == "+0.80"
    assert fixed(None, 1) == fixed(math.nan, 1) == DASH


def test_powers_of_ten_in_a_sentence_are_set() -> None:
    assert readable("kt = 5.62e+09 N/m, not 3e-08 N/m") == f"kt = 5.62 {TIMES} 10⁹ N/m, not 3 {TIMES} 10⁻⁸ N/m"
    assert readable("the file 1e5.csv, model e+10") == "the file 1e5.csv, model e+10"
