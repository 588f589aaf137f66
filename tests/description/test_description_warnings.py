"""Suspicious values in a valid description: each is reported with what was read and what was probably meant."""

from __future__ import annotations

from pathlib import Path

import pytest

import dovetail

ASSEMBLIES = Path(__file__).resolve().parents[2] / "assemblies"
SHIPPED = sorted(
    file for folder in (ASSEMBLIES, ASSEMBLIES / "campaign") for file in folder.glob("*.yaml") if file.is_file()
)


def bar(**changes) -> dovetail.Assembly:
    """A steel bar of 200 mm on a spring to ground, sound but for the changes."""
    material = {"young": "206 GPa", "density": "7850 kg/m^3", **changes.pop("material", {})}
    section = {"length": "200 mm", "outer": "20 mm", "elements": 10, **changes.pop("section", {})}
    k = {"range": ["1e6 N/m", "1e8 N/m"], "scale": "log", **changes.pop("k", {})}
    return dovetail.load(
        {
            "dovetail": 1,
            "name": "bar",
            "frequency": {"start": 20.0, "stop": 5000.0, "lines": 100, **changes.pop("frequency", {})},
            "substructures": {
                "bar": {"model": "timoshenko_beam", "material": material, "sections": [section]},
                "base": {"model": "ground"},
            },
            "joints": {
                "spring": {
                    "model": "spring_damper",
                    "nodes": 1,
                    "direction": "both",
                    "connect": {"a": {"to": "bar", "at": ["n1"]}, "b": {"to": "base", "at": ["g1"]}},
                    "parameters": {"k": k, "c": {"value": 10.0}, "kr": {"value": 1e5}, "cr": {"value": 0.1}},
                }
            },
            "response": {"at": "bar", "position": section["length"], "quantity": "accelerance"},
        }
    )


def test_a_sound_description_has_none():
    assert dovetail.find_warnings(bar()) == ()


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: str(file.relative_to(ASSEMBLIES)))
def test_no_shipped_description_has_any(file):
    assert dovetail.find_warnings(dovetail.load(file)) == ()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"material": {"young": "206 MPa"}, "frequency": {"start": 1.0, "stop": 200.0}},
            ["substructures.bar: material.young is 206 MPa", "nothing of 7850 kg/m^3 is as soft", "Was 206 GPa meant?"],
        ),
        (
            {"material": {"young": 580.0}, "frequency": {"start": 0.01, "stop": 1.0}},
            ["substructures.bar.material.young: 580 Pa is not within", "Was 580 GPa or 580 MPa meant?"],
        ),
        (
            {"material": {"density": 7.85}},
            ["substructures.bar.material.density: 7.85 kg/m^3 is not", "Was 7.85 g/cm^3 meant?"],
        ),
        (
            {"section": {"length": 90.0}},
            ["substructures.bar.sections.0.length: 90 m is not within 1e-06 to 20 m.", "Was 90 mm meant?"],
        ),
        (
            {"frequency": {"start": 1.0, "stop": 20.0}},
            ["the band, 1 to 20 Hz, lies below all natural frequencies"],
        ),
        (
            {"frequency": {"start": 5e7, "stop": 6e7}},
            ["lies far above all natural frequencies", "Frequencies are in Hz"],
        ),
        (
            {"section": {"elements": 1}},
            ["substructures.bar: sections.0 has elements of 200 mm", "a bending wave at 5000 Hz is", "or more."],
        ),
        (
            {"k": {"range": ["1e5 N/m", "1e8 N/m"], "scale": "linear"}},
            ["k: on a linear scale nine tenths of the range", "Was 'scale: log' meant?"],
        ),
        (
            {
                "material": {"young": 206000.0, "density": 7.85e-9},
                "section": {"length": 200.0, "outer": 20.0},
            },
            ["Was 206000 MPa meant?", "Was 7.85e-09 t/mm^3 meant?", "Was 200 mm meant?"],
        ),
    ],
    ids=["soft steel", "modulus", "density", "length", "below", "above", "elements", "range", "mm, N, t"],
)
def test_a_fault_is_named_with_what_was_probably_meant(changes, said):
    text = "\n".join(dovetail.find_warnings(bar(**changes)))
    assert all(words in text for words in said), text


def test_a_band_is_reported_as_soon_as_it_ends_below_the_first_natural_frequency():
    softest = bar().natural_frequencies({"k": 1e6}, count=1)[0]
    assert dovetail.find_warnings(bar(frequency={"start": 1.0, "stop": 1.01 * softest})) == ()
    (warning,) = dovetail.find_warnings(bar(frequency={"start": 1.0, "stop": 0.99 * softest}))
    assert f"lies below all natural frequencies that the ranges allow; the nearest is {softest:.4g} Hz." in warning


def test_the_number_of_elements_that_is_advised_suffices():
    import re

    (warning,) = dovetail.find_warnings(bar(section={"elements": 1}))
    advised = int(re.search(r"Take (\d+) elements", warning)[1])
    assert dovetail.find_warnings(bar(section={"elements": advised})) == ()
    assert dovetail.find_warnings(bar(section={"elements": advised - 1})) != ()


def test_a_range_from_zero_gives_no_warning_about_decades():
    assert dovetail.find_warnings(bar(k={"range": [0.0, "1e8 N/m"], "scale": "linear"})) == ()
