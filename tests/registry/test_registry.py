"""Discovery: good plugins are registered; broken ones are reported with the reason and do not affect the others."""

from __future__ import annotations

import ast
import subprocess
import sys
import textwrap
from importlib.metadata import entry_points
from pathlib import Path
from types import SimpleNamespace

import pytest
from pydantic import create_model

import dovetail
from dovetail import StructuralMatrices, hookimpl
from dovetail.errors import PluginError
from dovetail.interfaces import ComponentConfig, JointModel, JointPort, Parameter
from dovetail.registry import Registry, components
from dovetail.registry import loading as module
from support.mass_on_mount import mass_on_mount
from support.syntax_trees import nodes

GOOD = '''
import numpy as np
import dovetail
from dovetail import ComponentConfig, JointModel, JointPort, Parameter, StructuralMatrices


class Pad(JointModel):
    """A pad."""

    name = "pad"
    summary = "Elastic pad"
    parameters = (Parameter("kp", "N/m", 1e5, 1e7, "log", "stiffness"),)
    ports = (JointPort("a", 1), JointPort("b", 1))

    class Config(ComponentConfig):
        """No options."""

    def matrices(self, theta):
        joint = StructuralMatrices.zeros(len(theta), 4)
        sign = np.array([1.0, 0.0, -1.0, 0.0])
        joint.K[:] = theta[:, 0, None, None] * np.outer(sign, sign)
        return joint


@dovetail.hookimpl
def dovetail_components():
    return [Pad]
'''


def joint(**attributes):
    body = {
        "name": "pad",
        "summary": "Elastic pad",
        "parameters": (Parameter("kp", "N/m", 1e5, 1e7, "log"),),
        "ports": (JointPort("a", 1), JointPort("b", 1)),
        "matrices": lambda self, theta: StructuralMatrices.zeros(len(theta), 4),
        **attributes,
    }
    return type("Pad", (JointModel,), {k: v for k, v in body.items() if v is not None})


def plugin(*components, hook="dovetail_components"):
    def offered():
        return list(components)

    offered.__name__ = hook
    return SimpleNamespace(**{hook: hookimpl(offered)})


def problem_of(error) -> str:
    return error.value.faults[0].problem


def test_built_in_components_come_in_through_the_entry_point():
    registry = Registry()
    registry.load_entry_points()
    assert registry.failures == ()
    assert set(registry.names("substructure")) >= {"timoshenko_beam", "lumped", "ground"}
    assert set(registry.names("joint")) >= {"collet", "spring_damper", "rigid"}
    assert set(registry.names("reducer")) >= {"umap", "pca", "none"}
    assert set(registry.names("regressor")) >= {"mlp"}
    assert registry.find("joint", "collet").source.startswith("dovetail-frf ")


def test_a_plugin_file_offers_its_components(tmp_path):
    file = tmp_path / "pad.py"
    file.write_text(GOOD)
    registry = Registry()
    registry.load_file(file)
    offer = registry.find("joint", "pad")
    assert offer.source == str(file)
    assert offer.component().ports[1].name == "b"


def test_an_unknown_model_names_the_nearest_and_what_failed_to_load(monkeypatch):
    def broken(self):
        raise ImportError("No module named 'felt'")

    installed = entry_points(group="dovetail")
    for kind in {type(entry) for entry in installed}:  # importlib_metadata, once imported, brings its own
        monkeypatch.setattr(kind, "load", broken)
    registry = Registry()
    registry.load_entry_points()
    registry.add(plugin(joint()), "pads 1.0")
    fault = registry.unknown("joint", "pat")
    assert fault.problem == "'pat' is not a joint model."
    assert fault.accepted == "pad"
    assert fault.remedy.startswith("Did you mean 'pad'?")
    assert "ImportError: No module named 'felt'" in fault.remedy


