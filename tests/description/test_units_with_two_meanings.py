"""Units with two meanings, and numbers with marks of thousands: refused with what to write."""

from __future__ import annotations

from pathlib import Path

import pint
import pytest

from dovetail import load, units
from dovetail.errors import DovetailError, UnitError
from dovetail.units import find_homonym, is_unit, to_si

TWO_MEANINGS = [
    ("ton", "kg"), ("tons", "kg"), ("kton", "kg"), ("mt", "kg"), ("gr", "kg"), ("cwt", "kg"), ("quarter", "kg"),
    ("dr", "kg"), ("dwt", "kg"), ("ton_force", "N"), ("hp", "W"), ("khp", "W"), ("grad", "rad"), ("grade", "rad"),
    ("gal", "m/s^2"), ("gallon", "m^3"), ("pint", "m^3"), ("pt", "m"), ("point", "m"), ("cal", "J"), ("kcal", "J"),
    ("Btu", "J"), ("a", "s"), ("month", "s"), ("c", "m/s"), ("u", "kg"), ("N/ton", "m/s^2"), ("ton/m^3", "kg/m^3"),
]  # fmt: skip


@pytest.mark.parametrize(("unit", "target"), TWO_MEANINGS)
def test_a_unit_with_two_meanings_is_refused_with_what_to_write(unit: str, target: str) -> None:
    with pytest.raises(UnitError, match="has more than one meaning: write '"):
        to_si(f"2 {unit}", target)


ONE_MEANING = [
    ("t", "kg", 1000.0), ("tonne", "kg", 1000.0), ("short_ton", "kg", 907.18474), ("long_ton", "kg", 1016.0469088),
    ("lb", "kg", 0.45359237), ("oz", "kg", 0.028349523125), ("grain", "kg", 6.479891e-05), ("slug", "kg", 14.593902937),
    ("lbf", "N", 4.4482216152605), ("kip", "N", 4448.2216152605), ("kgf", "N", 9.80665), ("mil", "m", 2.54e-05),
    ("mils", "m", 2.54e-05), ("thou", "m", 2.54e-05), ("in", "m", 0.0254), ("ips", "m/s", 0.0254),
    ("deg", "rad", 0.0174533),
    ("gon", "rad", 0.0157080), ("Gal", "m/s^2", 0.01), ("cc", "m^3", 1e-6), ("psi", "Pa", 6894.757293168),
    ("mil/lbf", "m/N", 2.54e-5 / 4.4482216152605), ("metric_horsepower", "W", 735.49875), ("min", "s", 60.0),
    ("h", "s", 3600.0), ("Mg", "kg", 1000.0), ("um", "m", 1e-6), ("micron", "m", 1e-6), ("rpm", "Hz", 1 / 60),
    ("1/s", "1/s", 1.0),
]  # fmt: skip


@pytest.mark.parametrize(("unit", "target", "factor"), ONE_MEANING)
def test_a_unit_with_one_meaning_in_mechanics_is_read(unit: str, target: str, factor: float) -> None:
    assert to_si(f"1 {unit}", target) == pytest.approx(factor, rel=1e-5)


@pytest.mark.parametrize("unit", ["1", "N/m", "1/s", "N m s/rad"])
def test_a_parameter_may_be_declared_in_a_unit_or_as_a_pure_number(unit: str) -> None:
    assert is_unit(unit)


def test_every_short_name_of_a_mass_or_a_force_is_unique_or_refused() -> None:
    """Of pint's names of one letter to three for masses, forces, lengths and powers, none has a second meaning."""
    registry = pint.UnitRegistry(cache_folder=None)
    wanted = {registry.Unit(unit).dimensionality for unit in ("kg", "N", "m", "W")}
    names = {name for name in registry._units if len(name) <= 3 and name.isascii()}
    read = {name for name in names if registry.Unit(name).dimensionality in wanted and not find_homonym(name)}
    known = "kg g lb oz t Da amu ct m_e m_u m_n m_p ozt toz lbt tlb bag N kgf gf lbf ozf tf kip dyn pdl"
    known += " m in ft yd mi nmi um th sft smi li rd rod fm bp pp px didot au ly pc a0 fur W lx mil VA dBm dBu dBW slm"
    assert read <= set(known.split()) | {"a_0", "r_e", "Å"}, sorted(read - set(known.split()))


MARKS = ["10,000", "10_000", "10 000", "1.000,5", "1,000.5", "1 000.5", "10'000", "1.000.000", "10\u202f000"]


@pytest.mark.parametrize("unit", ["", " N/m"])
@pytest.mark.parametrize("number", MARKS)
def test_a_number_with_marks_of_thousands_is_refused(number: str, unit: str) -> None:
    with pytest.raises(UnitError, match="Write numbers without marks of thousands"):
        to_si(number + unit, "N/m")


@pytest.mark.parametrize(("number", "written"), [("10_000", "10000"), ('"10 000"', "10000"), ('"1.000,5"', "1000.5")])
@pytest.mark.parametrize("key", ["samples", "reducer: {model: pca, n_components"])
def test_a_count_with_marks_of_thousands_is_refused(tmp_path: Path, key: str, number: str, written: str) -> None:
    described = Path("assemblies/oscillator.yaml").read_text(encoding="utf-8")
    closing = "}" if "{" in key else ""
    (tmp_path / "a.yaml").write_text(f"{described}\nidentification: {{{key}: {number}{closing}}}\n", encoding="utf-8")
    with pytest.raises(DovetailError, match=f"has marks of thousands: write {written}"):
        load(tmp_path / "a.yaml")


@pytest.mark.parametrize("unit", ["lb/in", "lbs/in", "kg/mm", "oz/in"])
def test_a_mass_in_place_of_a_force_is_refused_with_the_unit_of_the_force(unit: str) -> None:
    with pytest.raises(UnitError, match="is a mass; a force is written"):
        to_si(f"10 {unit}", "N/m")


@pytest.mark.parametrize("unit", sorted(units._PLAIN))
def test_a_unit_that_is_known_without_pint_is_one_of_pint(unit: str) -> None:
    assert units._factor_by_pint(unit, unit, unit) == 1.0
    assert units._factor_by_pint(unit, unit, f"1 {unit}") == 1.0


@pytest.mark.parametrize(("unit", "target"), sorted(units._COMMON))
def test_a_factor_that_is_known_without_pint_is_exactly_that_of_pint(unit: str, target: str) -> None:
    assert to_si(f"1 {unit}", target) == units._factor_by_pint(unit, target, f"1 {unit}")
