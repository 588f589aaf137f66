"""The JSON Schema of a description: every shipped one is valid, and what is misspelt is not."""

from __future__ import annotations

import copy
import importlib
import json
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from dovetail.description import description_schema
from dovetail.documents.fault_list import FaultList
from dovetail.documents.tree import plain_values
from dovetail.documents.yaml_reader import read_yaml
from dovetail.interfaces import KINDS, JointModel
from dovetail.registry import Registry, installed_components

ROOT = Path(__file__).resolve().parents[2]
MADE_BY_THE_USER = {("substructures",), ("joints",)}


def read(file: Path) -> Any:
    return plain_values(read_yaml(str(file), 0, FaultList()))


def is_description(file: Path) -> bool:
    return bool({"dovetail", "extends"} & set(read(file)))


FILES = [file for folder in ("assemblies", "docs") for file in sorted((ROOT / folder).rglob("*.yaml"))]
DESCRIPTIONS = [file for file in FILES if is_description(file)]


@cache
def validator() -> jsonschema.Draft202012Validator:
    """With what is installed, and the outside packages of the docs."""
    registry = Registry()
    registry.load_entry_points()
    with pytest.MonkeyPatch.context() as patch:
        for source in sorted((ROOT / "docs" / "examples").glob("*/src/*/__init__.py")):
            patch.syspath_prepend(source.parents[1])
            registry.add(importlib.import_module(source.parent.name), "docs")
    schema = json.loads(json.dumps(description_schema(registry), allow_nan=False))
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def faults(description: Any) -> list[str]:
    errors = validator().iter_errors(description)
    return [f"{'.'.join(map(str, error.absolute_path))}: {error.message}" for error in errors]


@pytest.mark.parametrize("file", DESCRIPTIONS, ids=lambda file: str(file.relative_to(ROOT)))
def test_every_shipped_description_is_valid(file):
    assert faults(read(file)) == []


def test_there_are_descriptions_to_validate():
    assert len(DESCRIPTIONS) >= 10


