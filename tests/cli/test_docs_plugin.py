"""The plugins of the pages on plugins, taken from them as they stand."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
import yaml

import dovetail
from dovetail.interfaces import KINDS
from dovetail.testing import check_names

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGES = "".join((DOCS / f"{name}.md").read_text("utf-8") for name in ("plugins", "plugin_models", "plugin_readers"))
ASSEMBLY = """
dovetail: 1
name: mounted
frequency: {start: 1 Hz, stop: 600 Hz, step: 1 Hz}
substructures:
  mass: {model: lumped, masses: [{mass: 1 kg}]}
  base: {model: ground}
joints:
  mount:
    model: mount
    loss_factor: 0.05
    connect: {a: {to: mass, at: 0}, b: {to: base, at: 0}}
response: {at: mass, position: 0, quantity: receptance}
"""


def example(name: str, folder: Path) -> Path:
    """Write the plugin file of this name as the page has it."""
    blocks = re.findall(r"```python\n(.*?)```", PAGES, flags=re.S)
    (code,) = [block for block in blocks if block.startswith(f'"""{name}: ')]
    (folder / name).write_text(code, encoding="utf-8")
    return folder / name


def test_every_plugin_of_the_page_is_run_here():
    names = re.findall(r'```python\n"""(\w+\.py): ', PAGES)
    wanted = ["mount", "rail", "shaft", "bands", "ridge", "blocks", "springs", "one_step", "peaks"]
    assert names == [f"{name}.py" for name in wanted]


def test_the_command_of_the_page_prints_the_resonance_peak_and_not_the_static_end(run, tmp_path):
    frequency = np.arange(1.0, 401.0)
    values = 1.0 / (200.0**2 * (1 + 0.02j) - frequency**2) + 0.05 / (10.0 + frequency**2)
    frf = dovetail.Frf(frequency, values, "receptance")
    assert frf.amplitude.argmax() == 0
    dovetail.write_frf(frf, tmp_path / "measured.csv")
    printed = run("--plugin", example("peaks.py", tmp_path), "peaks", tmp_path / "measured.csv").stdout
    assert printed == "200.0 Hz\n"


@pytest.mark.sweep(keep=4)
@pytest.mark.parametrize("name", ["mount", "rail", "shaft", "bands", "ridge", "blocks", "springs", "one_step"])
def test_every_plugin_of_the_page_passes_the_conformance_kit(run, tmp_path, name):
    printed = run("--plugin", example(f"{name}.py", tmp_path), "check-plugin", name).stdout
    assert "failed" not in printed.splitlines()[-1]


def test_the_page_of_checks_lists_every_one():
    text = (DOCS / "conformance.md").read_text(encoding="utf-8")
    for kind in KINDS:
        for name in check_names(kind):
            assert f"- **{name.replace('_', ' ')}**: " in text


def test_the_joint_of_the_page_works_as_the_page_says(run, tmp_path):
    plugin, description = example("mount.py", tmp_path), tmp_path / "assembly.yaml"
    description.write_text(ASSEMBLY, encoding="utf-8")
    assert "stiffness of each spring" in run("--plugin", plugin, "describe", "mount").stdout
    assert "0.1 to 10 MN/m" in run("--plugin", plugin, "check", description).stdout
    assembly = dovetail.load(description, plugins=[plugin])
    k, m, omega = 1e6, 0.05, 2 * np.pi * assembly.frequency
    spring = k * (1 + 0.05j)
    expected = 1 / (spring - omega**2 - spring**2 / (2 * spring - omega**2 * m))
    np.testing.assert_allclose(assembly.frf([k, m]), expected, rtol=1e-10)


def test_the_substructure_of_the_page_has_the_frf_of_its_formula(run, tmp_path):
    plugin, description = example("rail.py", tmp_path), tmp_path / "assembly.yaml"
    rail = "{model: rail, length: 100 mm, mass: 500 g, stiffness: 1 MN/m, loss_factor: 0.02}"
    text = ASSEMBLY.replace("{model: lumped, masses: [{mass: 1 kg}]}", rail).replace("position: 0,", "position: 0.1,")
    text = text.replace("    model: mount\n    loss_factor: 0.05\n", "    model: spring_damper\n    direction: x\n")
    description.write_text(text, encoding="utf-8")
    assert "left" in run("--plugin", plugin, "check", description, "--json").stdout
    assembly = dovetail.load(description, plugins=plugin)
    k, c, omega = 2e6, 50.0, 2 * np.pi * assembly.frequency
    inner, mass = 1e6 * (1 + 0.02j), 0.5
    near = k + 1j * omega * c + inner - omega**2 * mass
    expected = 1 / (inner - omega**2 * mass - inner**2 / near)
    np.testing.assert_allclose(assembly.frf([k, c]), expected, rtol=1e-10)


