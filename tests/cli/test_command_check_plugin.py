"""``dovetail check-plugin``."""

from __future__ import annotations

import json
import re

import pytest

from dovetail.testing import check_names

SOUND = '''
import numpy as np
import dovetail


class Pad(dovetail.JointModel):
    """A pad."""

    name = "pad"
    summary = "Elastic pad"
    parameters = (dovetail.Parameter("kp", "N/m", 1e5, 1e7, "log", "stiffness"),)
    ports = (dovetail.JointPort("a", 1), dovetail.JointPort("b", 1))

    def matrices(self, theta):
        """Return the (n, 4, 4) matrices."""
        joint = dovetail.StructuralMatrices.zeros(len(theta), self.size)
        joint.K[:] = theta[:, 0, None, None] * np.outer([1, 0, -1, 0], [1, 0, -1, 0])
        return joint


@dovetail.hookimpl
def dovetail_components():
    """Return what this plugin offers."""
    return [Pad]
'''


def test_a_sound_plugin_file_passes_every_check(run, tmp_path):
    file = tmp_path / "pad.py"
    file.write_text(SOUND)
    printed = run("check-plugin", "pad", "--plugin", file).stdout
    assert "matrices are symmetric" in printed
    counts = re.fullmatch(r"(\d+) checks run: \1 passed, (\d+) not applicable\.", printed.splitlines()[-1])
    assert sum(map(int, counts.groups())) == len(check_names("joint"))
    assert "not applicable  the law has a limit at rest: " in printed


def test_a_broken_plugin_file_ends_with_one(run, tmp_path):
    file = tmp_path / "pad.py"
    file.write_text(SOUND.replace("np.outer([1, 0, -1, 0]", "np.outer([1, 0, -2, 0]"))
    results = json.loads(run("check-plugin", "pad", "--plugin", file, "--json", code=1).stdout)
    assert [result["name"] for result in results if result["outcome"] == "failed"] == [
        "matrices_are_symmetric",
        "stiffness_is_positive_semidefinite",
    ]
    printed = run("check-plugin", "pad", "--plugin", file, code=1).stdout
    assert "2 failed" in printed.splitlines()[-1]
    assert "Traceback" not in printed


def test_a_name_of_several_kinds_checks_them_all(run, tmp_path):
    file = tmp_path / "none.py"
    file.write_text(SOUND.replace('"pad"', '"none"'))
    components = {r["component"] for r in json.loads(run("check-plugin", "none", "--plugin", file, "--json").stdout)}
    assert components == {"joint 'none'", "reducer 'none'"}


def test_an_unknown_name_is_an_error(run):
    assert run("check-plugin", "colet", code=1).stderr.startswith(
        "dovetail check-plugin\n  there is no model 'colet'.\n"
    )


@pytest.mark.parametrize("command", ["check-plugin", "describe"])
def test_a_folder_instead_of_a_name_says_how_to_install_its_package(run, tmp_path, command):
    folder = tmp_path / "dovetail-pad"
    run("new-plugin", "joint", "pad", "-o", folder)
    assert run(command, folder, code=1).stderr == (
        f"{folder}\n  this is a folder.\n"
        f"  Install its package with `pip install -e {folder}`, then name the model: `dovetail check-plugin NAME`.  "
        "Accepted: the name of a model\n"
    )


@pytest.mark.parametrize("command", ["check-plugin", "describe"])
def test_a_folder_without_a_package_says_how_a_model_is_offered(run, tmp_path, command):
    message = run(command, tmp_path, code=1).stderr
    assert message.startswith(f"{tmp_path}\n  this is a folder.\n")
    assert "--plugin FILE.py" in message


@pytest.mark.parametrize("command", ["check-plugin", "describe"])
def test_a_file_instead_of_a_name_says_how_it_is_given(run, tmp_path, command):
    file = tmp_path / "pad.py"
    file.write_text(SOUND)
    assert run(command, file, code=1).stderr == (
        f"{file}\n  this is a file.\n"
        f"  Give its name, and the file with --plugin {file}.  Accepted: the name of a model\n"
    )


@pytest.mark.parametrize("words", [("check-plugin", "pad"), ("plugins",), ("describe", "pad")])
def test_a_folder_as_a_plugin_file_says_how_to_install_its_package(run, tmp_path, words):
    folder = tmp_path / "dovetail-pad"
    run("new-plugin", "joint", "pad", "-o", folder)
    message = run(*words, "--plugin", folder, code=1).stderr
    assert message.startswith(f"{folder}\n  this is a folder.\n")
    assert f"pip install -e {folder}" in message


@pytest.mark.parametrize(
    ("words", "file"),
    [
        (("check-plugin", "pad", "--plugin"), "joint.py"),
        (("check-plugin", "pad", "--plugin"), "__init__.py"),
        (("describe", "pad", "--plugin"), "joint.py"),
        (("check-plugin",), "joint.py"),
        (("check-plugin",), ""),
    ],
)
@pytest.mark.parametrize("within", [False, True])
def test_a_file_of_a_package_says_how_to_install_the_package(run, tmp_path, monkeypatch, words, file, within):
    run("new-plugin", "joint", "pad", "-o", tmp_path / "dovetail-pad")
    package = tmp_path / "dovetail-pad" / "src" / "dovetail_pad"
    monkeypatch.chdir(package if within else tmp_path)
    message = run(*words, file or "." if within else package.relative_to(tmp_path) / file, code=1).stderr
    folder = "../.." if within else "dovetail-pad"
    assert f"is part of the package 'dovetail_pad'. Install it with `pip install -e {folder}`" in message
    assert "--plugin" not in message


@pytest.mark.parametrize("command", ["check-plugin", "describe"])
def test_a_command_is_not_taken_for_a_misspelt_model(run, command):
    message = run(command, "calibrate", code=1).stderr
    assert "'calibrate' is a command, not a model." in message
    assert "'dovetail calibrate --help' describes it." in message
    assert "Did you mean" not in message


@pytest.mark.parametrize("command", ["check-plugin", "describe"])
@pytest.mark.parametrize(
    ("typed", "meant"), [("identfy", "identify"), ("simulat", "simulate"), ("idnetify-series", "identify-series")]
)
def test_a_misspelt_command_is_not_taken_for_a_model(run, command, typed, meant):
    message = run(command, typed, code=1).stderr
    assert f"there is no model '{typed}'." in message
    assert f"Did you mean the command '{meant}'? 'dovetail {meant} --help' describes it." in message


@pytest.mark.parametrize("command", ["check-plugin", "describe"])
@pytest.mark.parametrize(("typed", "meant"), [("colet", "collet"), ("timoshenko_bem", "timoshenko_beam")])
def test_a_misspelt_model_is_not_taken_for_a_command(run, command, typed, meant):
    message = run(command, typed, code=1).stderr
    assert f"Did you mean '{meant}'?" in message
    assert "the command" not in message