def test_one_broken_entry_point_takes_no_other_down(monkeypatch):
    good, bad = (SimpleNamespace(name=n, value=n, dist=SimpleNamespace(name=n, version="2.0")) for n in ("ok", "bad"))
    good.load = lambda: plugin(joint())
    bad.load = lambda: (_ for _ in ()).throw(SystemExit("stop"))
    monkeypatch.setattr(module, "entry_points", lambda group: [bad, good])
    registry = Registry()
    registry.load_entry_points()
    assert registry.names("joint") == ("pad",)
    assert [(f.source, f.reason) for f in registry.failures] == [("bad 2.0", "SystemExit: stop")]


def test_a_name_offered_twice_names_both_and_leaves_the_others_usable():
    registry = Registry()
    registry.add(plugin(joint(), joint(name="felt")), "pads 1.0")
    registry.add(plugin(joint()), "cushions 3.1")
    assert registry.conflicts == {("joint", "pad"): ("pads 1.0", "cushions 3.1")}
    assert registry.names("joint") == ("felt",)
    with pytest.raises(PluginError) as error:
        registry.find("joint", "pad")
    assert problem_of(error) == "the joint model 'pad' is offered by pads 1.0 and cushions 3.1."
    assert error.value.faults[0].remedy == "Say which: pads:pad, cushions:pad."
    assert [registry.find("joint", f"{package}:pad").source for package in ("pads", "cushions")] == [
        "pads 1.0",
        "cushions 3.1",
    ]
    with pytest.raises(PluginError):
        registry.find("joint", "felts:pad")


def test_offering_the_same_class_twice_is_accepted():
    registry, component = Registry(), joint()
    registry.add(plugin(component), "pads 1.0")
    registry.add(plugin(component), "pads 1.0, again")
    assert registry.names("joint") == ("pad",)


def test_a_misspelt_hook_is_an_error():
    with pytest.raises(PluginError) as error:
        Registry().add(plugin(joint(), hook="dovetail_component"), "pads 1.0")
    assert problem_of(error) == "'dovetail_component' is not a hook of dovetail."
    assert error.value.faults[0].remedy == "Did you mean 'dovetail_components'?"


def test_a_module_without_the_hook_is_an_error():
    with pytest.raises(PluginError) as error:
        Registry().add(SimpleNamespace(dovetail_components=lambda: []), "pads 1.0")
    assert problem_of(error) == "it has no hook 'dovetail_components' marked with @dovetail.hookimpl."


def test_a_hook_that_raises_is_an_error():
    def dovetail_components():
        raise RuntimeError("no licence")

    with pytest.raises(PluginError) as error:
        Registry().add(SimpleNamespace(dovetail_components=hookimpl(dovetail_components)), "pads 1.0")
    assert problem_of(error) == "its hook 'dovetail_components' raised RuntimeError: no licence"


@pytest.mark.parametrize("returned", ["pad", 3])
def test_a_hook_that_returns_no_list_is_an_error(returned):
    def dovetail_components():
        return returned

    with pytest.raises(PluginError) as error:
        Registry().add(SimpleNamespace(dovetail_components=hookimpl(dovetail_components)), "pads 1.0")
    assert problem_of(error) == f"its hook 'dovetail_components' returned {returned!r}, not a list of classes."


class NoConfig:
    pass


