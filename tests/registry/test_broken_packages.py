"""Many broken packages installed at once: each is reported in one line, and everything else goes on working."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from dovetail.errors import PluginError
from dovetail.interfaces import KINDS
from dovetail.registry import Registry
from support.waiting import PATIENCE

JOINT = """
import numpy as np
import dovetail


class Pad(dovetail.JointModel):
    name, summary = "{name}", "Elastic pad"
    parameters = (dovetail.Parameter("kp", "N/m", 1e5, 1e7, "log", "stiffness"),)
    ports = (dovetail.JointPort("a", 1), dovetail.JointPort("b", 1))
    {extra}

    def matrices(self, theta):
        joint = dovetail.StructuralMatrices.zeros(len(theta), self.size)
        joint.K[:] = theta[:, 0, None, None] * np.outer([1, 0, -1, 0], [1, 0, -1, 0])
        return joint


@dovetail.hookimpl
def {hook}():
    {offer}
"""


def joint(name="pad", extra="", hook="dovetail_components", offer="return [Pad]") -> str:
    return JOINT.format(name=name, extra=extra, hook=hook, offer=offer)


PACKAGES = {
    "sound": joint("felt"),
    "unimportable": "import gone_package\n",
    "unparsable": "def broken(:\n",
    "exiting": "raise SystemExit(3)\n",
    "exiting_hook": joint("hemp", offer="raise SystemExit(3)"),
    "exiting_constructor": joint("jute", extra="def __init__(self, c=None): raise SystemExit(3)"),
    "no_exception": "class Stop(BaseException): pass\nraise Stop('no licence')\n",
    "no_exception_in_hook": joint("flax", offer="raise type('Stop', (BaseException,), {})('no licence')"),
    "raising_class": "import abc\n" + joint("kapok", offer="return [Raising]") + "class Meta(abc.ABCMeta):\n"
    "    def __getattribute__(self, name):\n"
    "        if name == 'interface_versions':\n"
    "            raise RuntimeError(f'no {name}')\n"
    "        return super().__getattribute__(name)\n"
    "class Raising(dovetail.JointModel, metaclass=Meta):\n    name, summary = 'kapok', 'raising'\n",
    "exiting_repr": joint("sisal", offer="return [Silent()]")
    + "class Silent:\n    def __repr__(self): raise SystemExit('no name')\n",
    "raising_module": joint("abaca") + "def __dir__(): raise RuntimeError('nothing to see')\n",
    "misspelt": joint("cork", hook="dovetail_component"),
    "hookless": "x = 1\n",
    "raising_hook": joint("wool", offer="raise RuntimeError('no licence')"),
    "half_a_hook": joint("lead", offer="yield Pad\n    raise RuntimeError('half way')"),
    "wrong_type": joint("tin", offer="return 3"),
    "no_class": joint("zinc", offer="return [Pad, Pad()]"),
    "wrong_kind": joint("iron", extra="kind = 'spring'"),
    "wrong_config": joint("gold", extra="Config = 3"),
    "raising_constructor": joint("glass", extra="def __init__(self, c=None): raise RuntimeError('no licence')"),
    "wrong_matrices": joint("silk") + "\nPad.matrices = lambda self, theta: np.zeros((len(theta), 4, 4))\n",
    "exiting_matrices": joint("straw") + "\nimport sys\nPad.matrices = lambda self, theta: sys.exit(3)\n",
    "wrong_parameters": joint("cane") + "\nPad.parameters = ('k',)\n",
    "first_of_two": joint("twin"),
    "second_of_two": joint("twin"),
}
FAILURES = {
    "unimportable": "ModuleNotFoundError: No module named 'gone_package'",
    "unparsable": "SyntaxError: ",
    "exiting": "SystemExit: 3",
    "exiting_hook": "its hook 'dovetail_components' raised SystemExit: 3",
    "no_exception": "Stop: no licence",
    "no_exception_in_hook": "its hook 'dovetail_components' raised Stop: no licence",
    "raising_class": "a class that it offers cannot be examined: RuntimeError: no ",
    "exiting_repr": "a class that it offers cannot be examined: SystemExit: no name",
    "raising_module": "its hooks cannot be examined: RuntimeError: nothing to see",
    "misspelt": "'dovetail_component' is not a hook of dovetail.",
    "hookless": "it has no hook 'dovetail_components' marked with @dovetail.hookimpl.",
    "raising_hook": "its hook 'dovetail_components' raised RuntimeError: no licence",
    "half_a_hook": "its hook 'dovetail_components' raised RuntimeError: half way",
    "wrong_type": "its hook 'dovetail_components' returned 3, not a list of classes.",
    "no_class": "Pad(Config()) is not a component class",
    "wrong_kind": "Pad has the kind 'spring'; do not override 'joint' of JointModel.",
    "wrong_config": "Pad.Config does not derive from dovetail.ComponentConfig.",
}
ASSEMBLY = """\
dovetail: 1
name: padded
frequency: {start: 1 Hz, stop: 100 Hz, step: 1 Hz}
substructures: {m: {model: lumped, masses: [{mass: 1 kg}]}, g: {model: ground}}
joints: {j: {model: MODEL, connect: {a: {to: m, at: 0}, b: {to: g, at: 0}}}}
response: {at: m, position: 0}
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory) -> SimpleNamespace:
    """A folder with all packages as pip would leave them, and the command line with it on the path."""
    folder = tmp_path_factory.mktemp("site")
    for name, code in PACKAGES.items():
        (folder / f"{name}.py").write_text(code)
        metadata = folder / f"{name}-1.0.dist-info"
        metadata.mkdir()
        (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (metadata / "entry_points.txt").write_text(f"[dovetail]\n{name} = {name}\n")

    def run(*words: object, code: int = 0) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-c", "from dovetail.cli import main; main()", *map(str, words)]
        path = os.pathsep.join([str(folder), *filter(None, [os.environ.get("PYTHONPATH")])])
        environment = {**os.environ, "PYTHONPATH": path}
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, env=environment)
        assert done.returncode == code, done.stderr
        assert "Traceback" not in done.stderr
        return done

    return SimpleNamespace(folder=folder, run=run)


