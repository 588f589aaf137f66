"""`dovetail new-assembly`: its description passes `check` unchanged, with every joint that connects two parts."""

from __future__ import annotations

import importlib
import sys

import pytest
import yaml

import dovetail
from dovetail.description.new_description import two_sided_joints
from dovetail.registry import components

MODULE = importlib.import_module("dovetail.cli.new_assembly")

JOINTS = sorted(two_sided_joints(components(())))


def test_every_shipped_joint_has_two_sides():
    assert set(JOINTS) >= {"bearing", "bolted", "collet", "interference_fit", "rigid", "spring_damper"}


@pytest.mark.sweep(keep=4)
@pytest.mark.parametrize("joint", JOINTS)
def test_the_written_description_passes_check_and_lists_all_parameters(run, tmp_path, joint):
    file = tmp_path / f"{joint}.yaml"
    run("new-assembly", file, "--joint", joint)
    assert "What looks wrong" not in run("check", file).stdout
    assembly = dovetail.load(file)
    model = assembly.description.joints["joint"].connection.model
    text = file.read_text()
    for parameter in model.parameters:
        (line,) = [line for line in text.splitlines() if line.strip().startswith(f"{parameter.name}: {{range")]
        assert parameter.description in " ".join(line.split("#")[1].split())
    assert [(p.lower, p.upper, p.scale) for p in assembly.parameters] == [
        (p.lower, p.upper, p.scale) for p in model.parameters
    ]


@pytest.mark.parametrize("words", [(), *(("--joint", joint) for joint in JOINTS)], ids=["default", *JOINTS])
def test_every_joint_that_is_offered_gives_a_description_that_loads(run, tmp_path, words):
    run("new-assembly", tmp_path / "new.yaml", *words)
    dovetail.load(tmp_path / "new.yaml")


def test_options_determine_the_parts(run, tmp_path):
    file = tmp_path / "tool.yaml"
    parts = ["--part", "tool: 100 mm x 10 mm of carbide", "--part", "holder: 80 mm x 4 cm x 10 mm of steel"]
    run(
        "new-assembly",
        file,
        "--joint",
        "collet",
        *parts,
        "--band",
        "200 Hz to 8 kHz",
        "--response",
        "7 mm",
        "--quantity",
        "mobility",
    )
    written = yaml.safe_load(file.read_text())
    assert written["substructures"]["tool"]["material"]["young"] == "580 GPa"
    assert written["joints"]["joint"]["connect"]["tool"] == {"to": "tool", "at": ["80 mm", "90 mm", "100 mm"]}
    assembly = dovetail.load(file)
    assert (assembly.frequency[0], assembly.frequency[-1]) == (200.0, 8000.0)
    assert assembly.description.response_labels == ("tool, 7 mm",)
    assert assembly.description.response.quantity == "mobility"
    assert assembly.description.substructures["holder"].outline[0] == pytest.approx((0.0, 0.01, 0.04, 0.01))


def test_it_asks_on_a_terminal(monkeypatch, tmp_path):
    asked = []

    def answer(question, example):
        asked.append(question)
        return "bolted" if question.startswith("Joint") else example

    monkeypatch.setattr(sys, "stdin", type("Terminal", (), {"isatty": staticmethod(lambda: True)}))
    monkeypatch.setattr(MODULE.typer, "prompt", answer)
    MODULE.new_assembly(tmp_path / "asked.yaml", band="50 Hz to 2 kHz")
    assert [question.split(" ")[0] for question in asked] == ["Joint", "First", "Second", "Measured", "Quantity"]
    assert "model: bolted" in (tmp_path / "asked.yaml").read_text()


def test_a_file_that_is_there_stays(run, tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("mine")
    assert "a file of this name already exists.\n  Choose another name.\n" in run("new-assembly", file, code=1).stderr
    assert file.read_text() == "mine"


@pytest.mark.parametrize(
    ("options", "code", "said"),
    [
        (["--joint", "strut"], 1, "'strut' does not connect two parts end to end. Accepted: spring_damper"),
        (["--joint", "colet"], 1, "'colet' is not a joint model."),
        (["--part", "a: 100 mm x 10 mm of steel"], 2, "give --part twice"),
        (["--part", "a: 100 mm by 10", "--part", "b: 100 mm x 10 mm of steel"], 2, "'a: 100 mm by 10' is not such as"),
        (["--part", "a: 9 mm x 20 mm x 30 mm of steel", "--part", "b: 1 m x 10 mm of steel"], 2, "the bore smaller"),
        (["--part", "a: 9 kg x 20 mm of steel", "--part", "b: 1 m x 10 mm of steel"], 2, "9 kg"),
        (
            ["--joint", "collet", "--part", "a: 15 mm x 20 mm of steel", "--part", "b: 1 m x 10 mm of steel"],
            2,
            "'a' is not longer than the contact, 20 mm",
        ),
        (["--band", "all"], 2, "'all' is not such as '100 Hz to 5 kHz'"),
        (["--quantity", "inertance"], 1, "accelerance"),
        (["--response", "1 m"], 2, "'shaft' is from 0 to 160 mm."),
    ],
)
def test_a_wrong_option_is_one_error_and_leaves_no_file(run, tmp_path, options, code, said):
    result = run("new-assembly", tmp_path / "new.yaml", *options, code=code)
    assert said in " ".join(result.output.replace("│", " ").split())
    assert not list(tmp_path.glob("*.yaml"))