@pytest.mark.parametrize(
    ("component", "reason"),
    [
        (joint(name=""), "Pad has no 'name'."),
        (joint(name=None), "Pad has no 'name'."),
        (joint(summary=None), "Pad has no 'summary'."),
        (joint(name="two words"), "Pad has the name 'two words', which is not an identifier."),
        (joint(matrices=None), "Pad does not define matrices."),
        (joint(Config=NoConfig), "Pad.Config does not derive from dovetail.ComponentConfig."),
        (
            joint(Config=create_model("Config", __base__=ComponentConfig, connect=(float, 1.0))),
            "Pad.Config has the option 'connect', which is a key of descriptions; choose another name.",
        ),
        (
            joint(Config=create_model("Config", __base__=ComponentConfig, model=(str, "soft"))),
            "Pad.Config has the option 'model', which is a key of descriptions; choose another name.",
        ),
        (
            joint(interface_versions=(3, 4)),
            "Pad was written for versions 3 to 4 of the plugin interface; this dovetail-frf knows 1 to 2.",
        ),
        (
            joint(interface_versions=(3, 3), matrices=None),
            "Pad was written for version 3 of the plugin interface; this dovetail-frf knows 1 to 2.",
        ),
        (
            joint(interface_versions=(2, 1)),
            "Pad has (2, 1) for its interface_versions, not its lowest and highest version, such as (1, 1).",
        ),
        (
            joint(interface_versions=1),
            "Pad has 1 for its interface_versions, not its lowest and highest version, such as (1, 1).",
        ),
        (
            ComponentConfig,
            "<class 'dovetail.interfaces.component.ComponentConfig'> is not a component class "
            "(a subclass of SubstructureModel, JointModel, Reducer, Regressor, FrfReader, MatrixReader, "
            "IdentificationMethod, Law).",
        ),
    ],
)
def test_an_unfit_component_is_put_aside_with_its_reason(component, reason):
    registry = Registry()
    registry.add(plugin(component, joint(name="felt")), "pads 1.0")
    assert [(f.source, f.reason) for f in registry.failures] == [("pads 1.0", reason)]
    assert registry.names("joint") == ("felt",)
    with pytest.raises(PluginError) as error:
        Registry().add(plugin(component), "pads.py", strict=True)
    assert problem_of(error) == reason


def test_a_component_for_this_and_other_interface_versions_comes_in(monkeypatch):
    registry = Registry()
    registry.add(plugin(joint(interface_versions=(1, 2))), "pads 1.0", strict=True)
    registry.add(plugin(joint(name="felt", interface_versions=(1, 1))), "felt 1.0", strict=True)
    monkeypatch.setattr("dovetail.registry.component_checks.INTERFACE_VERSION", 4)
    monkeypatch.setattr("dovetail.registry.component_checks.OLDEST_INTERFACE", 3)
    registry.add(plugin(joint(name="cork", interface_versions=(2, 3))), "cork 1.0", strict=True)
    registry.add(plugin(joint(name="old")), "old 1.0")
    assert registry.names("joint") == ("cork", "felt", "pad")
    reason = "Pad was written for versions 1 to 2 of the plugin interface; this dovetail-frf knows 3 to 4."
    assert [(failure.source, failure.reason) for failure in registry.failures] == [("old 1.0", reason)]


@pytest.mark.parametrize(
    ("code", "where", "message"),
    [
        ("x = 1\nimport not_there\n", ":2", "ModuleNotFoundError: No module named 'not_there'"),
        ("x = 1\n\ndef broken(:\n", ":3", "SyntaxError"),
        ("raise SystemExit(3)\n", ":1", "SystemExit: 3"),
        ("import dovetail\n\ndovetail.JointPort('a')\n", ":3", "JointPort(...) is called without 'nodes'."),
        (
            "import dovetail\ndovetail.Parameter('k', 'N/m')\n",
            ":2",
            "Parameter(...) is called without 'lower' and 'upper'.",
        ),
        ("x = 1\n", "", "it has no hook 'dovetail_components' marked with @dovetail.hookimpl."),
    ],
)
def test_a_broken_plugin_file_is_an_error_with_line_and_reason(tmp_path, code, where, message):
    file = tmp_path / "pad.py"
    file.write_text(code)
    with pytest.raises(PluginError) as error:
        Registry().load_file(file)
    assert error.value.faults[0].where == f"{file}{where}"
    assert problem_of(error).startswith(message)


def test_a_missing_plugin_file_is_an_error(tmp_path):
    with pytest.raises(PluginError) as error:
        Registry().load_file(tmp_path / "none.py")
    assert problem_of(error) == "there is no such plugin file."


