"""``dovetail new-plugin``: its package can be installed and passes its own tests unchanged."""

from __future__ import annotations

import importlib
import importlib.util
import sys
import tomllib

import pytest

from dovetail.testing import check_component, check_names

KINDS = ("joint", "substructure", "reducer", "regressor", "reader", "matrix_reader", "method")


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


@pytest.mark.parametrize("kind", ["joint", "substructure", "reader", "matrix_reader", "method"])
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


def test_a_model_is_added_to_a_package_that_exists(runner, tmp_path, monkeypatch):
    assert runner("new-plugin", "joint", "felt", "-o", tmp_path / "mine").exit_code == 0
    before = {file: file.read_bytes() for file in (tmp_path / "mine").rglob("*") if file.is_file()}
    for kind in (*KINDS, "law"):
        added = runner("new-plugin", kind, f"my_{kind}", "--into", tmp_path / "mine")
        assert added.exit_code == 0, added.stderr
    entries = tomllib.loads((tmp_path / "mine" / "pyproject.toml").read_text())["project"]["entry-points"]["dovetail"]
    assert entries == {"felt": "dovetail_felt"} | {f"my_{kind}": f"dovetail_felt.my_{kind}" for kind in (*KINDS, "law")}
    changed = {file.name for file, content in before.items() if file.read_bytes() != content}
    assert changed == {"pyproject.toml"}
    monkeypatch.syspath_prepend(tmp_path / "mine" / "src")
    for kind in (*KINDS, "law"):
        (model,) = importlib.import_module(f"dovetail_felt.my_{kind}").dovetail_components()
        assert model.name == f"my_{kind}"
        assert model.kind == kind
        for test in (f"test_my_{kind}.py", f"test_my_{kind}_conformance.py"):
            compile((tmp_path / "mine" / "tests" / test).read_text(), test, "exec")
    (joint,) = importlib.import_module("dovetail_felt.my_joint").dovetail_components()
    assert [result for result in check_component(joint) if result.outcome == "failed"] == []


@pytest.mark.parametrize(
    ("files", "problem"),
    [
        ({}, "there is no pyproject.toml"),
        ({"pyproject.toml": "[tool]\n"}, "it declares no [project]"),
        ({"pyproject.toml": "a ="}, "this is not TOML"),
        ({"pyproject.toml": "[project]\nname='x'\n"}, "it has no import package"),
        ({"pyproject.toml": "[project]\n", "a/__init__.py": "", "b/__init__.py": ""}, "it has 2 import packages: a, b"),
        ({"pyproject.toml": "[project]\n", "a/__init__.py": "", "a/felt.py": ""}, "this file already exists"),
    ],
)
def test_what_is_not_such_a_package_stays_as_it_is(runner, tmp_path, files, problem):
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    failed = runner("new-plugin", "joint", "felt", "--into", tmp_path)
    assert failed.exit_code == 1
    assert problem in failed.stderr
    assert {str(f.relative_to(tmp_path)): f.read_text() for f in tmp_path.rglob("*") if f.is_file()} == files


def test_a_package_without_entry_points_gets_their_table(runner, tmp_path):
    (tmp_path / "pyproject.toml").write_text('[project]\nname = "x"\n')
    (tmp_path / "src" / "x").mkdir(parents=True)
    (tmp_path / "src" / "x" / "__init__.py").write_text("")
    assert runner("new-plugin", "joint", "felt", "--into", tmp_path).exit_code == 0
    declared = tomllib.loads((tmp_path / "pyproject.toml").read_text())["project"]
    assert declared == {"name": "x", "entry-points": {"dovetail": {"felt": "x.felt"}}}


def test_into_and_output_exclude_each_other(runner, tmp_path):
    assert runner("new-plugin", "joint", "felt", "--into", tmp_path, "-o", tmp_path / "x").exit_code == 2
