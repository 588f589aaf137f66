from __future__ import annotations

import json

import numpy as np
import pytest


def test_check_shows_what_the_reference_assembly_is_made_of(run, assemblies):
    lines = run("check", assemblies / "bt40_er32.yaml").stdout.splitlines()
    rows = [line.split() for line in lines]
    assert ["substructure", "tool", "timoshenko_beam", "22"] in rows
    assert ["substructure", "holder", "timoshenko_beam", "38"] in rows
    assert ["joint", "collet,", "internal", "collet", "10"] in rows
    assert "assembly, merged DOFs counted once                       70" in lines
    assert "condensed system of the engine                           23" in lines
    assert "tool           0 to 100 by 10" in lines
    assert "holder         0, 10, 20, 31, 42, 53, 62, 71, 80, 86.54 to 145.4 by 6.54" in lines
    assert "Response   accelerance at tool, 10 mm, direction x" in lines
    assert "Frequency  100 to 9000 Hz, 4451 lines" in lines
    assert max(map(len, lines)) <= 80


def test_check_prints_dofs_frequencies_and_parts_as_json(run, assemblies, collet):
    found = json.loads(run("check", assemblies / "bt40_er32.yaml", "--json").stdout)
    assert found["dofs"] == {"assembly": 70, "condensed": 23}
    assert found["natural_frequencies"] == pytest.approx(collet.natural_frequencies(count=3).tolist())
    assert [parameter["name"] for parameter in found["parameters"]] == [p.name for p in collet.parameters]
    assert found["substructures"][0]["nodes"][-1]["position"] == pytest.approx(0.1)


def test_check_shows_fixed_parameters_and_held_parts(run, tmp_path, assemblies):
    description = tmp_path / "fixed.yaml"
    description.write_text(
        f"extends: {assemblies / 'sdof.yaml'}\njoints: {{mount: {{parameters: {{c: {{value: 20 N s/m}}}}}}}}\n"
    )
    rows = [line.split() for line in run("check", description).stdout.splitlines()]
    assert ["mount.c", "20", "N", "s/m"] in rows
    assert ["substructure", "base", "ground", "held"] in rows
    assert not any(row[:1] == ["c"] for row in rows)


def test_check_reports_a_band_without_natural_frequencies(run, tmp_path, assemblies):
    description = tmp_path / "low.yaml"
    description.write_text(f"extends: {assemblies / 'sdof.yaml'}\nfrequency: {{stop: 20 Hz}}\n")
    printed = run("check", description).stdout
    assert "none lies within the frequencies\n" in printed
    assert "What looks wrong\nfrequency: the band, 1 to 20 Hz, lies below all natural frequencies" in printed


def test_no_parameters_and_only_known_parameters_are_reported_differently(run, assemblies, tmp_path):
    file = tmp_path / "known.yaml"
    file.write_text(f"extends: {assemblies / 'sdof.yaml'}\njoints: {{mount: {{parameters: {{k: 1e6, c: 10}}}}}}\n")
    assert "none: every parameter is fixed" in run("check", file).stdout
    file.write_text(f"extends: {assemblies / 'sdof.yaml'}\njoints: {{mount: {{model: rigid, connect: {{{ENDS}}}}}}}\n")
    held = run("check", file, code=1).stderr
    assert "does not move" in held
    beam = "mass: {model: timoshenko_beam, material: {young: 2e11, density: 7800}, sections: [{length: 1, outer: 0.1}]}"
    file.write_text(
        f"extends: {assemblies / 'sdof.yaml'}\nsubstructures: {{{beam}}}\n"
        f"joints: {{mount: {{model: rigid, connect: {{{ENDS}}}}}}}\nresponse: {{position: 1}}\n"
    )
    assert "none: the joints have no parameters" in run("check", file).stdout


ENDS = "a: {to: mass, at: 0}, b: {to: base, at: 0}"


def test_nodes_that_share_a_position_are_shown_by_their_labels(run, tmp_path):
    np.savez(tmp_path / "part.npz", M=np.eye(2), K=1e6 * np.eye(2), nodes=["tip", "root"], directions=["x", "x"])
    file = tmp_path / "part.yaml"
    file.write_text(
        "dovetail: 1\nname: part\nfrequency: {start: 1, stop: 300, step: 1}\n"
        "substructures: {part: {model: matrices, file: part.npz}}\nresponse: {at: part, position: tip}\n"
    )
    lines = run("check", file).stdout.splitlines()
    assert "part           by label: tip, root" in lines
    assert "Response   accelerance at part, node tip, direction x" in lines


def test_a_skew_direction_is_shown_with_four_digits(run, tmp_path):
    file = tmp_path / "body.yaml"
    file.write_text(
        "dovetail: 1\nname: body\nfrequency: {start: 1, stop: 300, step: 1}\n"
        "substructures: {body: {model: rigid_body, mass: 1, inertia: [1, 1, 1]}}\n"
        "response: {at: body, position: 0, direction: [1, 1, 0]}\n"
    )
    assert "Response   accelerance at body, 0 mm, direction (0.7071, 0.7071, 0)" in run("check", file).stdout
