"""``dovetail new-plugin``: its package can be installed and passes its own tests unchanged."""

from __future__ import annotations

import importlib.util
import sys

import pytest

from dovetail.testing import check_component, check_names

KINDS = ("joint", "substructure", "reducer", "regressor", "reader", "method")


@pytest.mark.slow  # by default test_transcript.py does so with a joint
@pytest.mark.parametrize("kind", KINDS)
def test_a_new_package_passes_its_own_tests_in_a_fresh_environment(kind, environment, tmp_path):
    package = tmp_path / "mine"
    said = environment.run("dovetail", "new-plugin", kind, "my_own", "-o", package)
    assert f"src/dovetail_my_own/{kind}.py" in said
    environment.install(package)
    assert "dovetail-my-own 0.1.0" in environment.run("dovetail", "plugins")
    assert "my_own" in environment.run("dovetail", "check", package / "example.yaml")
    tested = environment.run("python", "-m", "pytest", "-q", "-p", "no:cacheprovider", package)
    assert f"{len(check_names(kind)) + 1} passed" in tested
    assert str(environment.scripts.parent) in environment.run(
        "python", "-c", "import dovetail; print(dovetail.__file__)"
    )


@pytest.mark.parametrize(
    ("kind", "name", "found"),
    [
        ("joint", "collet", "offers a joint 'collet' already."),
        ("joint", "two words", "'two words' cannot be the name of a model."),
        ("joint", "class", "'class' cannot be the name of a model."),
        ("joint", "../up", "'../up' cannot be the name of a model."),
    ],
)
def test_an_unusable_plugin_name_is_refused(runner, tmp_path, kind, name, found):
    result = runner("new-plugin", kind, name, "-o", tmp_path / "mine")
    assert result.exit_code == 1
    assert found in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_an_existing_folder_is_not_overwritten(runner, tmp_path):
    result = runner("new-plugin", "joint", "felt", "-o", tmp_path)
    assert result.exit_code == 1
    assert result.stderr.startswith(f"{tmp_path}\n  a file or folder of this name already exists.")


def test_an_unknown_kind_is_a_wrong_command_line(runner, tmp_path):
    result = runner("new-plugin", "spring", "felt", "-o", tmp_path / "mine")
    assert result.exit_code == 2
    assert "'spring' is not one of substructure, joint" in result.stderr


def test_a_name_with_dashes_makes_an_identifier(runner, tmp_path):
    assert runner("new-plugin", "joint", "felt-pad", "-o", tmp_path / "mine").exit_code == 0
    assert 'name = "felt_pad"' in (tmp_path / "mine/src/dovetail_felt_pad/joint.py").read_text()
    assert 'name = "dovetail-felt-pad"' in (tmp_path / "mine/pyproject.toml").read_text()


@pytest.mark.parametrize("kind", ["joint", "substructure", "reader", "method"])
def test_a_new_plugin_passes_the_conformance_kit(kind, runner, tmp_path, monkeypatch):
    assert runner("new-plugin", kind, "my_own", "-o", tmp_path / "mine").exit_code == 0
    source = tmp_path / "mine" / "src" / "dovetail_my_own" / f"{kind}.py"
    spec = importlib.util.spec_from_file_location(f"made_{kind}", source)
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, module)
    spec.loader.exec_module(module)
    results = check_component(module.MyOwn)
    assert [result for result in results if not result.ok] == []


@pytest.fixture
def runner():
    from typer.testing import CliRunner

    from dovetail.cli.app import app

    return lambda *words: CliRunner().invoke(app, [str(word) for word in words])
