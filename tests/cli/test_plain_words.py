"""Help and refusals speak of the command line: no Python types, no arguments of the library, no pydantic."""

from __future__ import annotations

import re

import pytest

from dovetail.cli.command_group import OWN
from dovetail.registry import CommandTable

COMMANDS = CommandTable(OWN).offers


@pytest.mark.parametrize("name", COMMANDS)
def test_help_shows_arguments_without_types_and_brackets_of_typer(run, name):
    usage, *lines = run(name, "--help").stdout.splitlines()
    assert re.fullmatch(rf"Usage: dovetail {name} \[OPTIONS\]( \[?[A-Za-z_.]+\]?(\.\.\.)?)*", usage)
    assert [line for line in lines if re.search(r"<(str|path|int|float|list)|\(\d+ \w+\)", line)] == []


@pytest.mark.parametrize(
    ("words", "refusal"),
    [
        (("generate", "sdof.yaml", "-o", "a.zarr", "--samples", "0"), r"0 is not (1 or more|in the range x>=1)\."),
        (("generate", "sdof.yaml", "-o", "a.zarr", "--samples", "many"), r"'many' is not a (whole number|valid int)"),
        (("generate", "sdof.yaml", "-o", "a.zarr", "--interpolation", "few"), "'few' is not a (number|valid float)"),
        (("generate", "sdof.yaml", "-o", "a.zarr", "--storage", "real"), "'real' is not one of 'amplitude', 'complex'"),
        (("explore", "sdof.yaml", "--port", "70000"), r"70000 is not (65535 or less|in the range 0<=x<=65535)\."),
    ],
)
def test_a_value_that_is_refused_is_named_with_what_is_accepted(run, words, refusal):
    """By pydantic in newer versions of typer, and by click in older ones."""
    said = " ".join(run(*words, code=2).stderr.split())
    assert re.search(refusal, said)
    assert "Input should" not in said


@pytest.mark.parametrize(
    ("words", "place"),
    [
        (("plot", "{data}", "--unit", "furlong"), "--unit"),
        (("plot", "{data}", "--quantity", "acceleration"), "--quantity"),
        (("convert", "{data}", "new.csv", "--to", "furlong"), "--to"),
        (("plan", "{sdof}", "--at", "wheel"), "--at"),
        (("generate", "{sdof}", "-o", "a.zarr", "--shard", "3/2"), "--shard"),
        (("compare-models", "{sdof}", "{data}"), "--joints"),
        (("identify", "{sdof}", "{data}", "--form", "round"), "--form"),
        (("identify", "{sdof}", "{data}", "--weights", "heavy"), "--weights"),
        (("describe", "colet"), "dovetail describe"),
        (("new-plugin", "joint", "my joint"), "dovetail new-plugin"),
    ],
)
def test_a_fault_of_an_option_has_the_option_as_its_place(run, tmp_path, monkeypatch, assemblies, words, place):
    monkeypatch.chdir(tmp_path)
    run("simulate", assemblies / "sdof.yaml", "-o", "data.csv")
    files = {"data": "data.csv", "sdof": assemblies / "sdof.yaml"}
    lines = run(*(word.format_map(files) for word in words), code=1).stderr.splitlines()
    assert place in [line for line in lines if not line.startswith((" ", "Read "))]
