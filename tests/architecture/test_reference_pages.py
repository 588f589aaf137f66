"""The reference pages are complete and agree with the program: names, models with drawings, options, keys."""

from __future__ import annotations

import re
import runpy
from pathlib import Path
from xml.etree import ElementTree

import pytest
import typer

from dovetail.cli.app import app
from dovetail.description import description_schema
from dovetail.registry import components

DOCS = Path(__file__).parents[2] / "docs"
GROUP = typer.main.get_command(app)


def page(name: str) -> str:
    return (DOCS / name).read_text(encoding="utf-8")


def test_the_pages_are_those_that_the_program_makes():
    made = runpy.run_path(str(DOCS / "make_reference.py"))["pages"]()
    assert set(made) == {"models.md", "options.md", "keys.md"}
    for name, text in made.items():
        assert page(name) == text, f"{name}: run 'python docs/make_reference.py'"


def test_the_drawings_are_those_that_the_models_make():
    made = runpy.run_path(str(DOCS / "make_drawings.py"))["drawings"]()
    files = {file.stem: file.read_text(encoding="utf-8") for file in (DOCS / "drawings").iterdir()}
    assert files == made, "run 'python docs/make_drawings.py'"


def test_every_joint_and_part_has_a_small_drawing_on_its_page():
    registry = components(())
    models = [
        offer.component.name
        for kind in ("joint", "substructure")
        for offer in registry.offers(kind)
        if offer.source.startswith("dovetail-frf")
    ]
    assert len(models) >= 11
    for name in models:
        drawing = DOCS / "drawings" / f"{name}.svg"
        assert ElementTree.parse(drawing).getroot().find("{http://www.w3.org/2000/svg}title").text
        assert drawing.stat().st_size < 10_000
        assert f"](drawings/{name}.svg)" in page("models.md")


@pytest.mark.parametrize("name", ["collet", "bolted", "interference_fit", "bearing", "spring_damper"])
def test_a_joint_is_listed_with_all_parameters_and_dofs(name):
    joint = runpy.run_path(str(DOCS / "make_drawings.py"))["examples"]()[name]
    section = page("models.md").partition(f"### `{name}`\n")[2].partition("\n### ")[0]
    for parameter in joint.parameters:
        assert f"| `{parameter.name}` | {parameter.description} |" in section
    table = section.partition("Local DOFs")[2].partition("\n\n- ")[0]
    numbers = re.findall(r"^\| `[\w ]+` \| (\d+) \| (\d+) \|$", table, flags=re.M)
    assert [int(number) for row in numbers for number in row] == list(range(joint.size))


def test_the_names_in_the_drawing_of_the_collet_are_those_of_the_joint():
    drawn = (DOCS / "drawings" / "collet.svg").read_text(encoding="utf-8")
    joint = runpy.run_path(str(DOCS / "make_drawings.py"))["examples"]()["collet"]
    words = set(re.findall(r"[\w]+", re.sub(r"<style>.*?</style>", "", drawn, flags=re.S)))
    assert {parameter.name for parameter in joint.parameters} <= words
    assert {"c1", "c2", "c3", "c4", "c5", "tool", "holder"} <= words
    assert set(map(str, range(joint.size))) <= words


@pytest.mark.parametrize("command", GROUP.list_commands(None))
def test_every_option_of_a_command_is_listed(command):
    section = page("options.md").partition(f"## `dovetail {command}`\n")[2].partition("\n## ")[0]
    found = GROUP.get_command(None, command)
    words = [word for parameter in found.params if parameter.param_type_name == "option" for word in parameter.opts]
    assert {"--quiet", "-q"} <= set(words)
    assert [word for word in words if not re.search(rf"`{word}[ `]", section)] == []
    assert f"`dovetail {command}" in page("commands.md")


def test_every_key_of_a_description_is_listed():
    schema = description_schema(components(()))
    kinds = ("joint", "substructure", "reducer", "regressor", "method")
    sections = {
        name: part for name, part in schema["$defs"].items() if "+" not in name and name.partition(".")[0] not in kinds
    }
    assert len(sections) >= 14
    listed = page("keys.md")
    for name, part in sections.items():
        assert [key for key in part["properties"] if f"\n- `{key}`" not in listed] == [], name
    options = [
        key for name, part in schema["$defs"].items() if "+" not in name and "." in name for key in part["properties"]
    ]
    shown = listed + page("models.md")
    own = {"model", "connect", "parameters"}
    assert [key for key in options if key not in own and not re.search(rf"`(?:[\w.\[\]]+\.)?{key}`", shown)] == []


def test_the_recipes_name_commands_and_options_that_are_there():
    lines = re.findall(r"`(?:dovetail )([^`]+)`", page("do.md"))
    assert len(lines) >= 20
    for line in lines:
        words = line.split()[2:] if line.startswith("--plugin") else line.split()
        command = GROUP.get_command(None, words[0])
        assert command is not None, line
        options = {word for parameter in command.params for word in (*parameter.opts, *parameter.secondary_opts)}
        assert {word for word in words if word.startswith("-")} <= options, line


def test_the_recipes_name_keys_that_are_there():
    keys = [key for row in re.findall(r"keys? (`[^|]+`)", page("do.md")) for key in re.findall(r"`(\w+)`", row)]
    assert len(keys) >= 5
    assert [key for key in keys if f"\n- `{key}`" not in page("keys.md")] == []