def assembly(folder: Path, model: str) -> Path:
    file = folder / f"{model}.yaml"
    file.write_text(ASSEMBLY.replace("MODEL", model))
    return file


def test_each_broken_package_is_listed_with_one_reason_and_the_sound_ones_with_their_models(installed):
    listed = json.loads(installed.run("plugins", "--json").stdout)
    failures = {entry["source"]: entry["reason"] for entry in listed["failures"]}
    assert len(failures) == len(listed["failures"])
    assert set(failures) == {f"{name} 1.0" for name in FAILURES}
    for name, reason in FAILURES.items():
        assert reason in failures[f"{name} 1.0"]
    assert listed["conflicts"] == [
        {"kind": "joint", "name": "twin", "sources": ["first_of_two 1.0", "second_of_two 1.0"]}
    ]
    registry = Registry()
    registry.load_entry_points()
    names = {name for kind in KINDS for name in registry.names(kind)}
    names |= {"felt", "zinc", "glass", "silk", "cane", "jute", "straw"}
    assert names == {entry["name"] for entry in listed["components"]}


def test_everything_else_goes_on_working(installed, tmp_path, assemblies):
    installed.run("check", assemblies / "sdof.yaml")
    installed.run("check", assembly(tmp_path, "felt"))
    installed.run("schema", "-o", tmp_path / "schema.json")
    assert "Elastic pad" in installed.run("describe", "felt").stdout


@pytest.mark.sweep(keep=4)
@pytest.mark.parametrize(
    ("model", "message"),
    [
        ("twin", "the joint model 'twin' is offered by first_of_two 1.0 and second_of_two 1.0."),
        ("cork", "'cork' is not a joint model."),
        ("cork", "(Not loaded: misspelt 1.0: 'dovetail_component' is not a hook of dovetail.)"),
        (
            "glass",
            "joint model 'glass' (raising_constructor 1.0) cannot be made from this section: RuntimeError: ",
        ),
        (
            "jute",
            "joint model 'jute' (exiting_constructor 1.0) cannot be made from this section: SystemExit: 3",
        ),
        ("cane", "joint model 'cane' (wrong_parameters 1.0) has 'k' among its parameters, which is not a Parameter."),
        ("straw", "failed: SystemExit: 3"),
        ("silk", "joint 'j' (silk) returns ndarray, not StructuralMatrices."),
    ],
)
def test_an_assembly_with_a_broken_plugin_is_one_error(installed, tmp_path, model, message):
    assert message in installed.run("check", assembly(tmp_path, model), code=1).stderr