def keys(node: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the path of every key of a description, but the names that its user made."""
    if isinstance(node, dict):
        for key, value in node.items():
            if path not in MADE_BY_THE_USER:
                yield (*path, key)
            yield from keys(value, (*path, key))
    elif isinstance(node, list):
        for index, value in enumerate(node):
            yield from keys(value, (*path, index))


def with_key(description: Any, path: tuple[Any, ...], key: str) -> Any:
    changed = copy.deepcopy(description)
    node = changed
    for part in path[:-1]:
        node = node[part]
    node[key] = node.pop(path[-1])
    return changed


@pytest.mark.parametrize("file", DESCRIPTIONS, ids=lambda file: str(file.relative_to(ROOT)))
def test_every_misspelt_key_fails(file):
    description = read(file)
    misspelt = [path for path in keys(description) if validator().is_valid(with_key(description, path, f"{path[-1]}_"))]
    assert misspelt == []


@pytest.mark.parametrize("path", [("dovetail",), ("frequency",), ("response", "at"), ("joints", "collet", "connect")])
def test_a_missing_key_fails_except_in_an_extension(path):
    description = read(ROOT / "assemblies" / "bt40_er32.yaml")
    node = description
    for part in path[:-1]:
        node = node[part]
    del node[path[-1]]
    assert faults(description) != []
    assert faults({**description, "extends": "other.yaml"}) == []


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("substructures", "tool", "material", "poisson"), 0.7),
        (("substructures", "tool", "sections"), []),
        (("joints", "collet", "parameters", "kt_tc"), ["1e8 N/m", "2e9 N/m"]),
        (("joints", "collet", "parameters", "kt_tc"), {"range": ["1e8 N/m"]}),
        (("response", "direction"), "w"),
        (("joints", "collet", "model"), "colet"),
        (("identification", "regressor"), {"model": "umap"}),
    ],
)
def test_a_wrong_value_fails(path, value):
    description = read(ROOT / "assemblies" / "bt40_er32.yaml")
    node = description
    for part in path[:-1]:
        node = node[part]
    node[path[-1]] = value
    assert faults(description) != []


def test_a_response_or_a_list_of_them_is_valid_and_both_are_not():
    description = read(ROOT / "assemblies" / "bt40_er32.yaml")
    one = description.pop("response")
    assert faults(description) != []
    assert faults({**description, "responses": [one, {**one, "position": "0 mm"}]}) == []
    assert faults({**description, "response": one, "responses": [one]}) != []
    assert faults({**description, "responses": [{**one, "direction": "w"}]}) != []
    assert faults({**description, "responses": []}) != []
    assert faults({"extends": "other.yaml", "dovetail": 1, "responses": [one]}) == []


def test_every_option_and_parameter_of_every_component_is_described_with_its_unit():
    definitions = description_schema(installed_components())["$defs"]
    for kind in (kind for kind in KINDS if kind not in ("reader", "matrix_reader", "law")):  # assemblies name none
        for offer in installed_components().offers(kind):
            section = definitions[f"{kind}.{offer.component.name}"]
            assert set(offer.component.Config.model_fields) <= set(section["properties"])
            for name, entry in section["properties"].items():
                assert entry.get("description"), f"{kind} {offer.component.name}.{name}"
            if issubclass(offer.component, JointModel):
                for name, entry in section["properties"]["parameters"]["properties"].items():
                    assert f"[{entry['x-unit']}]" in entry["description"], name
    assert definitions["joint.collet"]["properties"]["segment"]["description"].endswith("contact nodes [m].")
    assert definitions["frequency"]["properties"]["step"]["description"] == "Distance of the lines [Hz]."


def test_the_command_writes_the_schema(run, tmp_path):
    file = tmp_path / "dovetail.schema.json"
    run("schema", "-o", file)
    assert json.loads(file.read_text(encoding="utf-8")) == json.loads(run("schema").stdout)
    assert "a file of this name already exists" in run("schema", "-o", file, code=1).stderr
    run("schema", "-o", file, "--overwrite")
    assert list(tmp_path.iterdir()) == [file]


def test_a_plugin_file_s_options_are_in_it(run, tmp_path):
    file = tmp_path / "pad.py"
    file.write_text(
        "import dovetail\n"
        "class Pad(dovetail.Reducer):\n"
        '    name, summary = "pad", "A pad"\n'
        "    class Config(dovetail.ComponentConfig):\n"
        "        width: int = 3\n"
        "    def fit(self, features, *, seed): ...\n"
        "    def restore(self, state): ...\n"
        "@dovetail.hookimpl\n"
        "def dovetail_components(): return [Pad]\n"
    )
    made = json.loads(run("schema", "--plugin", file).stdout)
    assert made["$defs"]["reducer.pad"]["properties"]["width"]["type"] == "integer"


@pytest.fixture
def run():
    from typer.testing import CliRunner

    from dovetail.cli.app import app

    def invoke(*words: object, code: int = 0):
        result = CliRunner().invoke(app, [str(word) for word in words])
        assert result.exit_code == code, result.output
        return result

    return invoke


def test_unknown_options_of_parts_and_chains_are_in_the_schema():
    description = read(ROOT / "assemblies" / "bt40_er32.yaml")
    beam = description["substructures"]["tool"]
    for young in (
        {"range": ["190 GPa", 2.2e11]},
        {"about": "206 GPa", "sd": "1 %"},
        {"same_as": "holder.material.young"},
    ):
        unknown = {**beam, "material": {**beam["material"], "young": young}}
        assert faults({**description, "substructures": {**description["substructures"], "tool": unknown}}) == []
    wrong = {**beam, "material": {**beam["material"], "young": {"rnage": [1, 2]}}}
    assert faults({**description, "substructures": {**description["substructures"], "tool": wrong}}) != []
    chain = {"gain": {"about": 1, "sd": "5 %"}, "delay": "3 us", "sign": "unknown", "mass": {"range": [0, "10 g"]}}
    response = {**description["response"], "force": {"position": "0 mm"}, "name": "tip", "calibration": chain}
    assert faults({**description, "response": response}) == []
    assert faults({**description, "response": {**response, "calibration": {"gian": 1}}}) != []
    assert faults({**description, "response": {**response, "force": {"at": "tool"}}}) != []


def test_the_lines_may_be_a_list_and_have_bands():
    description = read(ROOT / "assemblies" / "bt40_er32.yaml")
    assert faults({**description, "frequency": ["100 Hz", 150, 200]}) == []
    assert faults({**description, "frequency": ["100 Hz"]}) != []
    bands = {**description["frequency"], "bands": [["100 Hz", "2 kHz"]], "without": [[48, 52]]}
    assert faults({**description, "frequency": bands}) == []
