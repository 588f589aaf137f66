"""Every command that reads a description prints, once, what looks wrong in it."""

from __future__ import annotations

import json

import numpy as np
import pytest

import dovetail
from dovetail.measurement import noisy_frf

STEEL = {"young": "200 GPa", "density": "7850 kg/m^3"}
TURNED = "This looks wrong: joints.weld: 'left' and 'right' extend from it to the same side"
FREQUENCY = np.arange(100.0, 900.0, 20.0)


def bar(*lengths):
    sections = [{"length": f"{length} mm", "outer": "20 mm", "elements": 4} for length in lengths]
    return {"model": "timoshenko_beam", "material": STEEL, "sections": sections}


def turned(at="200 mm"):
    """Two bars welded at one node, the second of which is described from its other end."""
    return {
        "dovetail": 1,
        "name": "turned",
        "frequency": {"start": 100.0, "stop": 880.0, "step": 20.0},
        "substructures": {"left": bar(200), "right": bar(60, 140), "base": {"model": "ground"}},
        "joints": {
            "weld": {
                "model": "spring_damper",
                "connect": {"a": {"to": "left", "at": "200 mm"}, "b": {"to": "right", "at": at}},
                "parameters": {
                    "k": {"range": [1e6, 1e7]}, "c": {"value": 10.0}, "kr": {"value": 1e4}, "cr": {"value": 1.0},
                },
            },
            "foot": {"model": "rigid", "connect": {"a": {"to": "left", "at": 0}, "b": {"to": "base", "at": 0}}},
        },
        "response": {"at": "left", "position": "100 mm"},
        "identification": {"samples": 40, "reducer": {"model": "none"}, "augmentation": {"additive": 0.1},
                           "regressor": {"model": "mlp", "hidden": [8], "max_epochs": 2}},
    }  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The description, its own measurement, a series, cases and a result."""
    folder = tmp_path_factory.mktemp("turned")
    (folder / "turned.yaml").write_text(json.dumps(turned()))
    (folder / "sound.yaml").write_text(json.dumps(turned("0 mm")))
    for name in ("turned", "sound"):
        assembly = dovetail.load(folder / f"{name}.yaml")
        for number in range(2):
            frf = noisy_frf(assembly.simulate([3e6 + 1e6 * number]), 0.01, number)
            dovetail.write_frf(frf, folder / f"{name}{number}.csv")
    tests = {f"t{number}": {"measured": f"turned{number}.csv", "at": {"load": number + 1.0}} for number in range(2)}
    series = {"dovetail_series": 1, "assembly": "turned.yaml", "covariates": {"load": "N"}, "tests": tests}
    (folder / "series.yaml").write_text(json.dumps({**series, "parameters": {"k": "varying"}}))
    source = {"assembly": "turned.yaml", "measured": {"file": "turned0.csv"}}
    (folder / "cases.yaml").write_text(
        json.dumps({"dovetail_series": 1, "name": "cases", "tests": {"one": {**source, "joint": source}}})
    )
    (folder / "arrived").mkdir()
    (folder / "arrived" / "new.csv").write_bytes((folder / "turned1.csv").read_bytes())
    return folder


COMMANDS = {
    "check": ["turned.yaml"],
    "simulate": ["turned.yaml"],
    "plan": ["turned.yaml"],
    "generate": ["turned.yaml", "--samples", "20", "-o", "data.zarr"],
    "identify": ["turned.yaml", "turned0.csv", "--method", "refined"],
    "identify a batch": ["turned.yaml", "turned0.csv", "turned1.csv", "--method", "refined"],
    "identify-series": ["series.yaml", "--method", "refined"],
    "predict": ["turned.yaml", "result"],
    "predict-series": ["series.yaml", "--at", "load=1", "--samples", "20"],
    "predict-series of an assembly": ["series.yaml", "--assembly", "turned.yaml", "--at", "load=1", "--samples", "20"],
    "compare-models": ["turned.yaml", "turned0.csv", "--against", "sound.yaml", "--samples", "20"],
    "compare-models of a series": ["series.yaml", "--roles", "k=shared,free", "--samples", "20"],
    "watch": ["series.yaml", "arrived", "-o", "watched", "--once", "--settle", "0"],
    "compare": ["cases.yaml", "--methods", "refined"],
    "validate": ["cases.yaml"],
    "calibrate": ["turned.yaml", "--cases", "1", "--samples", "20", "-o", "calibrated"],
    "spindle": ["turned.yaml", "turned0.csv", "turned1.csv", "sound0.csv", "--at", "100 mm", "--flange", "200 mm",
                "-o", "flange.npz"],
}  # fmt: skip


@pytest.fixture(scope="module")
def result(folder, run):
    run("identify", folder / "sound.yaml", folder / "sound0.csv", "--method", "refined", "-o", folder / "result")


@pytest.mark.sweep(keep=7)
@pytest.mark.usefixtures("result")
@pytest.mark.parametrize("command", COMMANDS)
def test_a_part_that_is_described_from_its_other_end_is_reported_once(run, folder, monkeypatch, command):
    monkeypatch.chdir(folder)
    code = 1 if command == "spindle" else 0  # its drive points are not those of a passive structure
    done = run(command.split()[0], *COMMANDS[command], code=code)
    printed = " ".join((done.stdout if command == "check" else done.stderr).split())
    assert (done.stdout + done.stderr).count(TURNED.removeprefix("This looks wrong: ")) == 1, done.stderr
    assert TURNED.removeprefix("This looks wrong: ") in printed


def test_nothing_is_reported_of_a_sound_description(run, folder):
    assert "looks wrong" not in run("simulate", folder / "sound.yaml").stderr
