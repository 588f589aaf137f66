"""A one-file plugin with a new joint, outside the repository, from the command line."""

from __future__ import annotations

import json

import pytest

import dovetail

HYSTERETIC = '''
import numpy as np
import dovetail


class HystereticSpring(dovetail.JointModel):
    """A spring with structural damping."""

    name = "hysteretic_spring"
    summary = "A spring with structural damping between two nodes"
    parameters = (
        dovetail.Parameter("k", "N/m", 1e5, 1e7, "log", "stiffness"),
        dovetail.Parameter("d", "N/m", 1e3, 1e5, "log", "structural damping"),
    )
    ports = (dovetail.JointPort("a", 1), dovetail.JointPort("b", 1))

    def matrices(self, theta):
        joint = dovetail.StructuralMatrices.zeros(len(theta), self.size)
        across = np.outer([1.0, 0.0, -1.0, 0.0], [1.0, 0.0, -1.0, 0.0])
        joint.K[:] = theta[:, 0, None, None] * across
        joint.D[:] = theta[:, 1, None, None] * across
        return joint


@dovetail.hookimpl
def dovetail_components():
    return [HystereticSpring]
'''

DESCRIPTION = """\
dovetail: 1
name: hysteretic
frequency: {start: 1 Hz, stop: 600 Hz, step: 1 Hz}
substructures:
  mass: {model: lumped, masses: [{mass: 1 kg}]}
  base: {model: ground}
joints:
  mount:
    model: hysteretic_spring
    connect: {a: {to: mass, at: 0 mm}, b: {to: base, at: 0 mm}}
response: {at: mass, position: 0 mm, direction: x, quantity: accelerance}
identification:
  samples: 200
  seed: 0
  test_fraction: 0.2
  features: log10p1
  reducer: {model: none}
  regressor: {model: mlp, hidden: [32, 16], max_epochs: 30, learning_rate: 0.005}
"""


@pytest.fixture
def plugin(tmp_path):
    file = tmp_path / "hysteretic.py"
    file.write_text(HYSTERETIC)
    return file


@pytest.fixture
def description(tmp_path):
    file = tmp_path / "hysteretic.yaml"
    file.write_text(DESCRIPTION)
    return file


def test_a_new_joint_is_listed_checked_simulated_and_identified(run, plugin, description, tmp_path):
    assert "hysteretic_spring" in run("plugins", "--plugin", plugin).stdout
    rows = [line.split() for line in run("check", description, "--plugin", plugin).stdout.splitlines()]
    assert ["joint", "mount,", "internal", "hysteretic_spring", "0"] in rows
    assert ["condensed", "system", "of", "the", "engine", "1"] in rows

    measured, results = tmp_path / "measured.csv", tmp_path / "results"
    run("--plugin", plugin, "simulate", description, "--set", "k=3e6", "--set", "d=3e4", "-o", measured)
    values = dovetail.read_frf(measured).to("receptance").values
    stiffness = 1.0 / values + (2 * 3.141592653589793 * dovetail.read_frf(measured).frequency) ** 2
    assert stiffness == pytest.approx(3e6 + 3e4j, rel=1e-6)

    run("identify", description, measured, "--method", "network", "--plugin", plugin, "-o", results)
    found = json.loads((results / "result.json").read_text())
    assert found["parameters"]["k"]["value"] == pytest.approx(3e6, rel=0.5)
    assert found["provenance"]["components"]["joint hysteretic_spring"] == "hysteretic.py"
    assert (
        "Using the model trained before"
        in run("--plugin", plugin, "identify", description, measured, "--method", "network").stderr
    )


def test_a_changed_plugin_is_not_served_by_the_old_model(plugin):
    from dovetail.assembly import load
    from dovetail.network.model_cache import _key

    def key():
        return _key(load(plugin.with_suffix(".yaml"), plugins=[plugin]), [plugin])

    plugin.with_suffix(".yaml").write_text(DESCRIPTION)
    before = key()
    assert key() == before
    plugin.write_text(HYSTERETIC.replace("2.0", "3.0") + "\n# another stiffness\n")
    assert key() != before


def test_without_the_plugin_the_model_is_unknown(run, description):
    message = run("check", description, code=1).stderr
    assert message.startswith(f"{description}:9:12  joints.mount.model\n  'hysteretic_spring' is not a joint model.")


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("def broken(:\n", "bad.py:1\n  SyntaxError: "),
        ("import gone_package\n", "bad.py:1\n  ModuleNotFoundError: No module named 'gone_package'"),
        ("x = 1\n", "bad.py\n  it has no hook 'dovetail_components' marked with @dovetail.hookimpl."),
        (
            "import dovetail\n@dovetail.hookimpl\ndef dovetail_component(): return []\n",
            "'dovetail_component' is not a hook of dovetail.\n  Did you mean 'dovetail_components'?",
        ),
    ],
)
def test_a_bad_plugin_file_is_an_error_in_every_command(run, tmp_path, description, text, found):
    file = tmp_path / "bad.py"
    file.write_text(text)
    for arguments in (["--plugin", file, "plugins"], ["check", description, "--plugin", file]):
        done = run(*arguments, code=1)
        assert found in done.stderr
        assert "Traceback" not in done.stderr
        assert done.stdout == ""


def test_the_failing_line_is_named_for_a_relative_path(run, tmp_path, monkeypatch):
    (tmp_path / "bad.py").write_text("import dovetail\n\ndovetail.no_such_name\n")
    monkeypatch.chdir(tmp_path)
    assert run("--plugin", "bad.py", "plugins", code=1).stderr.startswith("bad.py:3\n  AttributeError: ")


def test_a_missing_plugin_file_is_reported(run, tmp_path):
    file = tmp_path / "gone.py"
    assert run("--plugin", file, "plugins", code=1).stderr == f"{file}\n  there is no such plugin file.\n"


@pytest.mark.parametrize(
    ("old", "new", "line", "reason"),
    [
        ("across = ", "across = 1 / 0 * ", "across = 1 / 0", "ZeroDivisionError: division by zero"),
        (
            "return joint",
            "return joint.gone",
            "return joint.gone",
            "AttributeError: 'StructuralMatrices' object has no",
        ),
        ("self.size)", "9)", "joint.K[:]", "ValueError: could not broadcast input array"),
    ],
)
def test_an_error_raised_by_a_running_plugin_names_its_line(shell, plugin, description, old, new, line, reason):
    plugin.write_text(HYSTERETIC.replace(old, new))
    number = next(n for n, text in enumerate(plugin.read_text().splitlines(), 1) if line in text)
    done = shell("check", description, "--plugin", plugin)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.startswith(f"{plugin}:{number}\n  joint 'mount' (hysteretic_spring) failed: {reason}")
    assert done.stderr.count("\n") == 3


def test_the_program_s_own_bug_is_called_one(shell, plugin, description):
    plugin.write_text(
        HYSTERETIC.replace(
            "import numpy as np", "import sys\nimport numpy as np\nsys.modules['dovetail.cli.check'].table = None"
        )
    )
    done = shell("check", description, "--plugin", plugin)
    assert done.returncode == 1
    assert done.stderr.startswith("Traceback (most recent call last):\n")
    assert "TypeError: 'NoneType' object is not callable" in done.stderr
    assert done.stderr.rstrip().endswith("please report it with the lines above.")
    assert "typer" not in done.stderr


def test_one_path_of_a_plugin_file_is_enough(plugin, description):
    for one in (plugin, str(plugin)):
        assert dovetail.load(description, plugins=one).name == "hysteretic"
