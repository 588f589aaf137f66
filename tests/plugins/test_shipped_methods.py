"""The methods of identification that ship are plugins like anybody's: they work in any package."""

import importlib
import shutil
from pathlib import Path

import pytest

import dovetail
import dovetail_plugins
from dovetail.identification import one_measurement
from dovetail.registry import Registry

FOLDER = Path(dovetail_plugins.__file__).parent / "methods"
NAMES = ("multistart", "network", "posterior", "refined")

HOOK = """
import inspect
import dovetail
from {package} import {module}

@dovetail.hookimpl
def dovetail_components():
    members = vars({module}).values()
    return [one for one in members if inspect.isclass(one) and one.__module__ == {module}.__name__]
"""


@pytest.mark.parametrize("name", NAMES)
def test_a_shipped_method_works_in_another_package(name, tmp_path, monkeypatch, assemblies):
    package = f"other_{name}"
    (tmp_path / package).mkdir()
    (tmp_path / package / "__init__.py").write_text("")
    shutil.copy(FOLDER / f"{name}.py", tmp_path / package)
    (tmp_path / f"{package}_hook.py").write_text(HOOK.format(package=package, module=name))
    monkeypatch.syspath_prepend(tmp_path)
    registry = Registry()
    registry.add(importlib.import_module(f"{package}_hook"), package)
    monkeypatch.setattr(one_measurement, "installed_components", lambda: registry)
    (offer,) = registry.offers("method")
    assert offer.component.__module__ == f"{package}.{name}"
    assembly = dovetail.load(assemblies / "sdof.yaml")
    measured = dovetail.noisy_frf(assembly.simulate({"k": 2e6, "c": 30.0}), 1e-3, 0)
    if name == "network":
        with pytest.raises(dovetail.ParameterError, match="needs a trained model"):
            dovetail.identify(assembly, measured, name)
    else:
        result = dovetail.identify(assembly, measured, name)
        assert result.parameters["k"].value == pytest.approx(2e6, rel=1e-3)
        assert result.method == name