def test_a_separately_installed_package_comes_in(tmp_path):
    """A distribution of its own, installed next to dovetail into a folder that only a subprocess sees."""
    package = tmp_path / "dovetail-pads"
    package.mkdir()
    (package / "dovetail_pads.py").write_text(GOOD)
    (package / "pyproject.toml").write_text(
        textwrap.dedent("""
        [build-system]
        requires = ["hatchling"]
        build-backend = "hatchling.build"
        [project]
        name = "dovetail-pads"
        version = "0.3"
        [project.entry-points.dovetail]
        pads = "dovetail_pads"
        [tool.hatch.build.targets.wheel]
        include = ["dovetail_pads.py"]
        """)
    )
    site = tmp_path / "site"
    install = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-build-isolation", "--no-index"]
    subprocess.run([*install, "--target", str(site), str(package)], check=True)
    assembly = {
        "dovetail": 1,
        "name": "padded",
        "frequency": {"start": 1, "stop": 100, "step": 1},
        "substructures": {"m": {"model": "lumped", "masses": [{"mass": 1}]}, "g": {"model": "ground"}},
        "joints": {"j": {"model": "pad", "connect": {"a": {"to": "m", "at": 0}, "b": {"to": "g", "at": 0}}}},
        "response": {"at": "m", "position": 0},
    }
    script = (
        "from dovetail.registry import Registry; r = Registry(); r.load_entry_points(); "
        "print(r.find('joint', 'pad').source, len(r.failures)); "
        f"import dovetail; print(round(float(dovetail.load({assembly!r}).natural_frequencies([1e6], count=1)[0]), 3))"
    )
    run = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, env={"PYTHONPATH": str(site)}
    )
    assert run.stdout.splitlines() == ["dovetail-pads 0.3 0", "159.155"]


class _Giving:
    """A plugin without components."""

    def __init__(self, defaults):
        self._defaults = defaults

    @hookimpl
    def dovetail_components(self):
        return []

    @hookimpl
    def dovetail_defaults(self):
        return self._defaults


def test_the_first_default_of_each_key_counts():
    registry = Registry()
    registry.add(_Giving({"compare": ["a"]}), "first 1.0")
    registry.add(_Giving({"compare": ["b"], "robustness": ["c"]}), "second 1.0")
    assert dict(registry.defaults) == {"compare": ["a"], "robustness": ["c"]}


def test_a_default_means_the_model_of_the_plugin_that_gives_it(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(
        "import dovetail\n\n\nclass Mine(dovetail.Reducer):\n    name, summary = 'pca', 'Another'\n\n"
        "    def fit(self, features, *, seed):\n        raise NotImplementedError\n\n"
        "    def restore(self, state):\n        raise NotImplementedError\n\n\n"
        "@dovetail.hookimpl\ndef dovetail_components():\n    return [Mine]\n"
    )
    alone, both = components().defaults, components([file]).defaults
    assert alone["identification"]["reducer"] == {"model": "pca", "n_components": 100}
    assert both["identification"]["reducer"] == {"model": "dovetail-frf:pca", "n_components": 100}
    assert both["compare"][:4] == ["umap", "dovetail-frf:pca", "none", "dovetail-frf:pca+robust"]
    unsaid = mass_on_mount({"start": 20, "stop": 600, "step": 5}, {})
    reducers = [dovetail.load(unsaid, plugins=files).description.identification.reducer for files in ([], [file])]
    assert type(reducers[0]) is type(reducers[1])


@pytest.mark.parametrize("returned", [["pca"], "pca", 3])
def test_defaults_other_than_a_mapping_are_refused(returned):
    with pytest.raises(PluginError) as error:
        Registry().add(_Giving(returned), "pads 1.0")
    assert problem_of(error) == f"its hook 'dovetail_defaults' returned {returned!r}."


def test_no_file_of_the_framework_names_a_reducer_or_a_regressor():
    registry = Registry()
    registry.load_entry_points()
    names = {name for kind in ("reducer", "regressor") for name in registry.names(kind)} - {"none"}
    sources = Path(module.__file__).parents[1].rglob("*.py")
    named = [
        (file.name, constant.value)
        for file in sources
        if "testing" not in file.parts
        for constant in nodes(file)
        if isinstance(constant, ast.Constant) and constant.value in names
    ]
    assert named == []