def test_the_reducer_and_the_regressor_of_the_page_are_trained(run, tmp_path, assemblies):
    plugins = [example("bands.py", tmp_path), example("ridge.py", tmp_path)]
    description = tmp_path / "assembly.yaml"
    description.write_text(
        f"extends: {assemblies / 'sdof.yaml'}\n"
        "identification:\n  samples: 800\n  reducer: {model: bands, n_components: 60}\n  regressor: {model: ridge}\n",
        encoding="utf-8",
    )
    assembly = dovetail.load(description, plugins=plugins)
    model = dovetail.train(assembly)
    assert model.evaluation.parameters["k"].r2 > 0.9
    model.save(tmp_path / "model")
    again = dovetail.load_model(tmp_path / "model", plugins=plugins)
    amplitude = np.abs(assembly.frf([[3e6, 40.0], [5e6, 60.0]]))
    np.testing.assert_array_equal(again.predict_parameters(amplitude), model.predict_parameters(amplitude))
    np.testing.assert_allclose(
        model.predict_parameters(amplitude[:1]), model.predict_parameters(amplitude)[:1], rtol=1e-6
    )


def test_the_reader_of_the_page_reads_its_format(run, tmp_path):
    plugin, measured = example("blocks.py", tmp_path), tmp_path / "measured.blk"
    measured.write_text("#blocks\n10 1 0.1\n20 2 0.2\n\n10 3 0.3\n20 4 0.4\n")
    assert "accelerance" in run("--plugin", plugin, "plot", measured, "--index", "1").stdout
    frf = dovetail.read_frf(measured, index=2, plugins=plugin)
    np.testing.assert_allclose(frf.values, 9.80665 * np.array([3 + 0.3j, 4 + 0.4j]))


def test_the_method_of_the_page_identifies_a_measurement(run, tmp_path, assemblies):
    plugin, measured = example("one_step.py", tmp_path), tmp_path / "measured.csv"
    run("simulate", assemblies / "sdof.yaml", "--set", "k=3e6", "--set", "c=50", "--noise", "1%", "-o", measured)
    words = ("identify", assemblies / "sdof.yaml", measured, "--method", "one_step", "--json")
    result = json.loads(run("--plugin", plugin, *words).stdout)
    assert result["method"] == "one_step"
    assert result["parameters"]["k"]["value"] == pytest.approx(3e6, rel=0.01)


def test_the_shaft_of_the_page_is_the_one_of_shipped_parts(tmp_path):
    """A third-party part of public beam elements, against the description of a shaft with discs in docs/space.md."""
    page = (DOCS / "space.md").read_text(encoding="utf-8").partition("## Shafts with discs")[2]
    (section,) = re.findall(r"```yaml\n(.*?)```", page.partition("\n## ")[0], flags=re.S)
    described = yaml.safe_load(section)
    shaft, disc = described["substructures"]["shaft"], described["substructures"]["disc"]
    (part,) = shaft["sections"]
    polar, diametral = disc["inertia"][1], disc["inertia"][0]
    own = {"model": "shaft", "material": shaft["material"], "section": part}
    own["discs"] = [{"node": 3, "mass": disc["mass"], "polar": polar, "diametral": diametral}]
    foot = {"model": "bushing", "connect": {"a": {"to": "shaft", "at": "0 mm"}, "b": {"to": "base", "at": "0 mm"}}}
    common = {"dovetail": 1, "name": "rotor", "frequency": {"start": "10 Hz", "stop": "2 kHz", "lines": 60}}
    common["response"] = {"at": "shaft", "position": part["length"], "direction": [1, 1, 1], "quantity": "receptance"}
    parts, base = described["substructures"], {"base": {"model": "ground"}}
    shipped = {**common, "substructures": {**parts, **base}, "joints": {**described["joints"], "foot": foot}}
    alone = {**common, "substructures": {"shaft": {**own, "place": shaft["place"]}, **base}, "joints": {"foot": foot}}
    found = dovetail.load(alone, plugins=[example("shaft.py", tmp_path)]).frf()
    expected = dovetail.load(shipped).frf()
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())


def test_the_reader_of_matrices_of_the_page_reads_a_file(tmp_path):
    (tmp_path / "row.spr").write_text("# springs\nnode a 0 0.5\nnode b 0.1 0.5\nspring a b 1e6\n")
    model = dovetail.read_matrices(tmp_path / "row.spr", plugins=example("springs.py", tmp_path))
    assert model.table.nodes == ("a", "b")
    np.testing.assert_array_equal(model.matrices["K"].values, [[1e6, -1e6], [-1e6, 1e6]])
