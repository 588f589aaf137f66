"""Tests of a series, files that a watch meets and measurements of joints have to be of the points of the others."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import dovetail

FREQUENCY = np.arange(20.0, 120.0, 2.0)
BLOCK, ARM = ("block", 0.0, "x"), ("arm", 0.0, "x")
USES = {"drive": (("1+x", "1+x"), (BLOCK, BLOCK)), "transfer": (("2+x", "1+x"), (ARM, BLOCK))}
OTHERS = {
    "drive": [("2+x", "2+x"), ("1+z", "1+z"), ("7", "7"), ("arm:1", "arm:1"), ("", "3+x"), ("2+x", ""), ("2+x", "1+x"),
              ("arm x", ""), ("", "base")],
    "transfer": [("3+x", "1+x"), ("2+x", "3+x"), ("2+z", "1+z"), ("1+x", "2+x"), ("2+x", "2+x"), ("1", ""),
                 ("block", "")],
}  # fmt: skip
CASES = [(use, dofs) for use, wrong in OTHERS.items() for dofs in wrong]
SOUND = [("1-x", "1-x"), ("1", "1"), ("", ""), ("block:1+x", "1+x")]


def description(use: str) -> dict:
    spring = {"model": "spring_damper", "direction": "x"}
    force = {"force": {"at": "block", "position": 0}} if use == "transfer" else {}
    return {
        "dovetail": 1,
        "name": "masses",
        "frequency": {"start": 20.0, "stop": 118.0, "step": 2.0},
        "substructures": {
            "block": {"model": "lumped", "masses": [{"mass": 1.0}]},
            "arm": {"model": "lumped", "masses": [{"mass": 0.5}]},
            "base": {"model": "ground"},
        },
        "joints": {
            "top": {
                **spring,
                "connect": {"a": {"to": "arm", "at": 0}, "b": {"to": "block", "at": 0}},
                "parameters": {"k": {"value": 1e5}, "c": {"value": 8.0}},
            },
            "foot": {
                **spring,
                "connect": {"a": {"to": "block", "at": 0}, "b": {"to": "base", "at": 0}},
                "parameters": {"k": {"range": [1e5, 1e6]}, "c": {"value": 20.0}},
            },
        },
        "response": {"at": "arm" if force else "block", "position": 0, "quantity": "receptance", **force},
    }


@pytest.fixture
def measured(tmp_path):
    """Write the description of a use, and measurements with the given DOFs, each of another stiffness."""

    def write(use, *dofs):
        (tmp_path / "masses.yaml").write_text(json.dumps(description(use)))
        assembly, (out, into) = dovetail.load(tmp_path / "masses.yaml"), USES[use][1]
        for number, (response, force) in enumerate(dofs):
            exact = assembly.receptance([3e5 + 2e4 * number], [out], [into])[:, 0, 0]
            noise = 1.0 + 1e-3 * np.random.default_rng(number).standard_normal(FREQUENCY.size)
            frf = dovetail.Frf(FREQUENCY, exact * noise, "receptance", response=response, force=force)
            dovetail.write_frf(frf, tmp_path / f"m{number}.csv")
        return tmp_path

    return write


def series(folder, count=2, **options):
    tests = {
        f"t{number}": {"measured": {"file": f"m{number}.csv", **options}, "at": {"load": number + 1.0}}
        for number in range(count)
    }
    role = {"foot.k": "varying" if count == 1 else {"law": "linear", "over": "load"}}
    path = folder / "series.yaml"
    content = {"dovetail_series": 1, "assembly": "masses.yaml", "covariates": {"load": "N"}, "tests": tests}
    path.write_text(json.dumps({**content, "parameters": role}))
    return path


COMMANDS = {
    "identify-series": ["--method", "refined"],
    "predict-series": ["--at", "load=1.5", "--samples", "20"],
    "compare-models": ["--roles", "foot.k=linear,free", "--samples", "20"],
}


@pytest.mark.sweep
@pytest.mark.parametrize(("use", "dofs"), CASES, ids=str)
@pytest.mark.parametrize("command", COMMANDS)
def test_tests_of_a_series_at_other_points_are_refused(run, measured, command, use, dofs):
    folder = measured(use, USES[use][0], dofs)
    done = run(command, series(folder), *COMMANDS[command], code=1)
    assert "m1.csv" in done.stderr
    assert "--ignore-dofs" in done.stderr or "ignore_dofs" in done.stderr


@pytest.mark.parametrize("dofs", SOUND, ids=str)
def test_tests_of_a_series_at_the_same_points_are_identified(run, measured, dofs):
    run("identify-series", series(measured("drive", USES["drive"][0], dofs)), "--method", "refined")


def test_wrong_dofs_of_a_series_can_be_ignored(run, measured):
    path = series(measured("drive", USES["drive"][0], ("2+x", "2+x")), ignore_dofs=True)
    run("identify-series", path, "--method", "refined")


def test_tests_of_parts_with_other_nodes_may_have_other_numbers(run, measured):
    folder = measured("drive", USES["drive"][0], ("7+x", "7+x"))
    other = description("drive")
    other["substructures"]["arm"]["masses"] = [{"mass": 0.5}, {"mass": 1e-6, "position": "5 mm"}]
    other["joints"]["tie"] = {"model": "rigid", "direction": "x", "connect": {
        "a": {"to": "arm", "at": "5 mm"}, "b": {"to": "block", "at": 0}}}  # fmt: skip
    (folder / "other.yaml").write_text(json.dumps(other))
    path = series(folder)
    content = json.loads(path.read_text())
    content["tests"]["t1"]["assembly"] = "other.yaml"
    path.write_text(json.dumps(content))
    run("identify-series", path, "--method", "refined")


@pytest.mark.sweep(keep=4)
@pytest.mark.parametrize(("use", "dofs"), CASES, ids=str)
def test_a_file_of_another_point_is_set_aside_by_a_watch(run, measured, use, dofs):
    folder = measured(use, USES[use][0], dofs, USES[use][0])
    (folder / "new").mkdir()
    for number in (1, 2):
        (folder / f"m{number}.csv").rename(folder / "new" / f"m{number}.csv")
    done = run("watch", series(folder, 1), folder / "new", "-o", folder / "out", "--once", "--settle", "0")
    assert done.stderr.count("Set aside") == 1
    assert "Set aside: m1.csv" in done.stderr


def cases(folder, **joints):
    content = {
        name: {
            "assembly": "known.yaml",
            "measured": {"file": "known.csv"},
            "joint": {"assembly": "masses.yaml", "measured": {"file": file}},
        }
        for name, file in joints.items()
    }
    (folder / "cases.yaml").write_text(json.dumps({"dovetail_series": 1, "name": "cases", "tests": content}))
    return folder / "cases.yaml"


@pytest.mark.sweep(keep=4)
@pytest.mark.parametrize(("use", "dofs"), CASES, ids=str)
def test_joints_of_cases_from_measurements_at_other_points_are_refused(run, measured, use, dofs):
    folder = measured(use, USES[use][0], dofs)
    (folder / "known.yaml").write_text(json.dumps({"extends": "masses.yaml", "name": "known"}))
    known = replace(dovetail.read_frf(folder / "m0.csv"), response="", force="")
    dovetail.write_frf(known, folder / "known.csv")
    done = run("validate", cases(folder, one="m0.csv", two="m1.csv"), code=1)
    assert "m1.csv" in done.stderr