def test_the_kit_reports_each_of_them(installed):
    assert "no licence" in installed.run("check-plugin", "glass", code=1).stdout
    assert "matrices returned ndarray" in installed.run("check-plugin", "silk", code=1).stdout
    assert "offered by first_of_two 1.0 and second" in installed.run("check-plugin", "twin", code=1).stderr
    assert "Not loaded: unimportable 1.0" in installed.run("check-plugin", "cork", code=1).stderr


def test_two_plugin_files_of_one_name_in_two_folders_are_two_modules(tmp_path):
    registry = Registry()
    for name in ("felt", "cork"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "pad.py").write_text(joint(name))
        registry.load_file(tmp_path / name / "pad.py")
    modules = [registry.find("joint", name).component.__module__ for name in ("felt", "cork")]
    assert modules[0] != modules[1]
    for name, module in zip(("felt", "cork"), modules, strict=True):
        assert sys.modules[module].Pad.name == name


def test_one_plugin_file_given_twice_is_taken_once(tmp_path, monkeypatch):
    (tmp_path / "pad.py").write_text(joint("felt"))
    monkeypatch.chdir(tmp_path)
    registry = Registry()
    for path in ("pad.py", tmp_path / "pad.py"):
        registry.load_file(path)
    assert registry.conflicts == {}


@pytest.mark.parametrize(
    ("nodes", "found"),
    [
        ("None", "has None for its nodes, not a tuple."),
        ("('left',)", "has 'left' among its nodes, which is not a PartNode."),
        ("(dovetail.PartNode('n', float('nan')),)", "has nan for the position of the node 'n'."),
        ("()", "has no nodes."),
    ],
)
def test_a_substructure_with_faulty_nodes_is_refused(tmp_path, nodes, found):
    import dovetail

    file = tmp_path / "part.py"
    file.write_text(
        "import dovetail\n"
        "class Part(dovetail.SubstructureModel):\n"
        "    name, summary = 'part', 'A part'\n"
        f"    nodes = {nodes}\n"
        "    def matrices(self): return dovetail.StructuralMatrices.zeros(2)\n"
        "@dovetail.hookimpl\n"
        "def dovetail_components(): return [Part]\n"
    )
    text = ASSEMBLY.replace("{model: lumped, masses: [{mass: 1 kg}]}", "{model: part}").replace("MODEL", "rigid")
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(dovetail.DovetailError) as error:
        dovetail.load(tmp_path / "a.yaml", plugins=file)
    (fault,) = error.value.faults
    assert fault.problem == f"substructure model 'part' ({file}) {found}"
    assert fault.where.startswith(f"{tmp_path / 'a.yaml'}:4:")


def test_a_broken_file_is_not_remembered_as_loaded(tmp_path):
    file = tmp_path / "pad.py"
    file.write_text("x = 1\n")
    registry = Registry()
    with pytest.raises(PluginError):
        registry.load_file(file)
    file.write_text(joint("felt"))
    os.utime(file, (1, 1))
    registry.load_file(file)
    assert "felt" in registry.names("joint")


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        (joint("pad", offer="raise SystemExit(3)"), "its hook 'dovetail_components' raised SystemExit: 3"),
        ("class Stop(BaseException): pass\nraise Stop('no licence')\n", "Stop: no licence"),
    ],
)
def test_a_plugin_file_that_ends_the_process_is_an_error(tmp_path, code, reason):
    (tmp_path / "pad.py").write_text(code)
    with pytest.raises(PluginError) as error:
        Registry().load_file(tmp_path / "pad.py")
    assert error.value.faults[0].problem.startswith(reason)


def test_ctrl_c_during_an_import_is_not_a_load_failure(tmp_path):
    (tmp_path / "pad.py").write_text("raise KeyboardInterrupt\n")
    with pytest.raises(KeyboardInterrupt):
        Registry().load_file(tmp_path / "pad.py")


def test_a_slow_import_is_listed(tmp_path, monkeypatch):
    clock = iter([0.0, 9.5])
    monkeypatch.setattr(time, "perf_counter", lambda: next(clock))
    (tmp_path / "pad.py").write_text(joint("pad"))
    registry = Registry()
    registry.load_file(tmp_path / "pad.py")
    assert registry.slow == {str(tmp_path / "pad.py"): 9.5}
