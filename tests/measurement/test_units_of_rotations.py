"""A file whose unit is that of another kind of FRF than it is used as, such as a displacement for a rotation."""

from __future__ import annotations

import numpy as np
import pytest

import dovetail
from dovetail.identification import measured_lines

KINDS = {
    "displacement per force": ("x", "x"),
    "rotation per force": ("rz", "x"),
    "displacement per moment": ("x", "rz"),
    "rotation per moment": ("rz", "rz"),
}
UNITS = {
    "m/(N s^2)": "displacement per force",
    "g/N": "displacement per force",
    "rad/(N s^2)": "rotation per force",
    "m/(N m s^2)": "displacement per moment",
    "rad/(N m s^2)": "rotation per moment",
}


def described(kind):
    response, force = KINDS[kind]
    section = {"length": 0.2, "outer": 0.02, "elements": 4}
    beam = {"model": "timoshenko_beam", "material": {"young": 2e11, "density": 7850.0}, "sections": [section]}
    whole = {
        "dovetail": 1,
        "name": "beam",
        "frequency": {"start": 100.0, "stop": 1000.0, "lines": 30},
        "substructures": {"beam": beam},
        "joints": {},
        "response": {"at": "beam", "position": 0.0, "direction": response},
    }
    whole["response"]["force"] = {"position": 0.2, "direction": force}
    return dovetail.load(whole)


def written(folder, unit):
    lines = [f"{f},{np.sin(f)},{np.cos(f)}" for f in np.linspace(100.0, 1000.0, 30)]
    file = folder / "frf.csv"
    head = [f"# unit: {unit}"] if unit else ["# quantity: accelerance"]
    file.write_text("\n".join([*head, "frequency_Hz,real,imag", *lines]))
    return dovetail.read_frf(file)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("unit", UNITS)
def test_a_file_is_used_as_the_kind_that_its_unit_says(tmp_path, unit, kind):
    frf, description = written(tmp_path, unit), described(kind).description
    if kind == UNITS[unit]:
        measured_lines.check_measured(description, frf)
        return
    with pytest.raises(dovetail.MeasurementError) as caught:
        measured_lines.check_measured(description, frf)
    assert f"is that of a {UNITS[unit]}, and the response is a {kind}." in str(caught.value)


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_without_a_unit_is_of_any_kind(tmp_path, kind):
    frf = written(tmp_path, "")
    assert not frf.has_unit
    measured_lines.check_measured(described(kind).description, frf)
