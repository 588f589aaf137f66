"""The other packages of the docs, a reader, a method and a reducer: installed together, checked, used as users do."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import re
import shutil
import tempfile
from pathlib import Path

import pytest

from dovetail.registry import installed_components
from dovetail.testing import check_component

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"
NAMES = {"json_frf": "dovetail-json-frf", "evolution": "dovetail-evolution", "modal_peaks": "dovetail-modal-peaks"}


@pytest.fixture
def installed(environment, tmp_path):
    """An environment with all three, and copies of their folders by the component's name."""
    ignored = shutil.ignore_patterns("__pycache__")
    folders = {name: Path(shutil.copytree(EXAMPLES / d, tmp_path / d, ignore=ignored)) for name, d in NAMES.items()}
    environment.install(*folders.values())
    return environment, folders


@pytest.mark.slow
def test_each_is_installed_and_does_what_its_readme_says(installed):
    environment, folders = installed
    listed = environment.run("dovetail", "plugins")
    for name, folder in folders.items():
        assert re.search(rf"{name} .*{NAMES[name]} 0\.1\.0", listed)
        readme = (folder / "README.md").read_text()
        commands = re.findall(r"^(dovetail .*?)(?: +#.*)?$", readme, flags=re.M)
        assert len(commands) >= 4
        for command in commands:
            environment.run(*command.split(), folder=folder)
        passed = environment.run("python", "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", "not conform", folder)
        assert " passed" in passed


@pytest.fixture
def offered(monkeypatch):
    """Their components among those that are installed."""
    registry = installed_components()
    monkeypatch.setattr(registry, "_offers", {key: list(offers) for key, offers in registry._offers.items()})
    for name, distribution in NAMES.items():
        monkeypatch.syspath_prepend(EXAMPLES / distribution / "src")
        registry.add(importlib.import_module(f"dovetail_{name}"), f"{distribution} 0.1.0")
    return registry


@pytest.mark.parametrize("name", NAMES)
def test_each_conforms_and_its_own_tests_pass(name, offered):
    results = check_component(name, registry=offered)
    assert [str(result) for result in results if not result.ok] == []
    tests = EXAMPLES / NAMES[name] / "tests" / "test_example.py"
    spec = importlib.util.spec_from_file_location(f"example_of_{name}", tests)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    run = [function for called, function in vars(module).items() if called.startswith("test_")]
    for function in run:
        with tempfile.TemporaryDirectory() as folder:
            function(**({"tmp_path": Path(folder)} if "tmp_path" in inspect.signature(function).parameters else {}))
    assert run
