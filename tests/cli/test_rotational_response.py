"""A rotational drive point, excited by a moment: its FRF is labelled so, and no accelerometer mass is removed."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import dovetail
from dovetail.errors import MeasurementError
from dovetail.measurement.accelerometer import remove_accelerometer_mass
from dovetail.report.figures import simulated_figure

TURNED = """\
dovetail: 1
name: turned
frequency: {start: 1 Hz, stop: 600 Hz, step: 1 Hz}
substructures:
  wheel: {model: lumped, masses: [{mass: 1 kg, inertia: 0.1 kg m^2}]}
  base: {model: ground}
joints:
  mount:
    model: spring_damper
    direction: rz
    connect: {a: {to: wheel, at: 0}, b: {to: base, at: 0}}
    parameters: {kr: {range: [1e4, 1e6]}, cr: {range: [1, 100]}}
response: {at: wheel, position: 0, direction: rz}
identification:
  samples: 60
  reducer: {model: none}
  regressor: {model: mlp, hidden: [4, 4], max_epochs: 2}
"""


@pytest.fixture
def turned(tmp_path):
    file = tmp_path / "turned.yaml"
    file.write_text(TURNED)
    return file


def test_an_frf_of_a_rotation_has_its_unit(turned):
    assembly = dovetail.load(turned)
    frf = dovetail.Frf(assembly.frequency, assembly.frf(), "accelerance", rotation=True)
    assert (frf.unit, frf.to("receptance").unit) == ("rad/(N m s^2)", "rad/(N m)")
    assert replace(frf, rotation=False).unit == "m/(N s^2)"
    assert simulated_figure(frf).axes[0].get_ylabel() == "Accelerance [rad/(N·m·s²)]"


def test_a_rotation_is_simulated_and_identified(turned, tmp_path):
    model = dovetail.train(dovetail.load(turned))
    measured = dovetail.Frf(model.assembly.frequency, model.assembly.frf([1e5, 10.0]), "accelerance")
    result = model.identify(measured, "network")
    assert result.frf.rotation
    assert result.measured.rotation
    (tmp_path / "result.json").write_text(json.dumps(result.to_dict()))
    stored = dovetail.load_result(tmp_path)
    assert (stored.frf.unit, stored.measured.unit) == ("rad/(N m s^2)", "rad/(N m s^2)")
    assert dovetail.predict(model.assembly, {"kr": 1e5, "cr": 10.0}).rotation


def test_simulate_labels_its_figure(run, turned, tmp_path, monkeypatch):
    drawn = []

    def save(figure, path):
        drawn.append(figure)
        path.write_bytes(b"a figure")

    monkeypatch.setattr("dovetail.report.figures.save_png", save)
    run("simulate", turned, "-o", tmp_path / "frf.png")
    assert drawn[0].axes[0].get_ylabel() == "Accelerance [rad/(N·m·s²)]"


def test_no_accelerometer_mass_is_removed_from_a_rotation(run, turned, tmp_path):
    assembly = dovetail.load(turned)
    frf = dovetail.Frf(assembly.frequency, assembly.frf(), "accelerance", label="turned.csv")
    dovetail.write_frf(frf, tmp_path / "turned.csv")
    done = run(
        "identify", turned, tmp_path / "turned.csv", "--method", "network", "--accelerometer-mass", "1 g", code=1
    )
    assert done.stderr.split("\n", 1)[1] == (
        "--accelerometer-mass\n"
        "  the response of 'turned' is a rotation per moment, from which no mass can be removed.\n"
        "  Leave it out.\n"
    )
    with pytest.raises(MeasurementError, match="this is a rotation per moment"):
        remove_accelerometer_mass(replace(frf, rotation=True), 0.001)
    assert np.array_equal(remove_accelerometer_mass(replace(frf, rotation=True), 0.0).values, frf.values)


CROSSED = TURNED.replace("direction: rz\n    connect", "nodes: 1\n    direction: both\n    connect").replace(
    "parameters: {kr", "parameters: {k: 1 MN/m, c: 1 N s/m, kr"
)


@pytest.mark.parametrize(
    ("response", "unit", "other"),
    [
        ("direction: rz, force: {at: wheel, position: 0, direction: x}", "rad/(N s^2)", "a displacement per moment"),
        ("direction: x, force: {at: wheel, position: 0, direction: rz}", "m/(N m s^2)", "a rotation per force"),
    ],
)
def test_an_frf_that_is_half_a_rotation_has_its_own_unit(turned, response, unit, other):
    turned.write_text(CROSSED.replace("direction: rz}\nidentification", f"{response}}}\nidentification"))
    assembly = dovetail.load(turned)
    frf = assembly.simulate({"kr": 1e5, "cr": 10.0})
    assert (frf.unit, dovetail.predict(assembly, {"kr": 1e5, "cr": 10.0}).unit) == (unit, unit)
    wrong = replace(frf, values=frf.values + 1.0, rotation=not frf.rotation, moment=not frf.moment)
    with pytest.raises(MeasurementError, match=f"is that of {other}, and the response is a {frf.kind}"):
        dovetail.identify(assembly, wrong)
