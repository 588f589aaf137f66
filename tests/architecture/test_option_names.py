"""Messages of the library name arguments; on the command line they name the options that set them."""

import ast
import re

import pytest
import typer
from house import ROOT, source_files

from dovetail.cli.app import app
from dovetail.cli.option_names import with_options
from dovetail.errors import argument
from support.syntax_trees import nodes

WRITTEN = re.compile(r"`\w+=[^`]*`")


@pytest.mark.parametrize(
    ("message", "printed"),
    [
        (argument("columns"), "--columns"),
        (argument("columns", ["frequency", "real", "imag", "skip"]), "--columns frequency,real,imag,skip"),
        (argument("resume", True), "--resume"),
        (argument("index", 1), "--index 1"),
        (argument("drive"), "--drive-point"),
        (argument("accelerometer_mass", "1 g"), "--accelerometer-mass '1 g'"),
        (argument("names", {"real": "Re H", "imag": "NAME"}), "--name 'real=Re H' --name imag=NAME"),
        (argument("unit", "m/s^2"), "--unit 'm/s^2'"),
        (argument("unit", "it`s"), "--unit 'it`s'"),
        ("no argument, `name`, a=b, `x = 1`, `f(a=1)`", "no argument, `name`, a=b, `x = 1`, `f(a=1)`"),
        ("`k=` and `k=1 +`", "--k and `k=1 +`"),
    ],
)
def test_an_argument_becomes_the_option_that_sets_it(message, printed):
    assert with_options(message) == printed


def arguments_in_messages():
    """Return the arguments that strings of the library name, as they are in the source, and where."""
    for file in source_files():
        for node in nodes(file):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and "\n" not in node.value:
                yield from ((text, f"{file.relative_to(ROOT)}:{node.lineno}") for text in WRITTEN.findall(node.value))
            elif isinstance(node, ast.Call) and getattr(node.func, "id", "") == "argument":
                yield argument(ast.literal_eval(node.args[0])), f"{file.relative_to(ROOT)}:{node.lineno}"


def test_every_argument_that_a_message_names_is_an_option():
    group = typer.main.get_group(app)
    commands = [group.get_command(None, name) for name in group.list_commands(None)]
    options = {name for command in commands for option in command.params for name in option.opts}
    named = dict(arguments_in_messages())
    assert named
    printed = {f"{place}: {with_options(text).split()[0]}" for text, place in named.items()}
    assert {text for text in printed if text.rpartition(" ")[2] not in options} == set()


def strings(file):
    """Return the strings of a module, docstrings among them."""
    return [node for node in nodes(file) if isinstance(node, ast.Constant) and isinstance(node.value, str)]


def is_command_line(file):
    imported = {alias.name for node in nodes(file) if isinstance(node, ast.Import) for alias in node.names}
    return "cli" in file.relative_to(ROOT).parts or "typer" in imported


def test_the_library_names_no_option_of_the_command_line():
    assert [
        f"{file.relative_to(ROOT)}:{node.lineno}"
        for file in source_files()
        if not is_command_line(file)
        for node in strings(file)
        if re.search(r"(^|[\s'\"`])--[a-z]", node.value)
    ] == []
